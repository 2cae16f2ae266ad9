"""The placed scans held against the fused surface: residuals, support, open borders."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.mesh import SMOOTHING_ROUNDS, TriangleMesh, face_normals, vertex_normals

MAX_POINTS = 300_000
"""Points of all scans together that are held against the surface; beyond, every k-th is."""
REACH_EDGES = 6.0
"""A point farther from all vertices than so many median edges is off the model."""
THIN = 1
"""A place seen by so many scans, or fewer, is thinly supported."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SurfaceCheck:
    """How the scans' points lie to the model.

    Attributes:
        distances: For each scan the signed distances of its points from the surface, positive
            outside, in the scans' unit; points off the model left out.
        points: For each scan the points (N, 3) of these distances, in the model's frame,
        nearest: and the vertex (N,) nearest to each.
        normals: (V, 3) of the model.
        off_model: Share of all points that lie farther than the reach from the model.
        residual: (V,) mean distance of the points at each vertex, smoothed; NaN without any.
        support: (V,) number of scans whose surface lies there, as the model says; where it does
            not, of scans that have points there.
    """

    distances: Mapping[str, FloatArray]
    points: Mapping[str, FloatArray]
    nearest: Mapping[str, IntArray]
    normals: FloatArray
    off_model: float
    residual: FloatArray
    support: IntArray

    def all_distances(self) -> FloatArray:
        """Distances without sign of all scans' points, sorted."""
        return np.sort(np.abs(np.concatenate([*self.distances.values(), np.zeros(0)])))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class OpenBorders:
    """Where the model is open.

    Attributes:
        edges: (B, 2) vertices of the edges that only one face has.
        num_holes: Connected pieces of them.
        length: Of all of them.
        longest: Length of the longest piece.
    """

    edges: IntArray
    num_holes: int
    length: float
    longest: float


def check_surface(mesh: TriangleMesh, scans: Mapping[str, FloatArray]) -> SurfaceCheck:
    """Hold scans against the surface.

    Args:
        mesh: The model.
        scans: Points (N, 3) of each scan by name, in the model's frame.
    """
    normals = vertex_normals(mesh.vertices, mesh.faces)
    reach = REACH_EDGES * median_edge(mesh)
    total = sum(len(points) for points in scans.values())
    step = max(1, -(-total // MAX_POINTS))
    tree = KDTree(mesh.vertices, compact_nodes=False, balanced_tree=False)  # soon built
    distances, kept, vertices = {}, {}, {}
    num_used = num_checked = 0
    size = len(mesh.vertices)
    support, sums, counts = np.zeros(size, np.int64), np.zeros(size), np.zeros(size)
    for name, points in scans.items():
        points = points[::step]
        apart, nearest = tree.query(points, distance_upper_bound=reach)
        near = np.isfinite(apart)
        points, nearest = points[near], np.asarray(nearest)[near]
        signed = np.einsum("nk,nk->n", normals[nearest], points - mesh.vertices[nearest])
        distances[name], kept[name], vertices[name] = signed, points, nearest
        num_checked, num_used = num_checked + len(near), num_used + len(points)
        number = np.bincount(nearest, minlength=size)
        if mesh.support is None:
            support += spread(number > 0, mesh.faces, rounds=int(np.ceil(np.sqrt(step))))
        sums += np.bincount(nearest, weights=np.abs(signed), minlength=size)
        counts += number
    return SurfaceCheck(
        distances=distances,
        points=kept,
        nearest=vertices,
        normals=normals,
        off_model=1 - num_used / num_checked if num_checked else 0.0,
        residual=_smoothed(sums, counts, mesh.faces),
        support=support if mesh.support is None else mesh.support,
    )


def thin_share(mesh: TriangleMesh, support: IntArray) -> float:
    """Share of the surface's area that is thinly supported."""
    areas = np.linalg.norm(face_normals(mesh.vertices, mesh.faces), axis=1)
    thin = (support <= THIN)[mesh.faces].sum(axis=1) >= 2  # the median of three
    return float(areas[thin].sum() / areas.sum()) if areas.sum() > 0 else 0.0


def open_borders(mesh: TriangleMesh) -> OpenBorders:
    """The edges that only one face has, and the pieces they form."""
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    size = len(mesh.vertices)
    keys, counts = np.unique(edges[:, 0] * size + edges[:, 1], return_counts=True)
    once = keys[counts == 1]
    border = np.stack([once // size, once % size], axis=1)
    if not len(border):
        return OpenBorders(edges=border, num_holes=0, length=0.0, longest=0.0)
    lengths = np.linalg.norm(mesh.vertices[border[:, 0]] - mesh.vertices[border[:, 1]], axis=1)
    piece = _pieces(border, size)
    per_piece = np.bincount(piece, weights=lengths)
    return OpenBorders(
        edges=border,
        num_holes=len(per_piece),
        length=float(lengths.sum()),
        longest=float(per_piece.max()),
    )


def median_edge(mesh: TriangleMesh) -> float:
    """Median length of the faces' edges."""
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    squares = [np.einsum("nk,nk->n", side, side) for side in (a - b, b - c, c - a)]
    return float(np.median(np.sqrt(np.concatenate(squares))))


def spread(seen: BoolArray, faces: IntArray, rounds: int) -> BoolArray:
    """The vertices seen, and those that share a face with one, round after round."""
    for _ in range(rounds):
        touched = seen[faces].any(axis=1)
        seen = seen.copy()
        seen[faces[touched].ravel()] = True
    return seen


def _pieces(edges: IntArray, num_vertices: int) -> IntArray:
    """Number (B,) of the connected piece of each edge, from 0."""
    links = coo_array((np.ones(len(edges), bool), edges.T), shape=(num_vertices, num_vertices))
    labels = connected_components(links, directed=False)[1]
    return np.unique(labels[edges[:, 0]], return_inverse=True)[1].reshape(-1).astype(np.int64)


def _smoothed(sums: FloatArray, counts: FloatArray, faces: IntArray) -> FloatArray:
    rows, columns = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(sums), len(sums))).tocsr()
    links = links + links.T
    for _ in range(SMOOTHING_ROUNDS):
        sums, counts = sums + links @ sums, counts + links @ counts
    return np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0)
