"""What the rival poses of an ambiguous pair have in common: turns that leave the object alike.

If scan j fits scan i at the pose T and at T' as well, then the motion T'^-1 T of j's object leaves
the object, as far as these scans tell, as it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.axis import Axis, fit_axis
from scanweld.geometry.pose import Pose

SAME_TURN_DEG = 5.0
"""Motions this close to a turn about an axis are taken for it,"""
SAME_PLACE_DIAMETERS = 0.03
"""if they shift the object by less than this, too."""
MAX_FOLD = 12
"""Turns by smaller steps could as well be any turns."""
SAME_STEP_DEG = 3.0
"""Turns this close to multiples of a fraction of a full turn are taken for them;"""
FINER_DEG = 0.5
"""a smaller fraction must be closer by this."""


class Likeness(StrEnum):
    """What motions leave an object alike."""

    ONE_AXIS = "turns about one axis"
    ONE_POINT = "turns about several axes through one point"
    UNRELATED = "several unrelated poses"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Symmetry:
    """What the motions between equally good poses are.

    Attributes:
        likeness: Their kind.
        angles_deg: Angles of the turns about one axis, in (0, 180]; else empty.
    """

    likeness: Likeness
    angles_deg: tuple[float, ...] = ()

    @property
    def fold(self) -> int | None:
        """The least n for which all turns are multiples of 360 / n deg; None if it is too large."""
        fold, least = None, SAME_STEP_DEG + FINER_DEG
        for n in range(2, MAX_FOLD + 1):
            steps = np.array(self.angles_deg) * n / 360.0
            off = float((np.abs(steps - np.round(steps)) * 360.0 / n).max(initial=0.0))
            if off < least - FINER_DEG:
                fold, least = n, off
        return fold

    @property
    def words(self) -> str:
        """The motions, in words."""
        if not self.angles_deg:
            return self.likeness.value
        if max(self.angles_deg) - min(self.angles_deg) < SAME_TURN_DEG and self.fold != 2:
            return f"a turn by {np.median(self.angles_deg):.0f} deg about an axis"
        return fold_words(self.fold)


def symmetry_of(
    poses: Sequence[Pose], weights: Sequence[float], centre_j: FloatArray, diameter: float
) -> Symmetry | None:
    """What about equally good poses have in common; None if there are not two.

    Args:
        poses: i_from_j between the sensor frames, all distinct, the best first.
        weights: How much each counts: most of the rivals must be turns about one axis to be so
            named, as some fit by chance.
        centre_j: (3,) middle of scan j's samples.
        diameter: Diameter of the run.
    """
    if len(poses) < 2:
        return None
    motions = [other.inverse() @ poses[0] for other in poses[1:]]
    angles = _about_one_axis(motions, weights[1:], centre_j, diameter)
    if angles:
        return Symmetry(likeness=Likeness.ONE_AXIS, angles_deg=angles)
    if _about_one_point(motions, centre_j, diameter):
        return Symmetry(likeness=Likeness.ONE_POINT)
    return Symmetry(likeness=Likeness.UNRELATED)


def fold_words(fold: int | None) -> str:
    """Turns about one axis by 360 / fold deg in words, or by any angle."""
    if fold == 2:
        return "a half turn about an axis"
    if fold is None:
        return "any turn about an axis"
    return f"turns by {360 / fold:.3g} deg about an axis, {fold}-fold"


def _about_one_axis(
    motions: Sequence[Pose], weights: Sequence[float], middle: FloatArray, diameter: float
) -> tuple[float, ...]:
    """Angles in degrees of the turns about the axis that most motions share; none without such."""

    def turning(axis: Axis) -> list[int]:
        apart = [axis.nearest_turn(motion).inverse() @ motion for motion in motions]
        return [
            k
            for k, off in enumerate(apart)
            if off.angle_deg() < SAME_TURN_DEG
            and off.shift_at(middle) < SAME_PLACE_DIAMETERS * diameter
        ]

    groups = [turning(fit_axis([motion], middle)) for motion in motions]
    best = max(groups, key=lambda group: sum(weights[k] for k in group))
    if sum(weights[k] for k in best) <= 0.5 * sum(weights):
        return ()
    axis = fit_axis([motions[k] for k in best], middle)
    return tuple(abs(float(np.degrees(axis.angle_of(motions[k])))) for k in best)


def _about_one_point(motions: Sequence[Pose], middle: FloatArray, diameter: float) -> bool:
    """Whether there is a point that all motions leave where it is."""
    rows = np.concatenate([np.eye(3) - motion.rotation for motion in motions])
    moved = np.concatenate([motion.apply(middle) - middle for motion in motions])
    point = middle + np.linalg.lstsq(rows, moved, rcond=1e-9)[0]
    return max(motion.shift_at(point) for motion in motions) < SAME_PLACE_DIAMETERS * diameter
