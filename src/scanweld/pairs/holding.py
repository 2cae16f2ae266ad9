"""Whether a pose that seems to slide is held after all: pushed along the slide, does it come back?

Noise of the normals counts against information (``information_of``), so that of little overlap
nothing may be left. ICP asks differently, by distances: where surfaces truly slide it leaves the
pose where it was pushed to, and the scans fit there as well.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from scanweld.evidence.icp import MIN_MATCHES
from scanweld.evidence.information import TURN_SCALE
from scanweld.evidence.slippage import free_motions
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.pairs.result import Alternative, rival_score

PUSH_DIAMETERS = 0.06
"""Length of a push, rotations counted as in the information: as far as rivals are from a pose."""
MAX_LEFT = 0.25
"""Share of a push that may be left of it where a pose has come back."""

Refine = Callable[[Sequence[Pose]], Sequence[Alternative]]
"""Poses i_from_j of a pair after ICP, with their evidence."""


def comes_back(
    best: Alternative,
    information: FloatArray,
    matches: FloatArray,
    diameter: float,
    refine: Refine,
    min_observability: float,
    min_margin: float,
) -> bool:
    """Whether a pose comes back to where it was, pushed either way along each motion it leaves.

    From one of the two pushes it may go astray, if the scans fit clearly worse there.

    Args:
        best: The pose.
        information: (6, 6) information of it.
        matches: (N, 3) matched points that it rests on, in the frame of i.
        diameter: Diameter of the run.
        refine: Refines poses.
        min_observability: Free is what has less information, as a share of the best held.
        min_margin: Share of its score by which the pose must beat what it went astray to.
    """
    if len(matches) < MIN_MATCHES:
        return False
    middle = matches.mean(axis=0)
    for free in free_motions(information, min_observability):
        ends = refine([push @ best.i_from_j for push in _pushes(free, middle, diameter)])
        left = [end.i_from_j @ best.i_from_j.inverse() for end in ends]
        is_back = [_length(motion, middle, diameter) <= MAX_LEFT for motion in left]
        is_worse = [rival_score(end, best) <= (1.0 - min_margin) * best.score for end in ends]
        is_held = all(back or worse for back, worse in zip(is_back, is_worse, strict=True))
        if not is_held or not any(is_back):
            return False
    return True


def _pushes(free: FloatArray, middle: FloatArray, diameter: float) -> Iterator[Pose]:
    """Motions both ways along a twist (6,) about the middle, its rotation scaled."""
    for length in (-PUSH_DIAMETERS, PUSH_DIAMETERS):
        rotation = rotation_exp(TURN_SCALE * length * free[:3])
        shift = diameter * length * free[3:]
        yield Pose(rotation=rotation, translation=middle + shift - rotation @ middle)


def _length(motion: Pose, middle: FloatArray, diameter: float) -> float:
    """Length of a motion about the middle as a share of a push: turns count like shifts."""
    turn = np.radians(motion.angle_deg()) / TURN_SCALE
    return float(np.hypot(turn, motion.shift_at(middle) / diameter)) / PUSH_DIAMETERS
