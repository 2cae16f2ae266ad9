"""Point spacing of a scan."""

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.sampling import NUM_FEW


def point_spacing(points: FloatArray) -> float:
    """The median distance from a point of (N, 3) to its nearest distinct one, in their unit.

    Exact duplicates do not count as neighbours. Zero if all points coincide.
    """
    from scipy.spatial import KDTree

    queries = points[:: max(1, len(points) // NUM_FEW)]
    distances = KDTree(points).query(queries, k=min(4, len(points)))[0].reshape(len(queries), -1)
    nearest = np.where(distances > 0, distances, np.inf).min(axis=1)
    nearest = nearest[np.isfinite(nearest)]
    return float(np.median(nearest)) if len(nearest) else 0.0
