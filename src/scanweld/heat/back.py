"""A coarse triangulation of a front's outline for the back plane, merged as in a quadtree."""

import numpy as np

from scanweld.geometry.arrays import BoolArray, IntArray
from scanweld.heat.front import FrontMesh

_LARGEST = 8
"""Edge of the largest squares, in cells of the front; a power of two."""


def coarse_faces(front: FrontMesh, border: IntArray) -> IntArray:
    """Triangles (F, 3) on a front's vertices, in its winding, that fill its outline in the image.

    Cells that are there as a whole are merged to squares. A square becomes a fan about its middle
    to all vertices on its sides that the border or a neighbour uses, so that all faces meet edge
    to edge.

    Args:
        front: The front.
        border: Vertices (B,) that must all stay.
    """
    squares = _squares(front.quads)
    rings = [_ring(square) for square in squares]
    merged = [square.reshape(-1, 4) for square in squares]
    small = front.faces[~_is_half_of(front.faces, merged)]
    is_used = np.zeros(len(front.points), dtype=bool)
    is_used[small] = True
    is_used[border] = True
    for ring in rings:
        is_used[ring[:: len(ring) // 4]] = True
    fans = [small]
    for square, ring in zip(squares, rings, strict=True):
        kept = ring[is_used[ring]]
        middle = len(square) // 2
        centre = np.full(len(kept), square[middle, middle, 0])
        fans.append(np.stack([centre, kept, np.roll(kept, -1)], axis=1))
    return np.concatenate(fans)


def _squares(quads: IntArray) -> list[IntArray]:
    """Cells (n, n, 4) of the largest aligned squares of whole cells, n = 2, 4, 8."""
    is_whole = quads[..., 0] >= 0
    height, width = is_whole.shape
    level = np.pad(is_whole, [(0, -height % _LARGEST), (0, -width % _LARGEST)])
    levels = []
    side = 2
    while side <= _LARGEST:
        level = level[::2, ::2] & level[1::2, ::2] & level[::2, 1::2] & level[1::2, 1::2]
        levels.append((side, level))
        side *= 2
    is_taken = np.zeros(is_whole.shape, dtype=bool)
    squares = []
    for side, level in reversed(levels):
        for row, column in side * np.argwhere(level):
            part = np.s_[row : row + side, column : column + side]
            if not is_taken[part].any():
                is_taken[part] = True
                squares.append(quads[part])
    return squares


def _is_half_of(faces: IntArray, merged: list[IntArray]) -> BoolArray:
    """Which faces (F,) are halves of the merged cells, a list of (M, 4)."""
    if not merged:
        return np.zeros(len(faces), dtype=bool)
    cells = np.concatenate(merged)
    halves = cells[:, [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]].reshape(-1, 3)
    span = int(faces.max()) + 1
    weights = np.array([span * span, span, 1])
    return np.isin(np.sort(faces, axis=1) @ weights, np.sort(halves, axis=1) @ weights)


def _ring(square: IntArray) -> IntArray:
    """Vertices (4n,) around a square of cells (n, n, 4), counter-clockwise from the top left."""
    return np.concatenate(
        [square[:, 0, 0], square[-1, :, 1], square[::-1, -1, 2], square[0, ::-1, 3]]
    )
