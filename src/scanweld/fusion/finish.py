"""From the extracted triangles to the mesh that was asked for: pieces, smoothing, decimation."""

import logging

import fast_simplification
import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from scanweld.config import Component
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.mesh import (
    MIN_PIECE_SHARE,
    border_edges,
    border_vertices,
    compact,
    face_normals,
    pieces,
)

logger = logging.getLogger(__name__)

_MIN_PIECE_VOXELS = 50.0
"""Area, in squared voxels, below which a connected piece is dropped whatever its share."""
_TAUBIN_STEPS = (0.5, -0.53)
"""Taubin's factors lambda and mu: a smoothing step, and one that undoes the shrinking."""


def chosen_pieces(
    vertices: FloatArray, faces: IntArray, filled: BoolArray, voxel: float, component: Component
) -> tuple[FloatArray, IntArray, BoolArray]:
    """The mesh without the connected pieces that are not wanted; the largest always stays.

    Args:
        vertices: (V, 3).
        faces: (F, 3).
        filled: (V,) vertices that were not measured; a piece of no others is no surface.
        voxel: Edge of a voxel.
        component: Whether only the largest piece stays, or all that are no crumbs.
    """
    if not len(faces):
        return vertices, faces, filled
    piece = pieces(faces, len(vertices))[faces[:, 0]]
    face_area = 0.5 * np.linalg.norm(face_normals(vertices, faces), axis=1)
    face_area *= ~filled[faces].all(axis=1)
    area = np.bincount(piece, weights=face_area)
    least = max(_MIN_PIECE_VOXELS * voxel**2, MIN_PIECE_SHARE * float(area.sum()))
    stays = np.arange(len(area)) == np.argmax(area)
    if component == "all":
        stays |= area >= least
    logger.debug("%d of %d pieces stay", stays.sum(), len(np.unique(piece)))
    kept, kept_faces, index = compact(vertices, faces[stays[piece]])
    return kept, kept_faces, filled[index]


def close_pinholes(
    vertices: FloatArray, faces: IntArray, filled: BoolArray, max_length: float
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Close the holes whose border is no longer than this, by a fan about their middle.

    Args:
        vertices: (V, 3).
        faces: (F, 3) of a manifold: its borders are rings that do not touch.
        filled: (V,) flags; the new vertices have those of most of the border.
        max_length: Of a border.
    """
    start, end = border_edges(faces, len(vertices))
    if not len(start):
        return vertices, faces, filled
    links = coo_array((np.ones(len(start)), (start, end)), shape=(len(vertices), len(vertices)))
    ring = connected_components(links, directed=False)[1][start]
    length = np.bincount(ring, weights=np.linalg.norm(vertices[end] - vertices[start], axis=1))
    chosen = length[ring] <= max_length
    start, end = start[chosen], end[chosen]
    names, ring = np.unique(ring[chosen], return_inverse=True)
    number = np.bincount(ring, minlength=len(names))
    middle = [np.bincount(ring, weights=vertices[start, k]) / number for k in range(3)]
    fans = np.stack([end, start, len(vertices) + ring], axis=1)
    flags = 2 * np.bincount(ring, weights=filled[start]) > number
    return (
        np.concatenate([vertices, np.stack(middle, axis=1)]),
        np.concatenate([faces, fans]),
        np.concatenate([filled, flags]),
    )


def smoothed(
    vertices: FloatArray, faces: IntArray, rounds: int, membrane: BoolArray | None = None
) -> FloatArray:
    """Vertices (V, 3) smoothed without shrinking; borders stay.

    After Taubin, A signal processing approach to fair surface design (1995).

    Args:
        vertices: (V, 3).
        faces: (F, 3).
        rounds: Of both steps.
        membrane: (V,) the only vertices that move, with shrinking; if not given, all move without.
    """
    if not rounds or (membrane is not None and not membrane.any()):
        return vertices
    size = len(vertices)
    moves = ~border_vertices(faces, size)
    if membrane is not None:
        moves &= membrane
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    links = csr_array((np.ones(len(start)), (start, end)), shape=(size, size))
    links = ((links + links.T) > 0).astype(np.float64)
    degree = np.maximum(links.sum(axis=1), 1.0)
    mean = diags_array(1.0 / degree) @ links
    shrink, grow = _TAUBIN_STEPS
    for step in (shrink, grow if membrane is None else shrink) * rounds:
        vertices = vertices + step * moves[:, None] * (mean @ vertices - vertices)
    return vertices


def decimated(
    vertices: FloatArray, faces: IntArray, filled: BoolArray, num_faces: int
) -> tuple[FloatArray, IntArray, BoolArray]:
    """The mesh with about so many faces, by quadric error (Garland and Heckbert 1997).

    Border edges stay as they are, so that there may be more faces.

    Args:
        vertices: (V, 3).
        faces: (F, 3).
        filled: (V,) flags, which go over to the nearest vertices.
        num_faces: Faces that are wanted.
    """
    if num_faces >= len(faces):
        return vertices, faces, filled
    # In units of the mesh itself: the library's thresholds are absolute.
    middle, size = vertices.mean(axis=0), float(np.ptp(vertices, axis=0).max())
    simplified = fast_simplification.simplify(
        np.ascontiguousarray((vertices - middle) / size),
        np.ascontiguousarray(faces, dtype=np.int32),
        target_count=num_faces,
        preserve_border=True,
    )
    points, triangles = simplified[0], simplified[1]
    simple, parts = split_fans(triangles.astype(np.int64))
    new_vertices = middle + size * points[parts]
    if not filled.any():
        return new_vertices, simple, np.zeros(len(parts), dtype=bool)
    return new_vertices, simple, filled[KDTree(vertices).query(new_vertices)[1]]


def split_fans(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Give every fan of faces around a vertex a vertex of its own, so that the mesh is a manifold.

    Sheets that touch in a point or along an edge come apart; faces that lie back to back, which
    bound nothing, are dropped.

    Args:
        faces: (F, 3) indices.

    Returns:
        Faces (G, 3), and the old index (W,) of each new vertex.
    """
    if not len(faces):
        return faces, np.zeros(0, dtype=np.int64)
    faces = _without_back_to_back(faces)
    rows, columns = _linked_corners(faces)
    links = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(faces.size,) * 2)
    num_fans, fan = connected_components(links, directed=False)
    vertex = np.zeros(num_fans, dtype=np.int64)
    vertex[fan] = faces.ravel()
    order = np.argsort(vertex, kind="stable")  # numbered in the order of the old vertices
    number = np.empty(num_fans, dtype=np.int64)
    number[order] = np.arange(num_fans)
    return number[fan].reshape(-1, 3), vertex[order]


def _without_back_to_back(faces: IntArray) -> IntArray:
    """The faces (G, 3) whose corners are those of no other one."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)
    alike = np.concatenate([[False], (np.diff(corners[order], axis=0) == 0).all(axis=1), [False]])
    return faces[np.sort(order[~(alike[:-1] | alike[1:])])]


def _linked_corners(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Corners (L,) of faces, numbered row by row, and those (L,) of the next face around a vertex.

    Faces hang together by edges that only two of them have, and on whose outside they agree.
    """
    # Edge k of a face runs from its corner k to the next one.
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edge = np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    pairs = first[np.diff(first, append=faces.size) == 2]
    a, b = order[pairs], order[pairs + 1]
    # Two faces that agree on their outside run along their edge in opposite directions.
    opposite = start[a] == end[b]
    a, b = a[opposite], b[opposite]
    after = np.roll(np.arange(faces.size).reshape(-1, 3), -1, axis=1).ravel()
    return np.concatenate([a, after[a]]), np.concatenate([after[b], b])
