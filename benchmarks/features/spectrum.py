"""Eigenpairs of a mesh with the points they belong to: what spectral descriptors are made of."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import FloatArray, IntArray, frozen
from scanweld.heat.laplacian import eigenpairs

_NUM_NEAREST = 3


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Spectrum:
    """The first eigenpairs of -Laplace phi = lambda phi on a mesh.

    Attributes:
        points: (V, 3) vertices, in the mesh's frame and unit.
        eigenvalues: (K,) ascending, per squared diameter.
        functions: (V, K) of unit norm under the mesh's area in squared diameters.
    """

    points: FloatArray
    eigenvalues: FloatArray
    functions: FloatArray

    def __post_init__(self) -> None:
        v, k = len(self.points), len(self.eigenvalues)
        object.__setattr__(self, "points", frozen(self.points, np.float64, (v, 3)))
        object.__setattr__(self, "eigenvalues", frozen(self.eigenvalues, np.float64, (k,)))
        object.__setattr__(self, "functions", frozen(self.functions, np.float64, (v, k)))


def spectrum_of(vertices: FloatArray, faces: IntArray, diameter: float, num_modes: int) -> Spectrum:
    """The eigenpairs of a mesh whose lengths are measured in diameters.

    Args:
        vertices: (V, 3), more than modes.
        faces: (F, 3).
        diameter: Of the object, in the vertices' unit.
        num_modes: K, constant modes included.

    Raises:
        scipy.sparse.linalg.ArpackError: If the eigenproblem is not solved.
    """
    unit = (vertices - vertices.mean(axis=0)) / diameter
    eigenvalues, functions = eigenpairs(unit, faces, num_modes)
    return Spectrum(points=vertices, eigenvalues=eigenvalues, functions=functions)


def values_at(values: FloatArray, vertices: FloatArray, points: FloatArray) -> FloatArray:
    """Values (V, C) of vertices (V, 3), carried to points (N, 3) nearby: (N, C).

    Means over the nearest three vertices, weighted by the inverse distance.
    """
    distance, nearest = KDTree(vertices).query(points, k=_NUM_NEAREST)
    weights = 1.0 / np.maximum(distance, 1e-9 * np.ptp(vertices, axis=0).max())
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("nk,nkc->nc", weights, values[nearest])
