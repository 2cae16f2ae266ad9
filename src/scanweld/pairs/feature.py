"""Where a feature that breaks a symmetry lies in two scans, and whether it is one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from scanweld.evidence.field import RASTER_DEPTH, ScanField
from scanweld.evidence.patches import (
    MAX_REVERSE,
    MIN_FEATURE_PIXELS,
    PixelConsensus,
    agrees,
    coherent,
)
from scanweld.evidence.pixels import TwoWay, fallen_on
from scanweld.geometry.arrays import BoolArray
from scanweld.pairs.problem import PairProblem

MIN_REFUTING_SHARE = 0.25
"""Share of the refuted poses that a feature's place refutes, at least."""
FEATURE_DIAMETERS = 0.15
"""Most of a feature lies within this of its middle."""
FEATURE_QUANTILE = 0.9
"""How much of it that is."""

Feature = tuple[BoolArray, BoolArray]
"""(H, W) pixels of the feature in scan i, and in scan j."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Contest:
    """Poses of two scans that tie, as all pixels see them.

    Attributes:
        seen: Of each pose, what both sensors say of the other scan's pixels.
        consensus: The same summed up.
        best: Index of the pose that refutes most others.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
    """

    seen: Sequence[TwoWay]
    consensus: Sequence[Sequence[PixelConsensus]]
    best: int
    tolerance: float


def feature_of(contest: Contest, refuted: Sequence[int]) -> Feature:
    """Pixels of both scans at which many poses are refuted by the best one, each where it agrees.

    A place that sticks out is itself contradicted; a place that is lacking contradicts what the
    other scan saw in its stead. What a feature comes to lie on is another place in each pose.

    Args:
        contest: The poses.
        refuted: Indices of those that the best one refutes.
    """
    seen, consensus, tolerance = contest.seen, contest.consensus, contest.tolerance
    own = seen[contest.best]
    votes = [np.zeros(one.behind.shape, dtype=np.int64) for one in own]
    for b in refuted:
        contested = [np.zeros(one.behind.shape, dtype=bool) for one in own]
        for k in (0, 1):
            against = consensus[b][k].violates & consensus[contest.best][k].agrees
            contested[k] |= against
            contested[1 - k] |= fallen_on(seen[b][k], against, contested[1 - k].shape)
        for vote, place in zip(votes, contested, strict=True):
            vote += ndimage.binary_dilation(place)
    least = max(2.0, MIN_REFUTING_SHARE * len(refuted))
    one, other = (
        coherent((vote >= least) & agrees(pixels.behind, tolerance))
        for vote, pixels in zip(votes, own, strict=True)
    )
    # What a feature agrees with is the same one, if seen too aslant to be contradicted elsewhere.
    on_one = fallen_on(own[1], other, one.shape)
    on_other = fallen_on(own[0], one, other.shape)
    return one | on_one, other | on_other


def is_feature(feature: Feature, problem: PairProblem, hidden: Sequence[TwoWay]) -> bool:
    """Whether places that both scans show are small, and hidden in the poses left."""
    if min(int(pixels.sum()) for pixels in feature) < MIN_FEATURE_PIXELS:
        return False
    scans = problem.i, problem.j
    if not all(_is_small(s, f, problem.diameter) for s, f in zip(scans, feature, strict=True)):
        return False
    most = MAX_REVERSE * sum(int(pixels.sum()) for pixels in feature)
    return all(
        sum(
            int((agrees(one.behind, problem.tolerance) & pixels).sum())
            for one, pixels in zip(both, feature, strict=True)
        )
        <= most
        for both in hidden
    )


def _is_small(scan: ScanField, feature: BoolArray, diameter: float) -> bool:
    """Whether most of a feature lies close to its middle."""
    rows, columns = np.nonzero(feature)
    if not len(rows):
        return True
    depth = scan.raster[rows, columns, RASTER_DEPTH].astype(np.float64)
    is_pinhole = scan.camera[0] == 0.0
    scale = depth if is_pinhole else np.ones_like(depth)
    x = (columns - scan.camera[3]) / scan.camera[1] * scale
    y = (rows - scan.camera[4]) / scan.camera[2] * scale
    points = np.stack([x, y, depth], axis=1)
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    return float(np.quantile(away, FEATURE_QUANTILE)) < FEATURE_DIAMETERS * diameter
