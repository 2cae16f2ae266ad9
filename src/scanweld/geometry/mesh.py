"""Triangle meshes: fused models, virtual objects, and the surface between an image's pixels."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray, frozen

MIN_PIECE_SHARE = 0.002
"""Connected pieces that are smaller than this share of a surface are taken for noise."""


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
    weighted = face_normals(vertices, faces)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(
                faces[:, corner], weights=weighted[:, axis], minlength=len(vertices)
            )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def smoothed_normals(vertices: FloatArray, faces: IntArray, rounds: int) -> FloatArray:
    """Unit vertex normals (V, 3), averaged over the faces around again and again, by area."""
    normals = vertex_normals(vertices, faces)
    area = np.linalg.norm(face_normals(vertices, faces), axis=1, keepdims=True)
    for _ in range(rounds):
        mean = area * normals[faces].sum(axis=1)
        summed = np.stack(
            [
                sum(
                    np.bincount(faces[:, k], weights=mean[:, axis], minlength=len(vertices))
                    for k in range(3)
                )
                for axis in range(3)
            ],
            axis=1,
        )
        length = np.linalg.norm(summed, axis=1, keepdims=True)
        normals = np.where(length > 0, summed / np.where(length > 0, length, 1.0), normals)
    return normals


def border_edges(faces: IntArray, num_vertices: int) -> tuple[IntArray, IntArray]:
    """First and last vertices (B,) of the edges that only one face has, as it runs along them."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys = np.minimum(start, end) * num_vertices + np.maximum(start, end)
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    once = first[counts == 1]
    return start[once], end[once]


def border_vertices(faces: IntArray, num_vertices: int) -> BoolArray:
    """Which vertices (V,) lie on an edge that only one face has."""
    is_border = np.zeros(num_vertices, dtype=bool)
    is_border[np.concatenate(border_edges(faces, num_vertices))] = True
    return is_border


def pieces(faces: IntArray, num_vertices: int) -> IntArray:
    """The connected piece (V,) of each vertex, from 0; one without a face is a piece by itself."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edges = coo_array(
        (np.ones(len(start), dtype=bool), (start, end)), shape=(num_vertices, num_vertices)
    )
    return connected_components(edges, directed=False)[1].astype(np.int64)


def compact(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Drop unused vertices: (vertices, faces, kept indices of the old vertices)."""
    kept, inverse = np.unique(faces, return_inverse=True)
    return vertices[kept], inverse.reshape(faces.shape), kept
