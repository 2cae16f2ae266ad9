"""Double layers of a surface: two sheets that face the same way, one close behind the other."""

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from scanweld.fusion.agreement import Agreement
from scanweld.fusion.finish import split_fans
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.mesh import smoothed_normals

_SAME_SIDE = 0.7
"""Cosine of the angle between their normals above which two sheets face the same way; those of a
thin wall face opposite ways."""
_APART_VOXELS = (0.75, 3.0)
"""How far along the normal the other sheet lies, at least and at most."""
_MAX_EDGES = 5
"""Vertices no more than this number of edges apart are on the same sheet."""
_RADIUS_VOXELS = 0.75
"""Distance from a point on the normal within which a vertex of the other sheet is looked for."""
_MAX_PEELS = 8
"""Rounds of removing second sheets, at most; usually two or three are enough."""
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
    index = np.arange(len(vertices))
    for _ in range(_MAX_PEELS):
        faces, parts = split_fans(faces)
        index = index[parts]
        if not len(faces):
            break
        points = vertices[index]
        normals = smoothed_normals(points, faces, NORMAL_ROUNDS)
        other = second_sheets(points, faces, normals, voxel)
        one = np.flatnonzero(other >= 0)
        if not len(one):
            break
        two = other[one]
        fewer = agreement.count[index[one]] - agreement.count[index[two]]
        is_worse = agreement.stdev[index[one]] > agreement.stdev[index[two]]
        goes = np.zeros(len(index), dtype=bool)
        goes[np.where((fewer < 0) | ((fewer == 0) & is_worse), one, two)] = True
        faces = faces[~goes[faces].any(axis=1)]
    return vertices[index], faces


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
    tree = KDTree(vertices)
    least, most = _APART_VOXELS
    other = np.full(len(vertices), -1)
    for step in np.arange(least + 0.5, most, _RADIUS_VOXELS):
        for side in (1.0, -1.0):
            places = vertices + side * step * voxel * normals
            apart, nearest = tree.query(places, distance_upper_bound=_RADIUS_VOXELS * voxel)
            found = np.flatnonzero(np.isfinite(apart) & (other < 0))
            index = np.asarray(nearest)[found]
            between = vertices[index] - vertices[found]
            offset = np.abs(np.einsum("vk,vk->v", between, normals[found]))
            alike = np.einsum("vk,vk->v", normals[index], normals[found]) > _SAME_SIDE
            is_sheet = alike & (offset > least * voxel)
            other[found[is_sheet]] = index[is_sheet]
    one = np.flatnonzero(other >= 0)
    other[one[_hang_together(one, other[one], faces, len(vertices))]] = -1
    return other


def _hang_together(one: IntArray, two: IntArray, faces: IntArray, size: int) -> BoolArray:
    """Whether vertices one (K,) and two (K,) are a few edges apart at most."""
    if not len(one):
        return np.zeros(0, dtype=bool)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    links = csr_array((np.ones(len(start), np.int8), (start, end)), shape=(size, size))
    links = ((links + links.T) > 0).astype(np.int8)
    around = links[one]
    for _ in range(_MAX_EDGES - 1):
        around = ((around + around @ links) > 0).astype(np.int8)
    near = around.tocoo()
    return np.bincount(near.row, weights=near.col == two[near.row], minlength=len(one)) > 0
