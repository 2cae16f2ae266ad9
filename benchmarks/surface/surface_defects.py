"""What is wrong with a mesh in itself: no surface of a solid looks like this."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scanweld.fusion.sheets import second_sheets
from scanweld.geometry.mesh import TriangleMesh, border_edges, smoothed_normals

_MIN_RING_VOXELS = 8.0
"""Holes with a shorter border are pinholes."""
_SLIT_VOXELS = 0.5
"""Nor is one that is narrower than this a hole: it is a crack."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceDefects:
    """Counts of defects."""

    non_manifold: int  # Edges with more than two faces
    # Vertices that have a second sheet, which looks the same way, close before or behind
    double: int
    cracks: int  # Borders around a pinhole, or a slit narrower than a voxel
    borders: int  # Those around a hole, or the end of what was seen


def surface_defects(mesh: TriangleMesh, voxel: float) -> SurfaceDefects:
    """Count the defects of a mesh whose details are of the size of a voxel."""
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges[:, 0] * len(mesh.vertices) + edges[:, 1], return_counts=True)
    normals = smoothed_normals(mesh.vertices, mesh.faces, 1)
    cracks, borders = _rings(mesh, voxel)
    return SurfaceDefects(
        non_manifold=int((counts > 2).sum()),
        double=int((second_sheets(mesh.vertices, mesh.faces, normals, voxel) >= 0).sum()),
        cracks=cracks,
        borders=borders,
    )


def _rings(mesh: TriangleMesh, voxel: float) -> tuple[int, int]:
    """Numbers of the borders that bound a crack or a pinhole, and of the others."""
    start, end = border_edges(mesh.faces, len(mesh.vertices))
    if not len(start):
        return 0, 0
    size = len(mesh.vertices)
    links = coo_array((np.ones(len(start)), (start, end)), shape=(size, size))
    _, ring = np.unique(connected_components(links, directed=False)[1][start], return_inverse=True)
    a, b = mesh.vertices[start], mesh.vertices[end]
    length = np.bincount(ring, weights=np.linalg.norm(b - a, axis=1))
    doubled = [np.bincount(ring, weights=part) for part in np.cross(a - a.mean(axis=0), b - a).T]
    # A slit's area is its width times half of its border.
    width = np.linalg.norm(doubled, axis=0) / length
    is_crack = (length < _MIN_RING_VOXELS * voxel) | (width < _SLIT_VOXELS * voxel)
    return int(is_crack.sum()), int((~is_crack).sum())
