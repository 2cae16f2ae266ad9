"""GLB, binary glTF 2.0: points and triangles of all nodes, normals and colours.

Coordinates are those of the scene, in double precision: single ones in the buffer, moved by their
nodes. Axes and unit stay as they are (y up, metres).
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.io.gltf import Gltf, Mode, parse_glb
from scanweld.io.raw import RawScan, to_bytes
from scanweld.io.scan_formats.records import Keeps, ScanFormat


def read_glb(path: Path, data: bytes) -> RawScan:
    """All points and triangles of a scene, node after node.

    Raises:
        ReadError: If it is no such file, is broken, or is packed in a way that is not read.
    """
    gltf = parse_glb(path, data)
    meshes = [part for mesh, moved in gltf.placed_meshes() for part in _parts(gltf, mesh, moved)]
    if not meshes:
        raise ReadError(f"{path}: holds no points or triangles; export the scan as a mesh")
    points, faces, normals, colors = zip(*meshes, strict=True)
    first = np.cumsum([0, *map(len, points)])
    corners = [face + begin for face, begin in zip(faces, first, strict=False) if face is not None]
    notes: list[str] = []
    return RawScan(
        points=np.concatenate(points),
        faces=np.concatenate(corners) if corners else None,
        normals=_of_all(normals, "normals", notes),
        colors=_of_all(colors, "colours", notes),
        notes=tuple(notes),
    )


def _of_all(arrays: Sequence[NDArray | None], what: str, notes: list[str]) -> NDArray | None:
    """What all meshes have, one after the other; a note is added if only some have it."""
    there = [array for array in arrays if array is not None]
    if len(there) == len(arrays):
        return np.concatenate(there)
    if there:
        notes.append(f"{what} on some of its meshes only, so they were left out")
    return None


def _parts(
    gltf: Gltf, mesh: Any, scene_from_mesh: FloatArray
) -> Iterator[tuple[FloatArray, IntArray | None, FloatArray | None, ByteArray | None]]:
    """Points, faces, normals and colours of a mesh's primitives that are points or triangles."""
    for primitive in gltf.entries(mesh, "primitives"):
        mode = primitive.get("mode", Mode.TRIANGLES)
        names = primitive.get("attributes")
        if mode not in [*Mode] or not isinstance(names, dict):
            raise gltf.broken("holds strips, fans or lines; export it as triangles or points")
        if "POSITION" not in names:
            continue
        points = gltf.accessor(names["POSITION"], (3,))
        if points.dtype.kind != "f":
            raise gltf.broken("its points are packed as whole numbers")
        faces = None
        if mode == Mode.TRIANGLES:
            corners = np.arange(len(points))
            if "indices" in primitive:
                corners = gltf.accessor(primitive["indices"], (1,)).astype(np.int64).ravel()
            if len(corners) % 3 or (len(corners) and corners.max() >= len(points)):
                raise gltf.broken("its indices do not make triangles")
            faces = corners.reshape(-1, 3)
        linear = scene_from_mesh[:3, :3]
        yield (
            points.astype(np.float64) @ linear.T + scene_from_mesh[:3, 3],
            faces,
            _normals(_attribute(gltf, names, "NORMAL", (3,), len(points)), linear),
            _colors(_attribute(gltf, names, "COLOR_0", (3, 4), len(points))),
        )


def _attribute(
    gltf: Gltf, names: dict[str, Any], name: str, widths: tuple[int, ...], count: int
) -> NDArray | None:
    if name not in names:
        return None
    found = gltf.accessor(names[name], widths)
    if len(found) != count:
        raise gltf.broken(f"has not as many values of {name} as points")
    return found


def _normals(values: NDArray | None, linear: FloatArray) -> FloatArray | None:
    """Unit normals moved with their mesh: by the inverse transpose, up to length."""
    if values is None:
        return None
    cofactors = np.stack([np.cross(linear[(k + 1) % 3], linear[(k + 2) % 3]) for k in range(3)])
    turned = values.astype(np.float64) @ cofactors.T * np.sign(np.linalg.det(linear))
    lengths = np.linalg.norm(turned, axis=1, keepdims=True)
    return np.divide(turned, lengths, out=np.zeros_like(turned), where=lengths > 0)


def _colors(values: NDArray | None) -> ByteArray | None:
    """Red, green, blue (N, 3) for the screen of glTF's colours, which are in linear light.

    Bytes, too coarse for that, are colours of the screen: trimesh and apps of phones write these.
    """
    if values is None:
        return None
    if values.dtype == np.uint8:
        return values[:, :3].copy()
    if values.dtype.kind == "u":
        values = values / np.iinfo(values.dtype).max
    light = np.clip(np.nan_to_num(values[:, :3]), 0.0, 1.0)
    bright = 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055
    return to_bytes(np.where(light <= 0.0031308, 12.92 * light, bright), "f8")


FORMAT = ScanFormat(
    suffixes=(".glb",),
    read=read_glb,
    keeps=(Keeps.FACES, Keeps.NORMALS, Keeps.COLORS),
    begins=(b"glTF",),
)
