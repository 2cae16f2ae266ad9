"""The measured surface as a coarse triangle mesh: a thinned range image, cut at depth jumps."""

from dataclasses import dataclass
from itertools import count, pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray, frozen
from scanweld.geometry.grid import GAP_ROUNDS
from scanweld.geometry.mesh import pieces
from scanweld.geometry.prepared import RangeImage

_SMALLEST_PIECE = 0.01
"""Pieces smaller than this share of the front's vertices are left out: each takes up eigenmodes."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FrontMesh:
    """A manifold mesh of pixels of a range image, with borders at jumps, holes and silhouette.

    Attributes:
        points: (N, 3), sensor frame.
        pixels: (N, 2) row and column of each point. Where two fans of faces meet in one pixel, each
            has its own point there.
        faces: (F, 3), counter-clockwise as the sensor sees them from outside.
        quads: (R, C, 4) points at the corners of the thinned grid's cells, counter-clockwise from
            the top left, -1 where not both triangles of the cell are there.
    """

    points: FloatArray
    pixels: IntArray
    faces: IntArray
    quads: IntArray

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("points", frozen(self.points, np.float64, (None, 3)))
        put("pixels", frozen(self.pixels, np.int64, (len(self.points), 2)))
        put("faces", frozen(self.faces, np.int64, (None, 3)))
        put("quads", frozen(self.quads, np.int64, (None, None, 4)))


def thin_front(image: RangeImage, max_vertices: int, *, bridged: bool = False) -> FrontMesh:
    """The surface of a range image on every n-th row and column, n as small as the limit allows.

    Two pixels of the thinned grid are joined only where the full image shows no jump between them,
    unless jumps are bridged, too. Dropouts of a pixel or two always are; small pieces are left out.
    The mesh may be empty.
    """
    max_step = image.jump_pixels * image.pixel
    depth = _bridge_dropouts(image.depth, max_step)
    points = image.camera.unproject_image(depth)
    jump = np.inf if bridged else max_step
    for stride in count(1):
        if np.isfinite(depth[::stride, ::stride]).sum() > max_vertices:
            continue
        front = _mesh_grid(points, depth, stride, jump)
        if len(front.points) <= max_vertices:
            return front
    raise AssertionError("unreachable: a stride beyond the image leaves one pixel")


def _bridge_dropouts(depth: FloatArray, jump: float) -> FloatArray:
    """Depths with small holes filled from both sides of their row or column, where these agree."""
    for _ in range(GAP_ROUNDS):
        padded = np.pad(depth, 1, constant_values=np.nan)
        filled = depth.copy()
        for one, other in (
            (padded[1:-1, :-2], padded[1:-1, 2:]),
            (padded[:-2, 1:-1], padded[2:, 1:-1]),
        ):
            use = np.isnan(filled) & (np.abs(one - other) < jump)
            filled[use] = 0.5 * (one + other)[use]
        depth = filled
    return depth


def _mesh_grid(points: FloatArray, depth: FloatArray, stride: int, jump: float) -> FrontMesh:
    cells = _cell_triangles(depth, stride, jump)
    width = depth.shape[1]
    is_there = cells[..., 0] >= 0
    corners, pixel_of = _split_fans(cells[is_there])
    kept = _large_pieces(corners, len(pixel_of))
    used, faces = np.unique(corners[kept], return_inverse=True)
    vertex_cells = np.full(cells.shape, -1, dtype=np.int64)
    rank = np.flatnonzero(is_there.ravel())[kept]
    vertex_cells.reshape(-1, 3)[rank] = faces.reshape(-1, 3)
    pixels = np.stack(np.divmod(pixel_of[used], width), axis=1)
    return FrontMesh(
        points=points[pixels[:, 0], pixels[:, 1]],
        pixels=pixels,
        faces=faces.reshape(-1, 3),
        quads=_quads(vertex_cells),
    )


def _cell_triangles(depth: FloatArray, stride: int, jump: float) -> IntArray:
    """Pixel indices (R, C, 2, 3) of the triangles in the thinned grid's cells, -1 where cut.

    A cell is split from top left to bottom right; where that diagonal is cut, the other one may
    leave a single triangle.
    """
    height, width = depth.shape
    rows, columns = np.arange(0, height, stride), np.arange(0, width, stride)
    top, left = np.meshgrid(rows[:-1], columns[:-1], indexing="ij")
    bottom, right = top + stride, left + stride

    def joined(row: IntArray, column: IntArray, down: int, along: int) -> BoolArray:
        """Whether there is no jump on the way of one cell's side or diagonal."""
        path = [depth[row + k * down, column + k * along] for k in range(stride + 1)]
        longest = jump * np.hypot(down, along)
        with np.errstate(invalid="ignore"):
            return np.all([np.abs(b - a) < longest for a, b in pairwise(path)], 0)

    sides = {
        "t": joined(top, left, 0, 1),
        "b": joined(bottom, left, 0, 1),
        "l": joined(top, left, 1, 0),
        "r": joined(top, right, 1, 0),
        "falling": joined(top, left, 1, 1),
        "rising": joined(bottom, left, -1, 1),
    }
    tl, bl = top * width + left, bottom * width + left
    br, tr = bottom * width + right, top * width + right
    cells = np.full((*top.shape, 2, 3), -1, dtype=np.int64)
    halves = (
        (0, (tl, bl, br), "l", "b", "falling"),
        (1, (tl, br, tr), "r", "t", "falling"),
        (0, (tl, bl, tr), "l", "t", "rising"),
        (1, (bl, br, tr), "b", "r", "rising"),
    )
    has_falling = np.zeros(top.shape, dtype=bool)
    for slot, triangle, one, two, diagonal in halves:
        there = sides[one] & sides[two] & sides[diagonal]
        if diagonal == "falling":
            has_falling |= there
        else:
            there &= ~has_falling
        cells[there, slot] = np.stack(triangle, axis=-1)[there]
    return cells


def _split_fans(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Faces (F, 3) on own vertices for each fan, and the old index of each new vertex.

    Corners of faces are one vertex only where the faces share an edge there, so that no vertex
    joins fans that touch in nothing but a point.
    """
    num = 3 * len(faces)
    corner = np.arange(num).reshape(-1, 3)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    from_corner, to_corner = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    # An inner edge is run through once in each direction by its two faces.
    span = int(faces.max(initial=0)) + 1
    _, there, back = np.intersect1d(start * span + end, end * span + start, return_indices=True)
    joins = np.concatenate([from_corner[there], to_corner[there]])
    joined = np.concatenate([to_corner[back], from_corner[back]])
    graph = coo_array((np.ones(len(joins), dtype=bool), (joins, joined)), shape=(num, num))
    _, labels = connected_components(graph, directed=False)
    _, first = np.unique(labels, return_index=True)
    return labels.astype(np.int64).reshape(-1, 3), start[first]


def _large_pieces(faces: IntArray, num_vertices: int) -> BoolArray:
    """Which faces (F,) belong to connected pieces that are not tiny."""
    piece = pieces(faces, num_vertices)
    sizes = np.bincount(piece, minlength=1)
    return sizes[piece[faces[:, 0]]] >= max(_SMALLEST_PIECE * num_vertices, 4)


def _quads(cells: IntArray) -> IntArray:
    """Corners (R, C, 4) of the cells (R, C, 2, 3) that have both triangles, -1 for the others."""
    first, second = cells[..., 0, :], cells[..., 1, :]
    is_full = (first[..., 0] >= 0) & (second[..., 0] >= 0)
    is_falling = first[..., 0] == second[..., 0]
    falling = np.concatenate([first, second[..., 2:]], axis=-1)
    rising = np.stack([first[..., 0], first[..., 1], second[..., 1], first[..., 2]], axis=-1)
    quads = np.where(is_falling[..., None], falling, rising)
    return np.where(is_full[..., None], quads, -1)
