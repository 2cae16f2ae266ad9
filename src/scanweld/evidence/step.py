"""A damped Gauss-Newton step on a pose row (12,), compiled: thousands of poses take many each."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray

DAMPING = 1e-3
"""Share of the mean diagonal that is added to the normal equations."""


@njit(cache=True, nogil=True)
def solve_damped(h: FloatArray, g: FloatArray, damping: float = DAMPING) -> bool:
    """Solve (h + damping) x = -g by Cholesky in place; g becomes x. False if h is not positive."""
    mean = 0.0
    for r in range(6):
        mean += h[r, r] / 6
    for r in range(6):
        h[r, r] += damping * mean
    for r in range(6):
        for c in range(r + 1):
            total = h[r, c]
            for k in range(c):
                total -= h[r, k] * h[c, k]
            if r > c:
                h[r, c] = total / h[c, c]
            elif total <= 0.0:
                return False
            else:
                h[r, r] = np.sqrt(total)
    for r in range(6):
        g[r] = -g[r]
        for k in range(r):
            g[r] -= h[r, k] * g[k]
        g[r] /= h[r, r]
    for r in range(5, -1, -1):
        for k in range(r + 1, 6):
            g[r] -= h[k, r] * g[k]
        g[r] /= h[r, r]
    return True


@njit(cache=True, nogil=True)
def move(pose: FloatArray, step: FloatArray, centre: FloatArray, turn_scale: float) -> None:
    """Turn the pose about the centre by the step's scaled rotation vector, and shift it."""
    wx, wy, wz = step[0] * turn_scale, step[1] * turn_scale, step[2] * turn_scale
    angle2 = wx * wx + wy * wy + wz * wz
    # A unit quaternion keeps the rotation orthonormal to rounding, however large the step.
    scale = 1.0 / np.sqrt(1.0 + 0.25 * angle2)
    w, x, y, z = scale, 0.5 * wx * scale, 0.5 * wy * scale, 0.5 * wz * scale
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    old = pose.copy()
    for r in range(3):
        pose[9 + r] = centre[r] + step[3 + r]
        for k in range(3):
            pose[9 + r] += turn[r, k] * (old[9 + k] - centre[k])
            pose[3 * r + k] = (
                turn[r, 0] * old[k] + turn[r, 1] * old[3 + k] + turn[r, 2] * old[6 + k]
            )
