"""How repeatable PA-HKS keypoints are between virtual views of a mesh, as a Markdown table.

    python benchmarks/keypoints.py [MESH ...] --out keypoints.json

A keypoint is repeated if the other view, which sees its place, has a keypoint within 3 % of the
diameter of it. The chance level is the share of evenly spread samples for which that holds. Recall
at 8 is the share of repeated keypoints whose partner is among the 8 nearest signatures.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np
import trimesh

from results import write_results
from scanweld.config import HeatConfig, PrepareConfig
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import Axis, view_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat import Features, describe
from scanweld.preparation import prepare
from sets import data_folder

GAPS_DEG = (30, 50, 70, 90)
AZIMUTHS_DEG = (0, 90, 180, 270)
ELEVATION_DEG = 10
RADIUS_DIAMETERS = 0.03
NEAREST = 8
COLUMNS = ("keypoints", "repeated", "repeated_chance", "recall", "recall_chance", "seconds")
HEADINGS = (
    *("mesh", "gap (deg)", "keypoints", "repeated", "chance", "recall at 8", "chance", "seconds"),
)


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A described view."""

    world_from_sensor: Pose
    scan: PreparedScan
    features: Features
    seconds: float


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", type=Path, help="default: those of the data")
    parser.add_argument("--up", default="y", choices=["x", "y", "z"])
    parser.add_argument("--out", type=Path, help="JSON file of all comparisons of two views")
    arguments = parser.parse_args()
    data = data_folder(None) / "meshes"
    meshes = arguments.meshes or [data / "armadillo.ply", data / "bunny.ply"]
    compared = [one for path in meshes for one in comparisons(path, arguments.up)]
    if arguments.out:
        write_results(arguments.out, compared)
    print("\n".join(table(compared)))


def comparisons(path: Path, up: Axis) -> list[dict[str, Any]]:
    """Both directions of all pairs of views of a mesh."""
    loaded = trimesh.load_mesh(path, process=False)
    mesh = TriangleMesh(vertices=loaded.vertices, faces=loaded.faces)
    found = []
    for azimuth in AZIMUTHS_DEG:
        first = look(mesh, azimuth, up)
        for gap in GAPS_DEG:
            second = look(mesh, azimuth + gap, up)
            for i, j in ((first, second), (second, first)):
                found.append(
                    {"mesh": path.stem, "azimuth": azimuth, "gap": gap, **compare(i, j)}
                    | {"keypoints": len(j.features.points), "seconds": second.seconds}
                )
    return found


def table(compared: Sequence[Mapping[str, Any]]) -> list[str]:
    """Markdown lines: means for each mesh and gap."""
    lines = [f"| {' | '.join(HEADINGS)} |", "|" + "---|" * len(HEADINGS)]
    for mesh, gap in dict.fromkeys((c["mesh"], c["gap"]) for c in compared):
        of = [c for c in compared if (c["mesh"], c["gap"]) == (mesh, gap)]
        cells = [f"{mean(c[k] for c in of if c[k] is not None):.2f}" for k in COLUMNS]
        lines.append(f"| {mesh} | {gap} | {' | '.join(cells)} |")
    return lines


def look(mesh: TriangleMesh, azimuth_deg: float, up: Axis) -> Seen:
    """A view whose camera is rolled by an angle that depends on the azimuth."""
    view = view_of(mesh, azimuth_deg, ELEVATION_DEG, 137.0 * azimuth_deg % 360, up=up)
    scan = prepare(scan_mesh(mesh, view.camera, view.world_from_sensor), PrepareConfig())
    start = time.perf_counter()
    features = describe(scan, HeatConfig())
    seconds = time.perf_counter() - start
    return Seen(
        world_from_sensor=view.world_from_sensor, scan=scan, features=features, seconds=seconds
    )


def compare(i: Seen, j: Seen) -> dict[str, float | None]:
    """Repeatability of i's keypoints in j and recall at 8, each with its chance level."""
    j_from_i = j.world_from_sensor.inverse() @ i.world_from_sensor
    radius = RADIUS_DIAMETERS * j.scan.diameter
    points = j_from_i.apply(i.features.points)
    is_near = near(points, j.features.points, radius) & is_seen(points, j.scan)[:, None]
    samples = j_from_i.apply(i.scan.samples.points)
    samples = samples[is_seen(samples, j.scan)]
    chance = float(np.mean(near(samples, j.features.points, radius).any(axis=1)))
    repeated: BoolArray = np.any(is_near, axis=1)
    apart = np.linalg.norm(i.features.signatures[:, None] - j.features.signatures[None], axis=-1)
    among = np.argsort(apart, axis=1, kind="stable")[:, :NEAREST]
    is_found: BoolArray = np.any(np.take_along_axis(is_near, among, axis=1), axis=1)
    return {
        "repeated": float(repeated.sum() / is_seen(points, j.scan).sum()),
        "repeated_chance": chance,
        "recall": float(np.mean(is_found[repeated])) if repeated.any() else None,
        "recall_chance": NEAREST / len(j.features.points),
    }


def near(points: FloatArray, others: FloatArray, radius: float) -> BoolArray:
    """Which of the others (M,) are near which points (N,): (N, M)."""
    return np.linalg.norm(points[:, None] - others[None], axis=-1) < radius


def is_seen(points: FloatArray, scan: PreparedScan) -> BoolArray:
    """Which points (N, 3), sensor frame, lie on the surface that the scan shows."""
    pixels, depth = scan.image.camera.project(points)
    columns, rows = np.rint(pixels).astype(int).T
    height, width = scan.image.depth.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    shown = scan.image.depth[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return inside & (np.abs(shown - depth) < 4 * scan.image.pixel)


if __name__ == "__main__":
    main()
