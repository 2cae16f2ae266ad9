"""The heat kernel signature of a mesh (paper 3.1; Sun et al. 2009)."""

import numpy as np

from scanweld.geometry.arrays import FloatArray

_CONSTANT = 1e-6
"""Eigenvalues below this, for a mesh of unit size, belong to functions constant on each piece."""
_LEAST_HEAT = 1e-9
"""Least heat, before the logarithm: pieces too small for a mode would show rounding errors."""


def diffusion_times(eigenvalues: FloatArray, num_times: int, longest: float) -> FloatArray:
    """Times (T,), log-spaced from the shortest that the eigenvalues resolve, 4 / lambda_k.

    Shorter times would show truncation noise. If even ``longest`` is too short, all lie above it.
    """
    shortest = 4.0 / eigenvalues[-1]
    return np.geomspace(shortest, max(longest, 2.0 * shortest), num_times)


def sun_times(eigenvalues: FloatArray, num_times: int) -> FloatArray:
    """Times (T,) of Sun et al. 2009, log-spaced from 4 ln 10 / lambda_k to 4 ln 10 / lambda_2.

    lambda_2 is the first eigenvalue that is not zero.
    """
    first = eigenvalues[eigenvalues > _CONSTANT][0]
    return 4.0 * np.log(10.0) / np.geomspace(eigenvalues[-1], first, num_times)


def heat_signature(eigenvalues: FloatArray, functions: FloatArray, times: FloatArray) -> FloatArray:
    """Log of sum_i exp(-lambda_i t) phi_i(x)^2 over the heat trace sum_i exp(-lambda_i t): (V, T).

    The constant modes are skipped. (The paper prints exp(+lambda_i t) and a sum over t.)
    """
    varies = eigenvalues > _CONSTANT
    decay = np.exp(-np.outer(eigenvalues[varies], times))
    heat = functions[:, varies] ** 2 @ decay
    return np.log(np.maximum(heat / decay.sum(axis=0), _LEAST_HEAT))
