"""Stray points: outliers and flying pixels, which are not part of any surface."""

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.buckets import are_beside, into_buckets
from scanweld.geometry.scan import RangeScan

MIN_NEIGHBOURS = 4
"""A point with fewer neighbours than this is a stray."""
REACH_SPACINGS = 3.8
"""Distance within which points are neighbours, in point spacings."""
DEPTH_REACH = 2.0
"""Factor by which neighbours may be farther away along the line of sight: there, points on surfaces
seen edge-on are spaced more widely."""


def without_strays(scan: RangeScan, points: FloatArray, spacing: float) -> RangeScan:
    """The scan without its stray points.

    Args:
        scan: Any scan.
        points: (N, 3), its points in the sensor frame.
        spacing: Median spacing of its points.
    """
    if not spacing > 0:  # all points coincide
        return scan.only(np.zeros(len(points), dtype=bool))
    reach = REACH_SPACINGS * spacing
    near = (points - points.min(axis=0, initial=np.inf)) / np.array([1.0, 1.0, DEPTH_REACH])
    kept = are_beside(near, *into_buckets(near, 2.0 * reach), reach, MIN_NEIGHBOURS)
    return scan if kept.all() else scan.only(kept)
