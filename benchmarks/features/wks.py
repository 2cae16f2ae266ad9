"""The wave kernel signature (Aubry, Schlickewei & Cremers, ICCV workshops 2011)."""

import numpy as np

from scanweld.geometry.arrays import FloatArray

_CONSTANT = 1e-6
"""Eigenvalues below this, for a mesh of unit size, belong to functions constant on each piece."""
_WIDTH_STEPS = 7
"""Width of the energy bands, in steps from one to the next (Aubry et al. 2011)."""


def energy_bands(eigenvalues: FloatArray, num_bands: int = 100) -> tuple[FloatArray, float]:
    """Logarithms of energies (E,), evenly spaced, and the width sigma of the bands around them.

    The bands keep 2 sigma from both ends of the spectrum, with sigma = 7 steps (Aubry et al. 2011).
    """
    varying = eigenvalues[eigenvalues > _CONSTANT]
    low, high = np.log(varying[0]), np.log(varying[-1])
    step = (high - low) / (num_bands - 1 + 4 * _WIDTH_STEPS)
    width = _WIDTH_STEPS * step
    return low + 2 * width + step * np.arange(num_bands), float(width)


def wave_signature(
    eigenvalues: FloatArray, functions: FloatArray, log_energies: FloatArray, width: float
) -> FloatArray:
    """WKS(x, e) = C_e sum_k phi_k(x)^2 exp(-(e - log lambda_k)^2 / (2 sigma^2)): (V, E).

    C_e = 1 / sum_k exp(-(e - log lambda_k)^2 / (2 sigma^2)), so that the signature at every energy
    integrates to one over the surface (Aubry et al. 2011). Constant modes are skipped.
    """
    varies = eigenvalues > _CONSTANT
    apart = (log_energies - np.log(eigenvalues[varies])[:, None]) / width
    weights = np.exp(-0.5 * apart**2)
    return functions[:, varies] ** 2 @ (weights / weights.sum(axis=0))


def wave_distances(one: FloatArray, other: FloatArray) -> FloatArray:
    """Sums (N, M) of |a - b| / (a + b) over the energies, as Aubry et al. compare signatures."""
    distances = np.empty((len(one), len(other)))
    for row, a in enumerate(one):
        total = np.maximum(a + other, np.finfo(float).tiny)
        distances[row] = (np.abs(a - other) / total).sum(axis=1)
    return distances
