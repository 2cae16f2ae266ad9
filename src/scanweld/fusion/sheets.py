"""Double layers of a surface: two sheets that face the same way, one close behind the other."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.fusion.agreement import Agreement
from scanweld.fusion.finish import split_fans
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.buckets import into_buckets, nearest_within
from scanweld.geometry.mesh import corners_at, smoothed_normals

_SAME_SIDE = 0.7
"""Cosine of the angle between their normals above which two sheets face the same way; those of a
thin wall face opposite ways."""
_APART_VOXELS = (0.75, 3.0)
"""How far along the normal the other sheet lies, at least and at most."""
_MAX_EDGES = 5
"""Vertices no more than this number of edges apart are on the same sheet."""
_RADIUS_VOXELS = 0.75
"""Distance from a point on the normal within which a vertex of the other sheet is looked for."""
_PATCH_EDGES = 12
"""Second sheets are removed within so many edges of where they are found at first: far enough that
the rim of such a patch changes nothing."""
NORMAL_ROUNDS = 1
"""Rounds of averaging normals: thin triangles would tilt the normals of their corners."""


def without_second_sheets(
    vertices: FloatArray, faces: IntArray, agreement: Agreement, voxel: float
) -> tuple[FloatArray, IntArray]:
    """The surface as a manifold without double layers.

    Of two sheets the one goes that fewer scans agree on, or that is known worse. Sheets may hang
    together by what has to go, or by a corner that they share, so that they are looked for after
    such corners were split, and again until there are none.

    Args:
        vertices: (V, 3), about a voxel apart.
        faces: (F, 3).
        agreement: Of the scans on the vertices.
        voxel: Edge of a voxel.

    Returns:
        Vertices (W, 3) and faces (G, 3).
    """
    faces, parts = split_fans(faces)
    vertices = vertices[parts]
    agreement = Agreement(count=agreement.count[parts], stdev=agreement.stdev[parts])
    normals = smoothed_normals(vertices, faces, NORMAL_ROUNDS)
    in_patch = second_sheets(vertices, faces, normals, voxel) >= 0
    if not in_patch.any():
        return vertices, faces
    for _ in range(_PATCH_EDGES):
        in_patch[faces[in_patch[faces].any(axis=1)]] = True
    is_patch = in_patch[faces].any(axis=1)
    patch = _peeled(vertices, faces[is_patch], agreement, voxel)
    faces, parts = split_fans(np.concatenate([faces[~is_patch], patch]))
    return vertices[parts], faces


def _peeled(vertices: FloatArray, faces: IntArray, agreement: Agreement, voxel: float) -> IntArray:
    """The faces (G, 3) that stay."""
    index = np.arange(len(vertices))
    while True:  # each round takes faces away
        faces, parts = split_fans(faces)
        index = index[parts]
        points = vertices[index]
        other = second_sheets(points, faces, smoothed_normals(points, faces, NORMAL_ROUNDS), voxel)
        one = np.flatnonzero(other >= 0)
        if not len(one):
            return index[faces]
        two = other[one]
        fewer = agreement.count[index[one]] - agreement.count[index[two]]
        is_worse = agreement.stdev[index[one]] > agreement.stdev[index[two]]
        goes = np.zeros(len(index), dtype=bool)
        goes[np.where((fewer < 0) | ((fewer == 0) & is_worse), one, two)] = True
        faces = faces[~goes[faces].any(axis=1)]


def second_sheets(
    vertices: FloatArray, faces: IntArray, normals: FloatArray, voxel: float
) -> IntArray:
    """The vertex (V,) that each vertex has before or behind it on another sheet, -1 without.

    Args:
        vertices: (V, 3), about a voxel apart.
        faces: (F, 3); what hangs together by a few of them is one sheet, with a step.
        normals: (V, 3) unit.
        voxel: Edge of a voxel.
    """
    other = _opposite(vertices, normals, voxel)
    one = np.flatnonzero(other >= 0)
    faces = np.ascontiguousarray(faces)
    other[one[_hang_together(one, other[one], faces, *corners_at(faces, len(vertices)))]] = -1
    return other


def _opposite(vertices: FloatArray, normals: FloatArray, voxel: float) -> IntArray:
    """The vertex (V,) before or behind each that faces the same way, -1 without."""
    # In voxels from a corner: what is far from the origin of the world has no other neighbours.
    points = (vertices - vertices.min(axis=0, initial=np.inf)) / voxel
    return _find_opposite(points, normals, *into_buckets(points, 2.0 * _RADIUS_VOXELS))


@njit(cache=True, nogil=True)
def _find_opposite(
    points: FloatArray, normals: FloatArray, order: IntArray, start: IntArray
) -> IntArray:  # pragma: no cover - compiled
    least, most = _APART_VOXELS
    other = np.full(len(points), -1)
    for v in range(len(points)):
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        step, side = least + 0.5, 1.0
        while step < most and other[v] < 0:
            px, py, pz = points[v, 0], points[v, 1], points[v, 2]
            ahead = side * step
            found = nearest_within(
                points, order, start, _RADIUS_VOXELS, px + ahead * x, py + ahead * y, pz + ahead * z
            )
            if found >= 0:
                alike = x * normals[found, 0] + y * normals[found, 1] + z * normals[found, 2]
                offset = x * (points[found, 0] - px) + y * (points[found, 1] - py)
                offset += z * (points[found, 2] - pz)
                if alike > _SAME_SIDE and abs(offset) > least:
                    other[v] = found
            if side < 0.0:
                step += _RADIUS_VOXELS
            side = -side
    return other


@njit(cache=True, nogil=True)
def _hang_together(
    one: IntArray, two: IntArray, faces: IntArray, order: IntArray, start: IntArray
) -> BoolArray:  # pragma: no cover - compiled
    """Whether vertices one (K,) and two (K,) are a few edges apart at most."""
    found = np.zeros(len(one), np.bool_)
    seen_by = np.full(len(start), -1)
    for k in range(len(one)):
        front = [one[k]]
        seen_by[one[k]] = k
        for _ in range(_MAX_EDGES):
            after = [one[k]]
            for vertex in front:
                for corner in order[start[vertex] : start[vertex + 1]]:
                    for neighbour in faces[corner // 3]:
                        if seen_by[neighbour] != k:
                            seen_by[neighbour] = k
                            after.append(neighbour)
            front = after
        found[k] = seen_by[two[k]] == k
    return found
