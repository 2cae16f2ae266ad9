"""How repeatable PA-HKS keypoints are between virtual views of a mesh, as a Markdown table.

    python -m benchmarks.keypoints [MESH ...] --out keypoints.json
    python -m benchmarks.keypoints --quick

A keypoint is repeated if the other view, which sees its place, has a keypoint within 3 % of the
diameter of it. The chance level is the share of evenly spread samples for which that holds. Recall
at 8 is the share of repeated keypoints whose partner is among the 8 nearest signatures.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from itertools import permutations
from pathlib import Path
from statistics import mean
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.blocks import rendered
from benchmarks.paper.baselines.feature_views import is_seen
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

    def near(self, points: FloatArray) -> BoolArray:
        """Which of its M keypoints are near which points (N, 3), sensor frame: (N, M)."""
        return cdist(points, self.features.points) < RADIUS_DIAMETERS * self.scan.diameter


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", type=Path, help="default: those of the data")
    parser.add_argument("--up", default="y", choices=["x", "y", "z"])
    parser.add_argument("--quick", action="store_true", help="two views of a made object")
    parser.add_argument("--out", type=Path, help="JSON file of all comparisons of two views")
    options = parser.parse_args()
    if options.quick:
        compared = list(comparisons("creature", creature(voxels=80), "z", (0,), (30,)))
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
) -> Iterator[Json]:
    """Both directions of all pairs of views of a mesh."""
    for azimuth in azimuths_deg:
        first = look(mesh, azimuth, up)
        for gap in gaps_deg:
            second = look(mesh, azimuth + gap, up)
            for i, j in permutations((first, second)):
                cost = {"keypoints": len(j.features.points), "seconds": second.seconds}
                yield {"mesh": name, "azimuth": azimuth, "gap": gap, **compare(i, j), **cost}


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
    seen, samples = is_seen(points, j.scan), samples[is_seen(samples, j.scan)]
    is_near = j.near(points) & seen[:, None]
    repeated: BoolArray = np.any(is_near, axis=1)
    apart = cdist(i.features.signatures, j.features.signatures)
    among = np.argsort(apart, axis=1, kind="stable")[:, :NEAREST]
    is_found: BoolArray = np.any(np.take_along_axis(is_near, among, axis=1), axis=1)
    return {
        "repeated": float(repeated.sum() / seen.sum()),
        "repeated_chance": float(np.mean(j.near(samples).any(axis=1))),
        "recall": float(np.mean(is_found[repeated])) if repeated.any() else None,
        "recall_chance": NEAREST / len(j.features.points),
    }


if __name__ == "__main__":
    main()
