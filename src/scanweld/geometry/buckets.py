"""Points sorted into hashed cubes of space, for compiled searches within a small radius."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray


def cells_of(points: FloatArray, edge: float) -> tuple[IntArray, IntArray]:
    """Which of the cells with points each of points (N, 3), N > 0, is in, and how many each holds.

    Cells are cubes, numbered in the order of their places.
    """
    places = np.floor(points / edge).astype(np.int64)
    places -= places.min(axis=0)
    extent = places.max(axis=0) + 1
    numbers = (places[:, 0] * extent[1] + places[:, 1]) * extent[2] + places[:, 2]
    _, cell, count = np.unique(numbers, return_inverse=True, return_counts=True)
    return cell, count


@njit(cache=True, nogil=True)
def into_buckets(points: FloatArray, cube: float) -> tuple[IntArray, IntArray]:  # pragma: no cover
    """Indices (N,) of points (N, 3) sorted by bucket, and where in them each bucket begins.

    There are as many buckets as a power of two, at least one a point.
    """
    size = 1
    while size < len(points):
        size *= 2
    bucket, start = np.empty(len(points), np.int64), np.zeros(size + 2, np.int64)
    for k in range(len(points)):
        i, j, m = np.floor(points[k, 0] / cube), np.floor(points[k, 1] / cube), points[k, 2] / cube
        bucket[k] = _bucket(int(i), int(j), int(np.floor(m)), size)
        start[bucket[k] + 2] += 1
    start = np.cumsum(start)
    order = np.empty(len(points), np.int64)
    for k in range(len(points)):
        order[start[bucket[k] + 1]] = k
        start[bucket[k] + 1] += 1
    return order, start[:-1]


@njit(cache=True, nogil=True)
def nearest_within(
    points: FloatArray,
    order: IntArray,
    start: IntArray,
    radius: float,
    x: float,
    y: float,
    z: float,
) -> int:  # pragma: no cover - compiled
    """The point nearest to a place, -1 if none is within the radius; cubes are twice as large."""
    cube, size = 2.0 * radius, len(start) - 1
    best, found = radius * radius, -1
    low = (
        int(np.floor(x / cube - 0.5)),
        int(np.floor(y / cube - 0.5)),
        int(np.floor(z / cube - 0.5)),
    )
    for corner in range(8):
        i, j, m = low[0] + (corner & 1), low[1] + (corner >> 1 & 1), low[2] + (corner >> 2)
        bucket = _bucket(i, j, m, size)
        for k in range(start[bucket], start[bucket + 1]):
            p = order[k]
            away = (points[p, 0] - x) ** 2 + (points[p, 1] - y) ** 2 + (points[p, 2] - z) ** 2
            if away < best or (away == best and p < found):
                best, found = away, p
    return found


@njit(cache=True, nogil=True)
def are_beside(
    points: FloatArray, order: IntArray, start: IntArray, radius: float, enough: int
) -> BoolArray:  # pragma: no cover - compiled
    """Which points (N,) have enough others within the radius; cubes are twice as large."""
    cube, size = 2.0 * radius, len(start) - 1
    found = np.zeros(len(points), np.bool_)
    for v in range(len(points)):
        x, y, z = points[v, 0], points[v, 1], points[v, 2]
        i, j = int(np.floor(x / cube - 0.5)), int(np.floor(y / cube - 0.5))
        m, count, corner = int(np.floor(z / cube - 0.5)), -1, 0
        while corner < 8 and count < enough:
            di, dj, dm = corner & 1, corner >> 1 & 1, corner >> 2
            bucket = _bucket(i + di, j + dj, m + dm, size)
            for p in order[start[bucket] : start[bucket + 1]]:
                px, py, pz = points[p, 0], points[p, 1], points[p, 2]
                # Other cubes share the bucket: they count when their own turn comes.
                here = int(np.floor(px / cube)) == i + di and int(np.floor(py / cube)) == j + dj
                if here and int(np.floor(pz / cube)) == m + dm:
                    count += (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2 < radius * radius
                    if count >= enough:
                        break
            corner += 1
        found[v] = count >= enough
    return found


@njit(cache=True, nogil=True)
def _bucket(i: int, j: int, k: int, size: int) -> int:  # pragma: no cover - compiled
    # Large primes, after Teschner et al. (2003); the size is a power of two.
    return ((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & (size - 1)
