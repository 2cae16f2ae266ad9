"""Turn surfaces of revolution about their axis until what breaks the symmetry coincides.

Surfaces of revolution fit in every turn, so that a search does not hit the one that explains a
feature which breaks the symmetry. Its pixels are contradicted in most turns; the turn in which they
agree most is the one.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from scanweld.evidence.information import information_from
from scanweld.evidence.patches import MIN_FEATURE_PIXELS, agrees, coherent, pixel_consensus
from scanweld.evidence.pixels import TwoWay, fallen_on
from scanweld.evidence.slippage import Slide, slippage_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.pairs.problem import PairProblem

FIRST_STEP_DEG, STEP_DEG, FINE_STEP_DEG = 15.0, 3.0, 0.5
"""Between turns that show whether there is a feature at all, that find it, and that fit it."""
MIN_CONTESTED = 0.25
"""Share of the turns with contradictions in which a feature's pixels are contradicted."""


def turn_to_feature(problem: PairProblem, i_from_j: Pose) -> Pose | None:
    """The turn about the axis of two surfaces of revolution that lays a feature on its like.

    Args:
        problem: The two scans.
        i_from_j: Any pose that explains the scans but for the feature.

    Returns:
        The pose i_from_j; None if the surfaces do not turn freely about just one axis, or if they
        do not both show a feature.
    """
    axis = _free_axis(problem, i_from_j)
    if axis is None:
        return None
    tolerance = problem.tolerance

    def at(degrees: float) -> TwoWay:
        return problem.pixels(_about(*axis, degrees) @ i_from_j)

    if not any(_is_contested(at(turn), tolerance) for turn in np.arange(0, 360, FIRST_STEP_DEG)):
        return None
    turns = np.arange(0, 360, STEP_DEG)
    seen = [at(turn) for turn in turns]
    features = _features(seen, tolerance)
    if min(int(feature.sum()) for feature in features) < MIN_FEATURE_PIXELS:
        return None
    best = float(turns[int(np.argmax([_shared(one, features, tolerance) for one in seen]))])
    near = best + np.arange(-STEP_DEG, STEP_DEG + FINE_STEP_DEG, FINE_STEP_DEG)
    best = float(near[int(np.argmin([_apart(at(turn), features, tolerance) for turn in near]))])
    if _shared(at(best), features, tolerance) < MIN_FEATURE_PIXELS:
        return None
    return _about(*axis, best) @ i_from_j


def _free_axis(problem: PairProblem, i_from_j: Pose) -> tuple[FloatArray, FloatArray] | None:
    """Direction and a point of the axis of a surface of revolution, in the frame of i."""
    matches = problem.matches(i_from_j)
    information, _, _ = information_from([matches], problem.diameter)
    free = slippage_of(information, problem.config.min_observability)
    if free is None or free.slide is not Slide.REVOLUTION or free.point is None:
        return None
    assert free.axis is not None
    return free.axis, matches[0].mean(axis=0) + problem.diameter * free.point


def _about(axis: FloatArray, point: FloatArray, degrees: float) -> Pose:
    rotation = rotation_exp(axis * np.radians(degrees))
    return Pose(rotation=rotation, translation=point - rotation @ point)


def _is_contested(both: TwoWay, tolerance: float) -> bool:
    return any(pixel_consensus([one], tolerance).violates.any() for one in both)


def _features(seen: Sequence[TwoWay], tolerance: float) -> tuple[BoolArray, BoolArray]:
    """Pixels of both scans that are contradicted, or contradict, in many of the turns."""
    consensus = [
        (pixel_consensus([of_i], tolerance), pixel_consensus([of_j], tolerance))
        for of_i, of_j in seen
    ]
    least = max(
        2.0, MIN_CONTESTED * sum(any(one.violates.any() for one in both) for both in consensus)
    )
    votes_i, votes_j = (np.zeros(one.behind.shape) for one in seen[0])
    for (of_i, of_j), (says_i, says_j) in zip(seen, consensus, strict=True):
        votes_i += _around(says_i.violates)
        votes_i += _around(fallen_on(of_j, says_j.violates, votes_i.shape))
        votes_j += _around(says_j.violates)
        votes_j += _around(fallen_on(of_i, says_i.violates, votes_j.shape))
    return coherent(votes_i >= least), coherent(votes_j >= least)


def _around(patches: BoolArray) -> BoolArray:
    return np.asarray(ndimage.binary_dilation(patches), dtype=bool)


def _shared(both: TwoWay, features: tuple[BoolArray, BoolArray], tolerance: float) -> int:
    """Pixels of the feature in one scan that agree with that in the other; of both, the fewer."""
    counts: list[int] = []
    for k in (0, 1):
        on_surface = agrees(both[k].behind, tolerance) & features[k]
        counts.append(int(features[1 - k].ravel()[both[k].lands[on_surface]].sum()))
    return min(counts)


def _apart(both: TwoWay, features: tuple[BoolArray, BoolArray], tolerance: float) -> float:
    """How far the features lie from the other scan's surface, in tolerances; 1 each at most."""
    away = [
        np.abs(one.behind[feature]) / tolerance for one, feature in zip(both, features, strict=True)
    ]
    return float(sum(np.nan_to_num(x, nan=1.0).clip(max=1.0).sum() for x in away))
