"""How far points lie from a surface, and points spread evenly over one."""

import numpy as np
from scipy.spatial import KDTree
from trimesh.triangles import closest_point

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, face_normals

_NUM_NEAREST = 6
"""Triangles that a point is held against: those nearest to it by their samples."""


def sample_surface(
    mesh: TriangleMesh, num_samples: int, rng: np.random.Generator
) -> tuple[FloatArray, IntArray]:
    """Points (N, 3), spread evenly by area, and the faces (N,) that they lie on."""
    areas = np.linalg.norm(face_normals(mesh.vertices, mesh.faces), axis=1)
    steps = (np.arange(num_samples) + rng.random(num_samples)) / num_samples
    face_of = np.searchsorted(np.cumsum(areas), steps * areas.sum(), side="right")
    face_of = np.minimum(face_of, len(areas) - 1)
    u, v = rng.random((2, num_samples))
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    a, b, c = (mesh.vertices[mesh.faces[face_of, k]] for k in range(3))
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), face_of


def surface_distances(
    points: FloatArray, mesh: TriangleMesh, *, num_samples: int = 100_000, seed: int = 0
) -> FloatArray:
    """Distances (N,) of points (N, 3) from a surface.

    Args:
        points: In the frame of the mesh.
        mesh: The surface.
        num_samples: Marks on it, by which its large triangles are found.
        seed: Of the marks.
    """
    marks, face_of = sample_surface(mesh, num_samples, np.random.default_rng(seed))
    return _distances(points, mesh, marks, face_of)


def _distances(
    points: FloatArray, mesh: TriangleMesh, samples: FloatArray, face_of: IntArray
) -> FloatArray:
    """Distances (N,) of points from the triangles nearest by.

    Large triangles are found by the samples on them, small ones by their middles.
    """
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    marks = np.concatenate([samples, middles])
    mark_faces = np.concatenate([face_of, np.arange(len(mesh.faces))])
    _, nearest = KDTree(marks).query(points, k=_NUM_NEAREST)
    candidates = mark_faces[np.asarray(nearest)]
    best = np.full(len(points), np.inf)
    for k in range(_NUM_NEAREST):
        triangles = mesh.vertices[mesh.faces[candidates[:, k]]]
        best = np.minimum(best, distance_to_triangles(points, triangles))
    return best


def distance_to_triangles(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Distance (N,) of each point (N, 3) from its own triangle (N, 3 corners, 3)."""
    return np.linalg.norm(points - closest_point(triangles, points), axis=1)
