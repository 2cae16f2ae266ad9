"""Which of many scored poses are distinct: non-maximum suppression on rigid motions."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray, IntArray


@njit(cache=True, nogil=True)
def distinct_poses(
    poses: FloatArray, centre_j: FloatArray, max_angle: float, max_shift: float, max_count: int
) -> IntArray:
    """Greedy choice of poses, best first, none near one chosen before.

    Args:
        poses: (N, 12) rows of i_from_j, best first.
        centre_j: (3,) point of j at which shifts are measured.
        max_angle: Two poses are near if they differ by less than this angle (radians)
        max_shift: and move the centre to places closer than this.
        max_count: How many are chosen at most.

    Returns:
        (K,) indices, best first.
    """
    cosine = np.cos(max_angle)
    n = poses.shape[0]
    moved = np.empty((n, 3))
    for p in range(n):
        for r in range(3):
            moved[p, r] = (
                poses[p, 3 * r] * centre_j[0]
                + poses[p, 3 * r + 1] * centre_j[1]
                + poses[p, 3 * r + 2] * centre_j[2]
                + poses[p, 9 + r]
            )
    chosen = np.empty(min(n, max_count), dtype=np.int64)
    count = 0
    for p in range(n):
        if count == max_count:
            break
        is_new = True
        for c in range(count):
            q = chosen[c]
            dx, dy, dz = (
                moved[p, 0] - moved[q, 0],
                moved[p, 1] - moved[q, 1],
                moved[p, 2] - moved[q, 2],
            )
            if dx * dx + dy * dy + dz * dz > max_shift * max_shift:
                continue
            trace = 0.0
            for k in range(9):
                trace += poses[p, k] * poses[q, k]
            if 0.5 * (trace - 1.0) > cosine:
                is_new = False
                break
        if is_new:
            chosen[count] = p
            count += 1
    return chosen[:count]
