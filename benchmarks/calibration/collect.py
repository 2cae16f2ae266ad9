"""Run the main job on the sets of the calibration, and hold all poses that it names to truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.calibration.scenes import make_set
from benchmarks.judging.trial import is_right_pair
from benchmarks.kept import Kept, Result, Unit
from benchmarks.virtual.scene import Scene
from scanweld.config import Config, FusionConfig
from scanweld.errors import ScanweldError
from scanweld.evaluation.metrics import evaluate_poses
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.io import PoseSet
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction

CONFIG = Config(fusion=FusionConfig(max_voxels_across=50))
"""The defaults; nobody looks at the model."""
NUM_SETS, NUM_QUICK = 280, 4


@dataclass(kw_only=True)
class Sets(Kept):
    """The sets by seed."""

    num_sets: int = NUM_SETS
    NAME: str = "calibration"
    TITLE: str = "Calibration of the confidence"

    def units(self, quick: bool) -> list[Unit]:
        """All sets; a few if quick."""
        return [{"seed": seed} for seed in range(min(self.num_sets, NUM_QUICK if quick else 10**6))]

    def measure(self, unit: Unit) -> Result:
        """Grounds of every pair and scan of a set that has a pose, and whether it is right."""
        scene = make_set(unit["seed"])
        try:
            found = run(scene.scans, CONFIG, workers=1)
        except ScanweldError as error:
            return {"error": str(error), "pairs": [], "scans": []}
        pairs = [
            {
                **{"i": pair.i, "j": pair.j, "kind": str(pair.kind)},
                **{"observability": pair.observability, "accepted": pair.accepted},
                "grounds": dict(pair.grounds),
                "right": is_right_pair(pair.i, pair.j, pair.i_from_j, scene),
            }
            for pair in found.pairs
            if pair.i_from_j is not None
        ]
        scans = _with_errors(_scans(found, scene), found, scene)
        return {"pairs": pairs, "scans": scans}


def _scans(found: Reconstruction, scene: Scene) -> list[dict[str, Any]]:
    """Placed scans. Right are the most that agree with each other, if they are two or more."""
    records = []
    for number, component in enumerate(found.components):
        core = _largest_agreeing(found, component, scene)
        records += [
            {
                **{"name": name, "component": number, "reference": name == component[0]},
                "grounds": dict(found.scans[name].grounds),
                "right": name in core,
            }
            for name in component
        ]
    return records


def _with_errors(
    records: list[dict[str, Any]], found: Reconstruction, scene: Scene
) -> list[dict[str, Any]]:
    """Records of right scans with their errors, and the deviations their bounds are made of."""
    estimate = PoseSet(poses=dict(found.poses), components=found.components)
    errors = evaluate_poses(
        estimate, scene.truth, centroids=scene.centroids, diameter=scene.diameter
    )
    for record in records:
        error, report = errors.scans.get(record["name"]), found.scans[record["name"]]
        if found.sensor is None or error is None or report.deviation is None:
            continue
        if record["right"] and np.isfinite(error.rotation_deg):
            diameter, sigma = found.sensor.diameter, found.sensor.sigma
            turns = error.rotation_deg, report.deviation_deg
            record["errors"] = {
                "rotation": [*np.radians(turns).tolist(), sigma / lever_arm(diameter)],
                "translation": [
                    length / diameter for length in (error.translation, report.deviation, sigma)
                ],
            }
    return records


def _largest_agreeing(
    found: Reconstruction, component: Sequence[str], scene: Scene
) -> frozenset[str]:
    """The most scans of a component that are right as one of them sees it; none if it is alone."""

    def agree(i: str, j: str) -> bool:
        return is_right_pair(i, j, found.poses[i].inverse() @ found.poses[j], scene)

    beside = {i: frozenset(j for j in component if j != i and agree(i, j)) for i in component}
    largest = max(component, key=lambda i: len(beside[i]))
    return beside[largest] | {largest} if beside[largest] else frozenset()
