"""How repeatable PA-HKS keypoints are between virtual views of a mesh, as a Markdown table.

    python -m benchmarks.keypoints [MESH ...] --out keypoints.json
    python -m benchmarks.keypoints --quick

A keypoint is repeated if the other view, which sees its place, has a keypoint within 3 % of the
diameter of it. The chance level is the share of evenly spread samples for which that holds. Recall
at 8 is the share of repeated keypoints whose partner is among the 8 nearest signatures.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import mean
from typing import NamedTuple

import numpy as np

from benchmarks.blocks import rendered
from benchmarks.results import Json, write_results
from benchmarks.sets import data_folder
from scanweld.config import HeatConfig, PrepareConfig
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import Axis, view_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat import Features, describe
from scanweld.io import read_mesh
from scanweld.preparation import prepare

GAPS_DEG = (30, 50, 70, 90)
AZIMUTHS_DEG = (0, 90, 180, 270)
ELEVATION_DEG = 10
RADIUS_DIAMETERS = 0.03
NEAREST = 8
COLUMNS = ("keypoints", "repeated", "repeated_chance", "recall", "recall_chance", "seconds")


class Seen(NamedTuple):
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
    parser.add_argument("--quick", action="store_true", help="two views of a made object")
    parser.add_argument("--out", type=Path, help="JSON file of all comparisons of two views")
    options = parser.parse_args()
    if options.quick:
        compared = comparisons("creature", creature(voxels=80), "z", (0,), (30,))
    else:
        data = data_folder(None) / "meshes"
        paths = options.meshes or [data / "armadillo.ply", data / "bunny.ply"]
        compared = [c for p in paths for c in comparisons(p.stem, read_mesh(p), options.up)]
    if options.out:
        write_results(options.out, compared)
    print(rendered("keypoints", **over_views(compared)), end="")


def comparisons(
    name: str,
    mesh: TriangleMesh,
    up: Axis,
    azimuths_deg: Sequence[float] = AZIMUTHS_DEG,
    gaps_deg: Sequence[float] = GAPS_DEG,
) -> list[Json]:
    """Both directions of all pairs of views of a mesh."""
    found = []
    for azimuth in azimuths_deg:
        first = look(mesh, azimuth, up)
        for gap in gaps_deg:
            second = look(mesh, azimuth + gap, up)
            of = {"mesh": name, "azimuth": azimuth, "gap": gap}
            for i, j in ((first, second), (second, first)):
                cost = {"keypoints": len(j.features.points), "seconds": second.seconds}
                found.append({**of, **compare(i, j), **cost})
    return found


def over_views(compared: Sequence[Json]) -> Json:
    """Means of the columns for each mesh and gap; None where nothing is known."""
    views = []
    for mesh, gap in dict.fromkeys((c["mesh"], c["gap"]) for c in compared):
        of = [c for c in compared if (c["mesh"], c["gap"]) == (mesh, gap)]
        known = ([c[key] for c in of if c[key] is not None] for key in COLUMNS)
        views.append((mesh, gap, [mean(values) if values else None for values in known]))
    return {"views": views}


def look(mesh: TriangleMesh, azimuth_deg: float, up: Axis) -> Seen:
    """A view whose camera is rolled by an angle that depends on the azimuth."""
    view = view_of(mesh, azimuth_deg, ELEVATION_DEG, 137.0 * azimuth_deg % 360, up=up)
    pose = view.world_from_sensor
    scan = prepare(scan_mesh(mesh, view.camera, pose), PrepareConfig())
    start = time.perf_counter()
    features = describe(scan, HeatConfig())
    return Seen(pose, scan, features, time.perf_counter() - start)


def compare(i: Seen, j: Seen) -> dict[str, float | None]:
    """Repeatability of i's keypoints in j and recall at 8, each with its chance level."""
    j_from_i = j.world_from_sensor.inverse() @ i.world_from_sensor
    points, samples = (j_from_i.apply(p) for p in (i.features.points, i.scan.samples.points))
    samples = samples[_is_seen(samples, j.scan)]
    is_near = _near(points, j) & _is_seen(points, j.scan)[:, None]
    repeated: BoolArray = np.any(is_near, axis=1)
    apart = np.linalg.norm(i.features.signatures[:, None] - j.features.signatures[None], axis=-1)
    among = np.argsort(apart, axis=1, kind="stable")[:, :NEAREST]
    is_found: BoolArray = np.any(np.take_along_axis(is_near, among, axis=1), axis=1)
    return {
        "repeated": float(repeated.sum() / _is_seen(points, j.scan).sum()),
        "repeated_chance": float(np.mean(_near(samples, j).any(axis=1))),
        "recall": float(np.mean(is_found[repeated])) if repeated.any() else None,
        "recall_chance": NEAREST / len(j.features.points),
    }


def _near(points: FloatArray, seen: Seen) -> BoolArray:
    """Which of a view's M keypoints are near which points (N, 3), sensor frame: (N, M)."""
    away = np.linalg.norm(points[:, None] - seen.features.points[None], axis=-1)
    return away < RADIUS_DIAMETERS * seen.scan.diameter


def _is_seen(points: FloatArray, scan: PreparedScan) -> BoolArray:
    """Which points (N, 3), sensor frame, lie on the surface that the scan shows."""
    pixels, depth = scan.image.camera.project(points)
    columns, rows = np.rint(pixels).astype(int).T
    height, width = scan.image.depth.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    shown = scan.image.depth[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return inside & (np.abs(shown - depth) < 4 * scan.image.pixel)


if __name__ == "__main__":
    main()
