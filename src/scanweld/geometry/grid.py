"""Triangles between neighbouring cells of a grid, cut at depth jumps."""

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

GAP_ROUNDS = 2
"""Gaps between measured cells (pixels or voxels) are lost returns, up to this many cells from the
nearest measured one: they are filled from their neighbours in so many rounds."""


def grid_faces(
    grid: IntArray, points: FloatArray, depth: FloatArray, max_step: float, max_edge: float
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
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]
    has = [corner.ravel() >= 0 for corner in (a, b, c, d)]
    a, b, c, d = (corner.ravel() for corner in (a, b, c, d))
    full = has[0] & has[1] & has[2] & has[3]
    across_ad = np.zeros(len(a))
    across_bc = np.zeros(len(a))
    across_ad[full] = np.linalg.norm(points[a[full]] - points[d[full]], axis=1)
    across_bc[full] = np.linalg.norm(points[b[full]] - points[c[full]], axis=1)
    along_ad = full & (across_ad <= across_bc)
    along_bc = full & ~along_ad
    num = has[0].astype(int) + has[1] + has[2] + has[3]
    three = num == 3
    candidates = [
        _stack(along_ad | (three & ~has[1]), a, d, c),
        _stack(along_ad | (three & ~has[2]), a, b, d),
        _stack(along_bc | (three & ~has[3]), a, b, c),
        _stack(along_bc | (three & ~has[0]), b, d, c),
    ]
    faces = np.concatenate(candidates)
    return faces[_is_smooth(faces, points, depth, max_step, max_edge)]


def _stack(chosen: BoolArray, a: IntArray, b: IntArray, c: IntArray) -> IntArray:
    # (a, b, c) go clockwise on screen; seen from the sensor that is a normal towards it.
    return np.stack([a[chosen], c[chosen], b[chosen]], axis=1)


def _is_smooth(
    faces: IntArray, points: FloatArray, depth: FloatArray, max_step: float, max_edge: float
) -> BoolArray:
    keep = np.ones(len(faces), dtype=bool)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        p, q = faces[:, start], faces[:, end]
        step = np.abs(depth[p] - depth[q])
        length2 = ((points[p] - points[q]) ** 2).sum(axis=1)
        keep &= (step <= max_step) & (length2 - step**2 <= max_edge**2)
    return keep
