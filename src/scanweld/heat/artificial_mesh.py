"""The artificial mesh (paper 3.1): the front surface, closed by side walls and a back plane."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray, frozen
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import pieces
from scanweld.heat.back import coarse_faces
from scanweld.heat.front import FrontMesh

_BACK_DIAMETERS = 0.05
"""The back plane lies this far behind the deepest point."""
_WALL_ROWS = (0.15, 0.5)
"""Rows of wall vertices between the front's border and the back plane, as shares of the way."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ArtificialMesh:
    """A closed manifold mesh, its faces counter-clockwise from outside.

    Attributes:
        vertices: (V, 3), sensor frame; the front's vertices come first, unchanged.
        faces: (F, 3); the front's faces come first, unchanged.
        num_front: How many vertices are the front's.
    """

    vertices: FloatArray
    faces: IntArray
    num_front: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, np.float64, (None, 3)))
        object.__setattr__(self, "faces", frozen(self.faces, np.int64, (None, 3)))


def close_front(front: FrontMesh, camera: Camera, diameter: float) -> ArtificialMesh:
    """Close each piece of a front with walls along the viewing rays and a plane at its back.

    Walls and back are coarse: heat needs them only as a way round, and their vertices would take
    the spectrum up. For the same reason each piece has its own plane.

    Args:
        front: At least one face.
        camera: Of the front's range image; pinhole or orthographic.
        diameter: Of the scan, in the same unit.
    """
    edges = border_edges(front.faces)
    border, ends = np.unique(edges, return_inverse=True)
    back_faces = coarse_faces(front, border)
    plane = np.unique(back_faces)
    behind = _on_back_planes(front, camera, _BACK_DIAMETERS * diameter)

    num_front, num_border, num_rows = len(front.points), len(border), len(_WALL_ROWS)
    top, bottom = front.points[border], behind[border]
    rows = [(1 - share) * top + share * bottom for share in _WALL_ROWS]
    row_index = num_front + np.arange(num_rows * num_border).reshape(num_rows, num_border)
    back_index = np.full(num_front, -1, dtype=np.int64)
    back_index[plane] = num_front + num_rows * num_border + np.arange(len(plane))

    levels = np.concatenate([border[None], row_index, back_index[border][None]])
    walls = _walls(levels[:, ends.reshape(-1, 2)])
    return ArtificialMesh(
        vertices=np.concatenate([front.points, *rows, behind[plane]]),
        faces=np.concatenate([front.faces, walls, back_index[back_faces][:, ::-1]]),
        num_front=num_front,
    )


def border_edges(faces: IntArray) -> IntArray:
    """Directed edges (B, 2) that only one face has, in that face's direction."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    span = int(faces.max(initial=0)) + 1
    is_border = ~np.isin(start * span + end, end * span + start)
    return np.stack([start[is_border], end[is_border]], axis=1)


def _on_back_planes(front: FrontMesh, camera: Camera, behind: float) -> FloatArray:
    """Where (N, 3) the viewing rays of a front's points meet the back plane of their piece."""
    pixels, depth = camera.project(front.points)
    piece = pieces(front.faces, len(front.points))
    deepest = np.full(int(piece.max()) + 1, -np.inf)
    np.maximum.at(deepest, piece, depth)
    return camera.unproject(pixels, deepest[piece] + behind)


def _walls(levels: IntArray) -> IntArray:
    """Faces (.., 3) of the strips between levels (L, B, 2) of the border's edges, top to bottom."""
    strips = []
    for upper, lower in pairwise(levels):
        (a, b), (below_a, below_b) = upper.T, lower.T
        strips += [np.stack([b, a, below_a], axis=1), np.stack([b, below_a, below_b], axis=1)]
    return np.concatenate(strips)
