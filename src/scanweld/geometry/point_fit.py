"""Rigid fits of matched points, and how many of the matches to trust."""

from typing import Literal

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, nearest_rotation

Trim = float | Literal["auto"] | None
"""Share of the closest matches that is kept, found anew each time ("auto"), or all (None)."""

FRACTION_EXPONENT = 1.3
"""How much a larger share of matches is worth, against a smaller rms."""
MIN_SHARE = 0.3
"""Smallest share of the matches that "auto" keeps."""


def rigid_fit(moving: FloatArray, target: FloatArray) -> Pose:
    """The motion that brings points (N, 3) closest to others (N, 3), in least squares (Kabsch)."""
    a, b = moving.mean(axis=0), target.mean(axis=0)
    rotation = nearest_rotation((target - b).T @ (moving - a))
    return Pose(rotation=rotation, translation=b - rotation @ a)


def num_trusted(squares: FloatArray, trim: Trim) -> int:
    """How many of the smallest squared distances (N,), ascending, a fit should go by.

    A share is rounded up. "auto" takes the least rms / share^lambda (fractional ICP, Phillips et
    al. 2007).
    """
    if trim is None:
        return len(squares)
    if trim != "auto":
        return int(np.ceil(trim * len(squares)))
    counts = np.arange(1, len(squares) + 1)
    shares = counts / max(len(squares), 1)
    fractional = np.sqrt(np.cumsum(squares) / counts) / shares**FRACTION_EXPONENT
    least = int(np.ceil(MIN_SHARE * len(squares)))
    return least + int(np.argmin(fractional[least - 1 :])) if len(squares) else 0
