"""The parts of a robust Gauss-Newton step on a pose that all refinements share.

A step is a twist (6,): a rotation about a centre in radians, times the lever arm, then a
translation. Both parts are then lengths, so that they compare and one damping fits both.
"""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp

TUKEY = 4.685
"""Residuals above this many robust standard deviations have no weight (95 % efficiency)."""
MAD_TO_SIGMA = 1.4826
"""Standard deviation of normally distributed residuals over their median magnitude."""
DAMPING = 1e-6
"""Added to the diagonal, relative to its mean: what no match determines stays where it is."""
NEARLY_ALL_SIGMAS = 3.0
"""Standard deviations within which nearly all errors lie (99.7 %)."""
SIGNIFICANT_SIGMAS = 4.0
"""Standard deviations beyond which a difference is taken for real, not for noise (1 in 16,000)."""
TURN_SCALE = 3.0
"""A rotation in radians counts like a translation by the diameter over this, so that the two
compare: the points of a surface lie about a third of its diameter from its centre."""


def lever_arm(diameter: float) -> float:
    """The length that turns a rotation (radians) of an object of a diameter into a movement."""
    return diameter / TURN_SCALE


def jacobian(
    points: FloatArray, directions: FloatArray, centre: FloatArray, arm: float
) -> FloatArray:
    """Change (N, 6) of the distances of points (N, 3) along directions (N, 3) by a twist."""
    changes = np.empty((len(points), 6))
    _jacobian(points, directions, centre, arm, changes)
    return changes


@njit(cache=True, nogil=True)
def _jacobian(
    points: FloatArray, directions: FloatArray, centre: FloatArray, arm: float, changes: FloatArray
) -> None:  # pragma: no cover - compiled
    for n in range(len(points)):
        x, y, z = points[n, 0] - centre[0], points[n, 1] - centre[1], points[n, 2] - centre[2]
        a, b, c = directions[n, 0], directions[n, 1], directions[n, 2]
        changes[n, 0] = (y * c - z * b) / arm
        changes[n, 1] = (z * a - x * c) / arm
        changes[n, 2] = (x * b - y * a) / arm
        changes[n, 3], changes[n, 4], changes[n, 5] = a, b, c


def motion_of(twist: FloatArray, centre: FloatArray, arm: float) -> Pose:
    """The motion of a twist (6,) about a centre (3,), in the frame of both."""
    rotation = rotation_exp(twist[:3] / arm)
    return Pose(rotation=rotation, translation=centre + twist[3:] - rotation @ centre)


def damped(normal: FloatArray) -> FloatArray:
    """A normal matrix (K, K) with the damping added."""
    size = len(normal)
    return normal + DAMPING * np.trace(normal) / size * np.eye(size)


def spread_of(residuals: FloatArray, least: float) -> float:
    """Robust standard deviation of residuals (N,), by their median magnitude, but no less."""
    if not len(residuals):
        return least
    return max(MAD_TO_SIGMA * float(np.median(np.abs(residuals))), least)


def tukey_weights(residuals: FloatArray, spread: float) -> FloatArray:
    """Weights (N,) in [0, 1] of residuals (N,): Tukey's biweight."""
    ratio = np.minimum(np.abs(residuals) / (TUKEY * spread), 1.0)
    return (1.0 - ratio**2) ** 2
