"""Stray points: outliers and flying pixels, which are not part of any surface."""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.scan import RangeScan

MIN_NEIGHBOURS = 4
REACH_SPACINGS = 3.8
"""A point with fewer neighbours than that, within so many spacings, is a stray."""
DEPTH_REACH = 2.0
"""How many times farther neighbours may be along the line of sight: surfaces seen edge-on."""


def without_strays(scan: RangeScan, points: FloatArray, spacing: float) -> RangeScan:
    """The scan without its stray points.

    Args:
        scan: Any scan.
        points: (N, 3), its points in the sensor frame.
        spacing: Median spacing of its points.
    """
    kept = _has_neighbours(points / np.array([1.0, 1.0, DEPTH_REACH]), REACH_SPACINGS * spacing)
    if kept.all():
        return scan
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    faces = None if scan.faces is None else number[scan.faces]
    part = lambda values: None if values is None else values[kept]  # noqa: E731
    return replace(
        scan,
        points=scan.points[kept],
        grid=None if scan.grid is None else number[scan.grid],
        faces=None if faces is None else faces[(faces >= 0).all(axis=1)],
        normals=part(scan.normals),
        colors=part(scan.colors),
        confidence=part(scan.confidence),
    )


def _has_neighbours(points: FloatArray, reach: float) -> BoolArray:
    distance, _ = KDTree(points).query(points, k=[MIN_NEIGHBOURS + 1], distance_upper_bound=reach)
    return np.isfinite(distance[:, 0])
