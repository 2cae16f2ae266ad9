"""Stability of a pose that seems to slide: perturbed along the slide, does ICP bring it back?

Noise of the normals counts against information (``information_of``), so that of little overlap
nothing may be left. ICP asks differently, by distances: where surfaces truly slide it leaves the
pose where it was pushed to, and the scans fit there as well.
"""

from collections.abc import Iterator

import numpy as np

from scanweld.evidence.icp import MIN_MATCHES
from scanweld.evidence.information import TURN_SCALE
from scanweld.evidence.rivals import RIVAL_SHIFT_DIAMETERS
from scanweld.evidence.slippage import free_motions
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import Alternative, rival_score

PERTURBATION_DIAMETERS = RIVAL_SHIFT_DIAMETERS
"""Length of a perturbation, rotations counted as in the information: as far as rivals are."""
MAX_REMAINING_SHARE = 0.25
"""Share of a perturbation that may be left of it where a pose has come back."""


def is_stable(
    problem: PairProblem, best: Alternative, information: FloatArray, points: FloatArray
) -> bool:
    """Whether a pose comes back to where it was, pushed either way along each motion it leaves.

    From one of the two pushes it may go astray, if the scans fit clearly worse there.

    Args:
        problem: The two scans.
        best: The pose.
        information: (6, 6) information of it.
        points: (N, 3) matched points that it rests on, in the frame of i.
    """
    if len(points) < MIN_MATCHES:
        return False
    middle, diameter = points.mean(axis=0), problem.diameter
    least = (1.0 - problem.config.min_margin) * best.score
    for free in free_motions(information, problem.config.min_observability):
        pushed = [motion @ best.i_from_j for motion in _perturbations(free, middle, diameter)]
        ends = problem.refine(pushed)
        left = [end.i_from_j @ best.i_from_j.inverse() for end in ends]
        is_back = [_length(motion, middle, diameter) <= MAX_REMAINING_SHARE for motion in left]
        is_worse = [rival_score(end, best) <= least for end in ends]
        is_held = all(back or worse for back, worse in zip(is_back, is_worse, strict=True))
        if not is_held or not any(is_back):
            return False
    return True


def _perturbations(free: FloatArray, middle: FloatArray, diameter: float) -> Iterator[Pose]:
    """Motions both ways along a twist (6,) about the middle, its rotation scaled."""
    for length in (-PERTURBATION_DIAMETERS, PERTURBATION_DIAMETERS):
        rotation = rotation_exp(TURN_SCALE * length * free[:3])
        shift = diameter * length * free[3:]
        yield Pose(rotation=rotation, translation=middle + shift - rotation @ middle)


def _length(motion: Pose, middle: FloatArray, diameter: float) -> float:
    """Length of a motion about the middle as a share of a perturbation: turns count like shifts."""
    turn = np.radians(motion.angle_deg()) / TURN_SCALE
    return float(np.hypot(turn, motion.shift_at(middle) / diameter)) / PERTURBATION_DIAMETERS
