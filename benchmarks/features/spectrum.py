"""Eigenpairs of a mesh with the points they belong to: what spectral descriptors are made of."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.heat.laplacian import eigenpairs

_NUM_NEAREST = 3


class Spectrum(NamedTuple):
    """The first eigenpairs of -Laplace phi = lambda phi on a mesh."""

    points: FloatArray  # (V, 3) vertices, in the mesh's frame and unit
    eigenvalues: FloatArray  # (K,) ascending, per squared diameter
    functions: FloatArray  # (V, K) of unit norm under the mesh's area in squared diameters


def spectrum_of(vertices: FloatArray, faces: IntArray, diameter: float, num_modes: int) -> Spectrum:
    """The eigenpairs of a mesh (more vertices than modes), its lengths measured in diameters.

    Raises:
        scipy.sparse.linalg.ArpackError: If the eigenproblem is not solved.
    """
    unit = (vertices - vertices.mean(axis=0)) / diameter
    eigenvalues, functions = eigenpairs(unit, faces, num_modes)
    return Spectrum(points=vertices, eigenvalues=eigenvalues, functions=functions)


def values_at(values: FloatArray, vertices: FloatArray, points: FloatArray) -> FloatArray:
    """Values (N, C) at points: means of the nearest three vertices, by the inverse distance."""
    distance, nearest = KDTree(vertices).query(points, k=_NUM_NEAREST)
    weights = 1.0 / np.maximum(distance, 1e-9 * np.ptp(vertices, axis=0).max())
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("nk,nkc->nc", weights, values[nearest])
