"""Run the main job on the sets of the calibration, and hold all poses that it names to truth."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.calibration.scenes import make_set
from benchmarks.judging.trial import is_right_pair
from benchmarks.kept import Result, Unit
from benchmarks.virtual.scene import Scene
from scanweld.config import Config, FusionConfig
from scanweld.errors import ScanweldError
from scanweld.evaluation.metrics import Limits, evaluate_poses
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction

CONFIG = Config(fusion=FusionConfig(max_voxels_across=50))
"""The defaults; nobody looks at the model."""
NUM_SETS, NUM_QUICK = 280, 4
SAME_ANSWER = Limits(RIVAL_ANGLE_DEG, 100.0 * RIVAL_SHIFT_DIAMETERS)
"""Poses that differ by less are no rivals."""


@dataclass(kw_only=True)
class Sets:
    """The sets by seed."""

    num_sets: int = NUM_SETS
    NAME: str = "calibration"

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
                "right": _is_right(pair.i, pair.j, pair.i_from_j, scene),
            }
            for pair in found.pairs
            if pair.i_from_j is not None
        ]
        scans = _with_errors(_scans(found, scene), found, scene)
        return {"pairs": pairs, "scans": scans}


def _is_right(i: str, j: str, i_from_j: Pose, scene: Scene) -> bool | None:
    """Whether a pose between two scans is right; None if it is the same answer, but inexact.

    How exact poses are is for the bounds to say.
    """
    if is_right_pair(i, j, i_from_j, scene):
        return True
    is_near = is_right_pair(i, j, i_from_j, replace(scene, limits=SAME_ANSWER))
    return None if is_near else False


def _scans(found: Reconstruction, scene: Scene) -> list[dict[str, Any]]:
    """Placed scans. Right are the most that agree with each other, if they are two or more."""
    records = []
    for number, component in enumerate(found.components):
        right = _as_most_see(found, component, scene)
        records += [
            {
                **{"name": name, "component": number, "reference": name == component[0]},
                "grounds": dict(found.scans[name].grounds),
                "right": right[name],
            }
            for name in component
        ]
    return records


def _with_errors(
    records: list[dict[str, Any]], found: Reconstruction, scene: Scene
) -> list[dict[str, Any]]:
    """Records of scans that are not wrong with what their bounds are made of.

    Errors and deviations are shares of the diameter, rotations at the lever arm.
    """
    estimate = PoseSet(poses=dict(found.poses), components=found.components)
    errors = evaluate_poses(
        estimate, scene.truth, centroids=scene.centroids, diameter=scene.diameter
    )
    for record in records:
        error, report = errors.scans.get(record["name"]), found.scans[record["name"]]
        if found.sensor is None or error is None or report.deviation is None:
            continue
        if record["right"] is not False and np.isfinite(error.rotation_deg):
            diameter, arm = found.sensor.diameter, lever_arm(1.0)
            turns = np.radians((error.rotation_deg, report.deviation_deg)) * arm
            shifts = error.translation / diameter, report.deviation / diameter
            record["errors"] = {
                **{"rotation": turns.tolist(), "translation": shifts},
                "correlated": found.sensor.correlated / diameter,
            }
    return records


def _as_most_see(
    found: Reconstruction, component: Sequence[str], scene: Scene
) -> dict[str, bool | None]:
    """Which scans of a component are right as the one sees it with which most agree."""

    def seen_from(i: str) -> dict[str, bool | None]:
        return {
            j: _is_right(i, j, found.poses[i].inverse() @ found.poses[j], scene)
            for j in component
            if j != i
        }

    seen = {i: seen_from(i) for i in component}
    best = max(component, key=lambda i: sum(right is True for right in seen[i].values()))
    if not any(seen[best].values()):
        return dict.fromkeys(component, False)
    return {**seen[best], best: True}
