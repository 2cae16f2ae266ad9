"""What is asked of the edges of meshes."""

import numpy as np

from scanweld.geometry.arrays import IntArray


def edges_of(faces: IntArray) -> tuple[IntArray, IntArray]:
    """The edges (E, 2) of faces, each once, and how many faces have it (E,)."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0, return_counts=True)


def is_closed(faces: IntArray) -> bool:
    """Whether every edge has two faces."""
    return set(edges_of(faces)[1]) == {2}
