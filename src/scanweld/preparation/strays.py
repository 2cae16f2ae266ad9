"""Stray points: outliers and flying pixels, which are not part of any surface."""

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray
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
    kept = _has_neighbours(points / np.array([1.0, 1.0, DEPTH_REACH]), REACH_SPACINGS * spacing)
    return scan if kept.all() else scan.only(kept)


def _has_neighbours(points: FloatArray, reach: float) -> BoolArray:
    from scipy.spatial import KDTree

    # The nearest of all is the point itself.
    distance, _ = KDTree(points).query(points, k=MIN_NEIGHBOURS + 1, distance_upper_bound=reach)
    return np.isfinite(distance[:, -1])
