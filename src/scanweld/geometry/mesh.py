"""Triangle meshes: fused models, virtual objects, and the surface between an image's pixels."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray, frozen

MIN_PIECE_SHARE = 0.002
"""Connected pieces that are smaller than this share of a surface are taken for noise."""
SMOOTHING_ROUNDS = 2
"""Rounds in which what is noisy at vertices is averaged with their neighbours'."""
UNCOLORED = 128
"""Grey (0 to 255) of what has no colour where the rest has one."""


class NoEdge(IntEnum):
    """Instead of the other face's edge along an edge."""

    BORDER = -1
    IN_CONFLICT = -2


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class TriangleMesh:
    """Vertices (V, 3) and counter-clockwise faces (F, 3); normals point out, or to the sensor.

    Attributes:
        vertices: (V, 3), in a frame and a unit that the owner of the mesh names.
        faces: (F, 3) vertex indices.
        normals: (V, 3) unit normals or None.
        colors: (V, 3) uint8 or None.
        support: (V,) number of scans that agree on each vertex, or None.
        stdev: (V,) estimated standard deviation of each vertex along its normal, in the unit of
            the mesh, NaN where no scan measured it; or None.
        filled: (V,) vertices that no scan measured: they close holes; or None.

    Raises:
        ValueError: If the shapes do not fit, or a face names no vertex.
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None = None
    colors: ByteArray | None = None
    support: IntArray | None = None
    stdev: FloatArray | None = None
    filled: BoolArray | None = None

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        n = len(self.vertices)
        put("vertices", frozen(self.vertices, np.float64, (None, 3)))
        put("faces", frozen(self.faces, np.int64, (None, 3)))
        if self.faces.size and (self.faces.max() >= n or self.faces.min() < 0):
            raise ValueError("the faces name vertices that do not exist")
        if self.normals is not None:
            put("normals", frozen(self.normals, np.float64, (n, 3)))
        if self.colors is not None:
            put("colors", frozen(self.colors, np.uint8, (n, 3)))
        if self.support is not None:
            put("support", frozen(self.support, np.int64, (n,)))
        if self.stdev is not None:
            put("stdev", frozen(self.stdev, np.float64, (n,)))
        if self.filled is not None:
            put("filled", frozen(self.filled, np.bool_, (n,)))


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Normals (F, 3) of faces of vertices (V, 3), as long as twice the face's area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Unit vertex normals (V, 3), area-weighted; zero for vertices without a face."""
    return smoothed_normals(vertices, faces, 0)


def smoothed_normals(vertices: FloatArray, faces: IntArray, rounds: int) -> FloatArray:
    """Unit vertex normals (V, 3), averaged over the faces around again and again, by area."""
    return _normals(np.array(vertices, order="C"), np.array(faces, order="C"), rounds)


def border_edges(faces: IntArray, num_vertices: int) -> tuple[IntArray, IntArray]:
    """First and last vertices (B,) of the edges that only one face has, as it runs along them."""
    once = np.flatnonzero(opposite_edges(faces, num_vertices) == NoEdge.BORDER)
    return faces.ravel()[once], faces.ravel()[next_corner(once)]


def border_vertices(faces: IntArray, num_vertices: int) -> BoolArray:
    """Which vertices (V,) lie on an edge that only one face has."""
    is_border = np.zeros(num_vertices, dtype=bool)
    is_border[np.concatenate(border_edges(faces, num_vertices))] = True
    return is_border


def opposite_edges(faces: IntArray, num_vertices: int) -> IntArray:
    """The edge (3 F,) of the other face along each face's edge; edge 3 f + k starts at corner k.

    ``NoEdge.BORDER`` where no other face has the edge, ``IN_CONFLICT`` where more than
    two have it, or two that do not agree on their outside.
    """
    faces = np.array(faces, order="C")
    return _opposite_edges(faces, *corners_at(faces, num_vertices))


def next_corner(corners: IntArray) -> IntArray:
    """The next corners around their faces; corner 3 f + k is the k-th of face f."""
    after = corners + 1
    after[corners % 3 == 2] -= 3
    return after


def pieces(faces: IntArray, num_vertices: int) -> IntArray:
    """The connected piece (V,) of each vertex, from 0; one without a face is a piece by itself."""
    corners = faces.flatten()  # those of frozen faces would need a compiled kernel of their own
    return connected(corners, corners[next_corner(np.arange(faces.size))], num_vertices)


def compact(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Drop unused vertices: (vertices, faces, kept indices of the old vertices)."""
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[faces] = True
    kept = np.flatnonzero(is_used)
    return vertices[kept], (np.cumsum(is_used) - 1)[faces], kept


@njit(cache=True, nogil=True)
def corners_at(
    faces: IntArray, num_vertices: int
) -> tuple[IntArray, IntArray]:  # pragma: no cover - compiled
    """Corners (3 F,) sorted by their vertices, and where in them those of each (V + 1,) begin."""
    start = np.zeros(num_vertices + 2, np.int64)
    corners = faces.ravel()
    for vertex in corners:
        start[vertex + 2] += 1
    start = np.cumsum(start)
    order = np.empty(len(corners), np.int64)
    for corner, vertex in enumerate(corners):
        order[start[vertex + 1]] = corner
        start[vertex + 1] += 1
    return order, start[:-1]


@njit(cache=True, nogil=True)
def _opposite_edges(
    faces: IntArray, order: IntArray, start: IntArray
) -> IntArray:  # pragma: no cover - compiled
    end = np.empty_like(order)
    for k, edge in enumerate(order):
        end[k] = faces[edge // 3, (edge + 1) % 3]
    found = np.full(len(order), NoEdge.IN_CONFLICT.value)
    for first in range(len(start) - 1):
        for k in range(start[first], start[first + 1]):
            last, other, alike, against = end[k], NoEdge.BORDER.value, 0, 0
            for m in range(start[first], start[first + 1]):
                alike += end[m] == last
            for m in range(start[last], start[last + 1]):
                if end[m] == first:
                    other = order[m]
                    against += 1
            if alike == 1 and against <= 1:
                found[order[k]] = other
    return found


@njit(cache=True, nogil=True)
def connected(first: IntArray, second: IntArray, size: int) -> IntArray:  # pragma: no cover
    """Numbers (size,), from 0, of the parts that links (L,) between so many things make."""
    parent = np.arange(size)
    for a, b in zip(first, second):  # noqa: B905 - Numba knows no strict
        while parent[a] != a:
            parent[a] = parent[parent[a]]
            a = parent[a]
        while parent[b] != b:
            parent[b] = parent[parent[b]]
            b = parent[b]
        parent[max(a, b)] = min(a, b)
    # A part's root is the least of it, so that it has its number before the others ask for it.
    number, count = np.empty(size, np.int64), 0
    for k in range(size):
        if parent[k] == k:
            number[k] = count
            count += 1
        else:
            number[k] = number[parent[k]]
    return number


@njit(cache=True, nogil=True)
def _normals(
    vertices: FloatArray, faces: IntArray, rounds: int
) -> FloatArray:  # pragma: no cover - compiled
    normals = np.zeros(vertices.shape)
    for turn in range(rounds + 1):
        total = np.zeros(vertices.shape)
        for f in range(len(faces)):
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            ux, uy = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1]
            vx, vy = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1]
            uz, vz = vertices[b, 2] - vertices[a, 2], vertices[c, 2] - vertices[a, 2]
            x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            if turn > 0:
                area = np.sqrt(x * x + y * y + z * z)
                x = area * (normals[a, 0] + normals[b, 0] + normals[c, 0])
                y = area * (normals[a, 1] + normals[b, 1] + normals[c, 1])
                z = area * (normals[a, 2] + normals[b, 2] + normals[c, 2])
            for vertex in (a, b, c):
                total[vertex, 0] += x
                total[vertex, 1] += y
                total[vertex, 2] += z
        for vertex in range(len(vertices)):
            x, y, z = total[vertex, 0], total[vertex, 1], total[vertex, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                normals[vertex, 0] = x / length
                normals[vertex, 1] = y / length
                normals[vertex, 2] = z / length
    return normals
