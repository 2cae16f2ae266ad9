"""Triangles between neighbouring cells of a grid, cut at depth jumps."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray, IndexArray, IntArray

GAP_ROUNDS = 2
"""Gaps between measured cells (pixels or voxels) are lost returns, up to this many cells from the
nearest measured one: they are filled from their neighbours in so many rounds."""


def grid_faces(
    grid: IndexArray, points: FloatArray, depth: FloatArray, max_step: float, max_edge: float
) -> IntArray:
    """Triangles over the 2 x 2 blocks of a grid of point indices.

    A block with four points gives two triangles along its shorter diagonal, one with three gives
    one. Triangles are clockwise in (column, row) order: with rows down and columns to the right
    their normals point to the sensor.

    Args:
        grid: (H, W) point indices, -1 for none.
        points: (N, 3), any frame.
        depth: (N,) distance from the sensor along its axis.
        max_step: Depth step along an edge above which a triangle is left out.
        max_edge: Length across the line of sight above which an edge is.

    Returns:
        (F, 3) indices of points.
    """
    known = np.ascontiguousarray(grid, dtype=np.int32).view()
    known.flags.writeable = False  # as frozen grids are: the kernel is then compiled once only
    arrays = known, np.ascontiguousarray(points), np.ascontiguousarray(depth)
    no_faces = np.empty((0, 3), np.int64)
    faces = np.empty((_find_faces(*arrays, max_step, max_edge, no_faces), 3), np.int64)
    _find_faces(*arrays, max_step, max_edge, faces)
    return faces


@njit(cache=True, nogil=True)
def _find_faces(
    grid: IndexArray,
    points: FloatArray,
    depth: FloatArray,
    max_step: float,
    max_edge: float,
    faces: IntArray,
) -> int:  # pragma: no cover - compiled
    """Write the triangles, as many as there is room for, and tell their number."""
    count = 0
    for way in range(4):
        for i, j in np.ndindex((max(grid.shape[0] - 1, 0), max(grid.shape[1] - 1, 0))):
            a, b = int(grid[i, j]), int(grid[i, j + 1])
            c, d = int(grid[i + 1, j]), int(grid[i + 1, j + 1])
            num = (a >= 0) + (b >= 0) + (c >= 0) + (d >= 0)
            if num < 3:
                continue
            along_ad = num == 4 and _apart(points, a, d) <= _apart(points, b, c)
            # (a, b, c) go clockwise on screen; seen from the sensor that is a normal towards it.
            if way == 0:
                wanted, p, q, r = along_ad if num == 4 else b < 0, a, c, d
            elif way == 1:
                wanted, p, q, r = along_ad if num == 4 else c < 0, a, d, b
            elif way == 2:
                wanted, p, q, r = not along_ad if num == 4 else d < 0, a, c, b
            else:
                wanted, p, q, r = not along_ad if num == 4 else a < 0, b, c, d
            if not wanted:
                continue
            smooth = True
            for one, two in ((p, q), (q, r), (r, p)):
                step = abs(depth[one] - depth[two])
                across = _apart(points, one, two) - step * step
                smooth = smooth and step <= max_step and across <= max_edge * max_edge
            if smooth:
                if count < len(faces):
                    faces[count, 0], faces[count, 1], faces[count, 2] = p, q, r
                count += 1
    return count


@njit(cache=True, nogil=True)
def _apart(points: FloatArray, p: int, q: int) -> float:  # pragma: no cover - compiled
    """Squared distance of two points."""
    x, y = points[p, 0] - points[q, 0], points[p, 1] - points[q, 1]
    return x * x + y * y + (points[p, 2] - points[q, 2]) ** 2
