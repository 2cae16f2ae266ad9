"""Turn surfaces of revolution about their axis until the marks of both scans lie on each other.

Surfaces of revolution fit in every turn, so that a search does not hit the one that explains a
mark. Its pixels are contradicted in most turns; the turn in which they agree most is the one.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from scanweld.evidence.field import ScanField
from scanweld.evidence.information import information_from, two_way_matches
from scanweld.evidence.patches import agrees, coherent, told_of
from scanweld.evidence.pixels import TwoWay, fallen_on, see
from scanweld.evidence.slippage import Slide, slippage_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose, rotation_exp

FIRST_STEP_DEG, STEP_DEG, FINE_STEP_DEG = 15.0, 3.0, 0.5
"""Between turns that show whether there is a mark at all, that find it, and that fit it."""
MIN_CONTESTED = 0.25
"""Share of the turns with contradictions in which a mark's pixels are contradicted."""
MIN_PIXELS = 10
"""Pixels of a mark in each scan, at least."""


def turn_to_mark(
    i: ScanField,
    j: ScanField,
    i_from_j: Pose,
    tolerance: float,
    diameter: float,
    min_observability: float,
) -> Pose | None:
    """The turn about the axis of two surfaces of revolution that lays a mark on its like.

    Args:
        i: First scan.
        j: Second scan.
        i_from_j: Any pose that explains the scans but for the mark.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        diameter: Diameter of the run.
        min_observability: Free is a motion with less information, as a share of the best held.

    Returns:
        The pose i_from_j; None if the surfaces do not turn freely about just one axis, or if they
        do not both show a mark.
    """
    axis = _free_axis(i, j, i_from_j, tolerance, diameter, min_observability)
    if axis is None:
        return None

    def at(degrees: float) -> TwoWay:
        return see(i, j, _about(*axis, degrees) @ i_from_j, diameter)

    if not any(_is_contested(at(turn), tolerance) for turn in np.arange(0, 360, FIRST_STEP_DEG)):
        return None
    turns = np.arange(0, 360, STEP_DEG)
    seen = [at(turn) for turn in turns]
    marks = _marks(seen, tolerance)
    if min(int(mark.sum()) for mark in marks) < MIN_PIXELS:
        return None
    best = float(turns[int(np.argmax([_shared(one, marks, tolerance) for one in seen]))])
    near = best + np.arange(-STEP_DEG, STEP_DEG + FINE_STEP_DEG, FINE_STEP_DEG)
    best = float(near[int(np.argmin([_apart(at(turn), marks, tolerance) for turn in near]))])
    if _shared(at(best), marks, tolerance) < MIN_PIXELS:
        return None
    return _about(*axis, best) @ i_from_j


def _free_axis(
    i: ScanField,
    j: ScanField,
    i_from_j: Pose,
    tolerance: float,
    diameter: float,
    min_observability: float,
) -> tuple[FloatArray, FloatArray] | None:
    """Direction and a point of the axis of a surface of revolution, in the frame of i."""
    matches = two_way_matches(i, j, i_from_j, tolerance)
    information, _, _ = information_from([matches], diameter)
    free = slippage_of(information, min_observability)
    if free is None or free.slide is not Slide.REVOLUTION or free.point is None:
        return None
    assert free.axis is not None
    return free.axis, matches[0].mean(axis=0) + diameter * free.point


def _about(axis: FloatArray, point: FloatArray, degrees: float) -> Pose:
    rotation = rotation_exp(axis * np.radians(degrees))
    return Pose(rotation=rotation, translation=point - rotation @ point)


def _is_contested(both: TwoWay, tolerance: float) -> bool:
    return any(told_of([one], tolerance).violates.any() for one in both)


def _marks(seen: Sequence[TwoWay], tolerance: float) -> tuple[BoolArray, BoolArray]:
    """Pixels of both scans that are contradicted, or contradict, in many of the turns."""
    told = [(told_of([of_i], tolerance), told_of([of_j], tolerance)) for of_i, of_j in seen]
    least = max(2.0, MIN_CONTESTED * sum(any(one.violates.any() for one in both) for both in told))
    votes_i, votes_j = (np.zeros(one.behind.shape) for one in seen[0])
    for (of_i, of_j), (says_i, says_j) in zip(seen, told, strict=True):
        votes_i += _around(says_i.violates)
        votes_i += _around(fallen_on(of_j, says_j.violates, votes_i.shape))
        votes_j += _around(says_j.violates)
        votes_j += _around(fallen_on(of_i, says_i.violates, votes_j.shape))
    return coherent(votes_i >= least), coherent(votes_j >= least)


def _around(patches: BoolArray) -> BoolArray:
    return np.asarray(ndimage.binary_dilation(patches), dtype=bool)


def _shared(both: TwoWay, marks: tuple[BoolArray, BoolArray], tolerance: float) -> int:
    """The pixels of the mark in one scan that agree with that in the other; of both, the fewer."""
    counts: list[int] = []
    for k in (0, 1):
        on_surface = agrees(both[k].behind, tolerance) & marks[k]
        counts.append(int(marks[1 - k].ravel()[both[k].lands[on_surface]].sum()))
    return min(counts)


def _apart(both: TwoWay, marks: tuple[BoolArray, BoolArray], tolerance: float) -> float:
    """How far the marks lie from the other scan's surface, in tolerances; 1 each at most."""
    away = [np.abs(one.behind[mark]) / tolerance for one, mark in zip(both, marks, strict=True)]
    return float(sum(np.nan_to_num(x, nan=1.0).clip(max=1.0).sum() for x in away))
