"""Draw the README's picture from the demo's folder: left the heap of scans, right the model.

python docs/readme_picture.py demo docs/heap-to-model.png
"""

import colorsys
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import scanweld
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.shading import render_shaded, side_by_side, write_png
from scanweld.preparation import prepare

VIEW = np.array([0.75, 1.0, 0.4])
SIZE = 520


def heap(scans: Sequence[scanweld.RangeScan]) -> scanweld.TriangleMesh:
    """The scans' surfaces, turned as in their files and thrown together, a colour for each."""
    vertices, faces, colors, start = [], [], [], 0
    for k, scan in enumerate(scans):
        prepared = prepare(scan, scanweld.Config().prepare)
        surface = prepared.scan_from_sensor.apply(prepared.mesh.vertices)
        vertices.append(surface - surface.mean(axis=0))
        faces.append(towards_viewer(vertices[-1], prepared.mesh.faces) + start)
        color = np.array(colorsys.hsv_to_rgb(k / len(scans), 0.5, 0.9)) * 255
        colors.append(np.tile(color, (len(vertices[-1]), 1)))
        start += len(vertices[-1])
    return scanweld.TriangleMesh(
        vertices=np.concatenate(vertices),
        faces=np.concatenate(faces),
        colors=np.concatenate(colors).astype(np.uint8),
    )


def towards_viewer(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces, turned so that none is seen from behind."""
    away = face_normals(vertices, faces) @ VIEW < 0
    return np.where(away[:, None], faces[:, ::-1], faces)


def draw(folder: Path, picture: Path) -> None:
    """Render both and put them side by side; the model stands upright by the true poses."""
    reference = scanweld.read_poses(folder / "model/poses.json").components[0][0]
    upright = scanweld.read_poses(folder / "scans/truth/poses.json").poses[reference]
    model = scanweld.read_mesh(folder / "model/model.ply")
    normals = None if model.normals is None else upright.turn(model.normals)
    model = replace(model, vertices=upright.apply(model.vertices), normals=normals)
    loaded = heap(scanweld.read_scans(folder / "scans"))
    pictures = [render_shaded(mesh, VIEW, size=SIZE) for mesh in (loaded, model)]
    write_png(picture, side_by_side(pictures))


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
