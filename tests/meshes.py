"""Meshes put together, and what is asked of their edges."""

import numpy as np

from scanweld.geometry.arrays import IntArray
from scanweld.geometry.mesh import TriangleMesh


def joined(*meshes: TriangleMesh) -> TriangleMesh:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return TriangleMesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)]),
    )


def edges_of(faces: IntArray) -> tuple[IntArray, IntArray]:
    """The edges (E, 2) of faces, each once, and how many faces have it (E,)."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0, return_counts=True)


def is_closed(faces: IntArray) -> bool:
    """Whether every edge has two faces."""
    return set(edges_of(faces)[1]) == {2}
