"""From the extracted triangles to the mesh that was asked for: pieces, smoothing, decimation."""

import logging

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.spatial import KDTree

from scanweld.compiled.kernels import njit
from scanweld.config import Component
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.mesh import (
    MIN_PIECE_SHARE,
    border_edges,
    border_vertices,
    compact,
    connected,
    corners_at,
    face_normals,
    next_corner,
    opposite_edges,
    pieces,
)

logger = logging.getLogger(__name__)

_MIN_PIECE_VOXELS = 30.0
"""Area, in squared voxels, below which a connected piece is dropped whatever its share; each is
worth 1.5 points of a scan."""
_SLIT_SHARE = 0.05
"""Twice a hole's area over its border is its width, if it is a slit: one that is narrower than this
share of the longest border of a pinhole."""
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

    A border up to twice as long is closed as well, if it bounds no more than a slit.

    Args:
        vertices: (V, 3).
        faces: (F, 3) of a manifold: its borders are rings that do not touch.
        filled: (V,) flags; the new vertices have those of most of the border.
        max_length: Of a border.
    """
    start, end = border_edges(faces, len(vertices))
    if not len(start):
        return vertices, faces, filled
    ring = connected(start, end, len(vertices))[start]
    length = np.bincount(ring, weights=np.linalg.norm(vertices[end] - vertices[start], axis=1))
    away = vertices[start] - vertices[start].mean(axis=0)
    doubled = [
        np.bincount(ring, weights=p) for p in np.cross(away, vertices[end] - vertices[start]).T
    ]
    is_slit = np.linalg.norm(doubled, axis=0) < _SLIT_SHARE * max_length * length
    chosen = (length <= np.where(is_slit, 2.0, 1.0) * max_length)[ring]
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
    import fast_simplification  # few runs want it, and it takes 30 ms to import

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
    faces = np.ascontiguousarray(faces)
    size = int(faces.max()) + 1
    faces = faces[~_is_back_to_back(faces, *corners_at(faces, size))]
    opposite = opposite_edges(faces, size)
    edge = np.flatnonzero(opposite >= 0)
    # Faces that share an edge run along it in opposite directions.
    after = next_corner(opposite[edge])
    del opposite  # of two million faces, each of these arrays takes 50 MB
    fan = connected(edge, after, faces.size)
    del edge, after
    vertex = np.zeros(fan.max(initial=-1) + 1, dtype=np.int64)
    vertex[fan] = faces.ravel()
    order = np.argsort(vertex, kind="stable")  # numbered in the order of the old vertices
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    return number[fan].reshape(-1, 3), vertex[order]


@njit(cache=True, nogil=True)
def _is_back_to_back(
    faces: IntArray, order: IntArray, start: IntArray
) -> BoolArray:  # pragma: no cover - compiled
    """Faces (F,) whose corners are those of another one, too."""
    found = np.zeros(len(faces), np.bool_)
    for vertex in range(len(start) - 1):
        for k in range(start[vertex], start[vertex + 1]):
            f, at = order[k] // 3, order[k] % 3
            one, two = faces[f, (at + 1) % 3], faces[f, (at + 2) % 3]
            for m in range(start[vertex], k):
                g, at = order[m] // 3, order[m] % 3
                after, before = faces[g, (at + 1) % 3], faces[g, (at + 2) % 3]
                if (after == two and before == one) or (after == one and before == two):
                    found[f] = found[g] = True
    return found
