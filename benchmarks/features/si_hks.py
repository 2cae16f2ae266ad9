"""The scale-invariant heat kernel signature (Bronstein & Kokkinos, CVPR 2010)."""

import numpy as np

from scanweld.geometry.arrays import FloatArray

_STEPS_PER_OCTAVE = 16
"""Bronstein & Kokkinos sample tau at 1/16."""


def octave_times(shortest: float, longest: float) -> FloatArray:
    """Times 2^tau (T,) from the shortest to the longest at most, with tau in steps of 1/16."""
    num_steps = int(_STEPS_PER_OCTAVE * np.log2(longest / shortest) + 1e-9)
    return shortest * 2.0 ** (np.arange(num_steps + 1) / _STEPS_PER_OCTAVE)


def si_heat_signature(
    eigenvalues: FloatArray, functions: FloatArray, times: FloatArray, num_frequencies: int = 6
) -> FloatArray:
    """Magnitudes |F_w d/dtau log h(x, 2^tau)| of the lowest frequencies w: (V, F).

    h(x, t) = sum_i exp(-lambda_i t) phi_i(x)^2, constant modes included. An object that is b times
    as large has h'(x, t) = h(x, t / b^2) / b^2: the logarithm turns the factor into a summand, the
    derivative removes it, and the magnitude of the Fourier transform over tau = log2 t removes the
    shift (Bronstein & Kokkinos 2010, section 3). The window of times must be wide enough for the
    derivative to vanish at its ends.
    """
    rate = np.outer(eigenvalues, times)
    decay = np.exp(-rate)
    squares = functions**2
    heat = squares @ decay
    slope = -np.log(2.0) * (squares @ (rate * decay)) / np.maximum(heat, np.finfo(float).tiny)
    return np.abs(np.fft.rfft(slope, axis=1))[:, :num_frequencies] / len(times)
