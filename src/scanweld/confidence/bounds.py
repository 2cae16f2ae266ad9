"""How exact the pose of a scan is -> bounds of its errors that hold for 95 % of the scans.

Three things tell: the deviation that follows from information and noise; the distance between
surfaces that noise and bent depth leave; and how far its pairs, each by itself, put the scan from
where all of them together put it, since a sensor whose depth is bent fools each pair in its own
way. How much each of them counts comes from the calibration.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.view_graph import Component, ViewGraph

FULL_TURN_DEG = 180.0
"""Bound of a turn that nothing determines."""


@dataclass(frozen=True, kw_only=True, slots=True)
class BoundScale:
    """A bound is ``factor`` times the root of the summed squares of what tells.

    Attributes:
        factor: Of the whole.
        sigma_share: Of the distance between surfaces that should coincide.
        cycle_share: Of how far pairs by themselves disagree with all of them together.
    """

    factor: float
    sigma_share: float
    cycle_share: float

    def bound(self, deviation: float, sigma: float, cycle: float) -> float:
        """The bound, in the unit of all three."""
        parts = deviation, self.sigma_share * sigma, self.cycle_share * cycle
        return self.factor * float(np.sqrt(sum(part**2 for part in parts)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Exactness:
    """What tells how exact a scan's pose is; lengths in the scans' unit.

    Attributes:
        deviation: Standard deviation of its pose by information and noise.
        cycle: Root mean square of how far its accepted pairs by themselves put it elsewhere.
    """

    deviation: PoseTolerance
    cycle: PoseTolerance


@dataclass(frozen=True, kw_only=True, slots=True)
class Bounds:
    """How bounds of rotations and of translations follow from what tells of exactness."""

    rotation: BoundScale
    translation: BoundScale

    def of(self, told: Exactness, sigma: float, diameter: float) -> PoseTolerance:
        """Bound at 95 % of the error of a pose.

        Args:
            told: What tells how exact it is.
            sigma: Robust standard deviation of the distance between surfaces, in the scans' unit.
            diameter: Of the run, likewise.
        """
        turn = float(np.degrees(sigma / lever_arm(diameter)))
        angle = self.rotation.bound(told.deviation.angle_deg, turn, told.cycle.angle_deg)
        shift = self.translation.bound(told.deviation.shift, sigma, told.cycle.shift)
        return PoseTolerance(angle_deg=min(angle, FULL_TURN_DEG), shift=min(shift, diameter))


def exactness_of(
    graph: ViewGraph,
    component: Component,
    deviations: Mapping[int, PoseTolerance],
    centres: Mapping[int, FloatArray],
) -> dict[int, Exactness]:
    """What tells how exact the poses of a component's scans are.

    Args:
        graph: Its pairs.
        component: The scans at their final poses.
        deviations: Standard deviations of these, by index.
        centres: (3,) middle of each scan's samples, sensor frame.
    """
    off: dict[int, list[tuple[float, float]]] = {k: [] for k in component.poses}
    for (i, j), option in graph.accepted.items():
        if i in component.poses:
            i_from_j = component.poses[i].inverse() @ component.poses[j]
            apart: Pose = i_from_j.inverse() @ option.i_from_j
            for k in (i, j):
                off[k].append((apart.angle_deg(), apart.shift_at(centres[j])))
    most = np.array([0.0, 0.0])
    cycles = {k: np.sqrt(np.mean(np.square(found), axis=0)) for k, found in off.items() if found}
    if cycles:
        most = np.max([*cycles.values()], axis=0)
    return {
        k: Exactness(
            deviation=deviations[k],
            cycle=PoseTolerance(
                angle_deg=float(cycles.get(k, most)[0]), shift=float(cycles.get(k, most)[1])
            ),
        )
        for k in component.poses
    }
