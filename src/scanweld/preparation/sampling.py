"""Points spread evenly over a surface, in an order whose every prefix is spread evenly too."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray, IntArray


def farthest_points(points: FloatArray, max_count: int, min_spacing: float = 0.0) -> IntArray:
    """Indices of points, each the farthest from those before it; the first is nearest the mean.

    Args:
        points: (N, 3).
        max_count: Stop at so many points,
        min_spacing: or when every point is nearer than this to a chosen one.

    Returns:
        (K,) indices, K <= max_count.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    centre = points.mean(axis=0)
    first = int(np.argmin(((points - centre) ** 2).sum(axis=1)))
    return _farthest(np.array(points, order="C"), first, max_count, min_spacing**2)


@njit(cache=True, nogil=True)
def _farthest(points: FloatArray, first: int, max_count: int, min_spacing2: float) -> IntArray:
    n = points.shape[0]
    distance2 = np.full(n, np.inf)
    chosen = np.empty(min(n, max_count), dtype=np.int64)
    current = first
    for k in range(chosen.shape[0]):
        chosen[k] = current
        x, y, z = points[current, 0], points[current, 1], points[current, 2]
        farthest = -1.0
        for i in range(n):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            d2 = dx * dx + dy * dy + dz * dz
            if d2 < distance2[i]:
                distance2[i] = d2
            if distance2[i] > farthest:
                farthest = distance2[i]
                current = i
        if farthest <= min_spacing2:
            return chosen[: k + 1]
    return chosen
