"""Unit directions spread evenly over the sphere, or over a part of it."""

import numpy as np

from scanweld.geometry.arrays import FloatArray


def golden_spiral(heights: FloatArray) -> FloatArray:
    """Unit directions (N, 3) at the heights z (N,), each turned on by the golden angle.

    Evenly spaced heights in [-1, 1] give directions spread evenly over the sphere, because the area
    of a sphere between two heights is proportional to their difference.
    """
    turn = (np.arange(len(heights)) + 0.5) * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - heights * heights)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), heights], axis=1)
