"""The artificial mesh (paper 3.1): the front surface, closed by side walls and a back plane."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray, frozen
from scanweld.geometry.camera import Camera
from scanweld.heat.front import FrontMesh

# The back plane lies this far behind the deepest point.
_BACK_DIAMETERS = 0.05
# Rows of wall vertices between the front's border and the back plane, as shares of the way.
_WALL_ROWS = (0.15, 0.5)
# The back plane's largest squares, in edges of the front.
_LARGEST_SQUARE = 8


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ArtificialMesh:
    """A closed manifold mesh, its faces counter-clockwise from outside.

    Attributes:
        vertices: (V, 3), sensor frame; the front's vertices come first, unchanged.
        faces: (F, 3).
        num_front: How many vertices are the front's.
        front_of: (V,) the front vertex on the same viewing ray.
    """

    vertices: FloatArray
    faces: IntArray
    num_front: int
    front_of: IntArray

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("vertices", frozen(self.vertices, np.float64, (None, 3)))
        put("faces", frozen(self.faces, np.int64, (None, 3)))
        put("front_of", frozen(self.front_of, np.int64, (len(self.vertices),)))


def close_front(front: FrontMesh, camera: Camera, diameter: float) -> ArtificialMesh:
    """Close a front with walls along the viewing rays and a plane behind its deepest point.

    Walls and back are as coarse as a closed mesh allows: heat needs them only as a way round, and
    what vertices they have eats into the spectrum.

    Args:
        front: At least one face.
        camera: Of the front's range image; pinhole or orthographic.
        diameter: Of the scan, in the same unit.
    """
    edges = border_edges(front.faces)
    border, ends = np.unique(edges, return_inverse=True)
    back_faces = _back_faces(front, border)
    plane = np.union1d(border, back_faces)
    pixels, depth = camera.project(front.points)
    back_depth = np.full(len(depth), depth.max() + _BACK_DIAMETERS * diameter)
    behind = camera.unproject(pixels, back_depth)

    top, bottom = front.points[border], behind[border]
    rows = [(1 - share) * top + share * bottom for share in _WALL_ROWS]
    num_front = len(front.points)
    row_index = [num_front + k * len(border) + np.arange(len(border)) for k in range(len(rows))]
    back_index = np.full(num_front, -1, dtype=np.int64)
    back_index[plane] = num_front + len(rows) * len(border) + np.arange(len(plane))

    levels = [border, *row_index, back_index[border]]
    walls = _walls(np.stack(levels), ends.reshape(-1, 2))
    return ArtificialMesh(
        vertices=np.concatenate([front.points, *rows, behind[plane]]),
        faces=np.concatenate([front.faces, walls, back_index[back_faces][:, ::-1]]),
        num_front=num_front,
        front_of=np.concatenate([np.arange(num_front), *[border] * len(rows), plane]),
    )


def border_edges(faces: IntArray) -> IntArray:
    """Directed edges (B, 2) that only one face has, in that face's direction."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    span = int(faces.max(initial=0)) + 1
    is_border = ~np.isin(start * span + end, end * span + start)
    return np.stack([start[is_border], end[is_border]], axis=1)


def _walls(levels: IntArray, ends: IntArray) -> IntArray:
    """Faces (.., 3) of strips below border edges: levels (L, B) of vertices, edges as columns of it."""
    strips = []
    for upper, lower in zip(levels, levels[1:], strict=False):
        a, b, below_a, below_b = (
            upper[ends[:, 0]],
            upper[ends[:, 1]],
            lower[ends[:, 0]],
            lower[ends[:, 1]],
        )
        strips += [np.stack([b, a, below_a], axis=1), np.stack([b, below_a, below_b], axis=1)]
    return np.concatenate(strips)


def _back_faces(front: FrontMesh, border: IntArray) -> IntArray:
    """A coarse triangulation (F, 3) of the front's outline, on the front's vertices and winding.

    Whole cells of the grid are merged to squares as in a quadtree. A square is a fan about its
    centre to all vertices on its sides that a neighbour or the border uses, so that faces fit.
    """
    sizes = _square_sizes(front.quads[..., 0] >= 0)
    squares = [
        (r, c, int(sizes[r, c])) for r, c in np.argwhere(sizes > 1) if _is_corner(r, c, sizes)
    ]
    merged = np.concatenate(
        [front.quads[r : r + n, c : c + n].reshape(-1, 4) for r, c, n in squares]
        or [np.empty((0, 4), dtype=np.int64)]
    )
    small = front.faces[~_in_squares(front.faces, merged)]
    is_used = np.zeros(len(front.points), dtype=bool)
    is_used[small] = True
    is_used[border] = True
    rings = [_ring(front.quads[r : r + n, c : c + n]) for r, c, n in squares]
    for ring in rings:
        is_used[ring[:: len(ring) // 4]] = True
    fans = [small]
    for (r, c, n), ring in zip(squares, rings, strict=True):
        kept = ring[is_used[ring]]
        centre = np.full(len(kept), front.quads[r + n // 2, c + n // 2, 0])
        fans.append(np.stack([centre, kept, np.roll(kept, -1)], axis=1))
    return np.concatenate(fans)


def _square_sizes(is_whole: np.ndarray) -> IntArray:
    """The side (R, C), in cells, of the largest aligned square of whole cells around each cell."""
    height, width = is_whole.shape
    pad = [(0, -height % _LARGEST_SQUARE), (0, -width % _LARGEST_SQUARE)]
    level = np.pad(is_whole, pad)
    sizes = level.astype(np.int64)
    side = 1
    while side < _LARGEST_SQUARE:
        side *= 2
        level = level[::2, ::2] & level[1::2, ::2] & level[::2, 1::2] & level[1::2, 1::2]
        sizes = np.maximum(sizes, side * np.kron(level, np.ones((side, side), dtype=np.int64)))
    return sizes[:height, :width]


def _is_corner(row: int, column: int, sizes: IntArray) -> bool:
    side = sizes[row, column]
    return row % side == 0 and column % side == 0


def _in_squares(faces: IntArray, merged: IntArray) -> np.ndarray:
    """Which faces (F,) are halves of the merged cells (M, 4)."""
    span = int(faces.max(initial=0)) + 1
    key = lambda corners: np.sort(corners, axis=1) @ np.array([span * span, span, 1])  # noqa: E731
    halves = [
        merged[:, [0, 1, 2]],
        merged[:, [0, 2, 3]],
        merged[:, [0, 1, 3]],
        merged[:, [1, 2, 3]],
    ]
    return np.isin(key(faces), key(np.concatenate(halves)))


def _ring(quads: IntArray) -> IntArray:
    """Vertices (4n,) around a square of n x n cells, counter-clockwise from the top left."""
    return np.concatenate([quads[:, 0, 0], quads[-1, :, 1], quads[::-1, -1, 2], quads[0, ::-1, 3]])
