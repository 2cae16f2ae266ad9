"""Compiled: a frame's pixels on the planes of a keyframe, and the motion that brings them nearer.

Matches are projective (Blais & Levine 1995) and their errors point to plane (Chen & Medioni 1991),
as in KinectFusion. Each error is divided by what the noise of its depth makes of it, and weighted
by Tukey's biweight, which at first is as wide as the reach of the matches: where a table fills most
of the frame, and fits at once, what stands on it would else be an outlier before it has moved.
"""

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.step import move, solve_damped
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import MAD_TO_SIGMA, SIGNIFICANT_SIGMAS, TUKEY

OFF_GRID_PIXELS = 0.3
"""Standard deviation of where in its pixel a depth was seen, across the line of sight."""
NOTHING, FRONT, BEHIND = -1, -2, -3
"""Instead of the keyframe's pixel that a frame's pixel lies on: outside of the image or where it
has no depth; in front of its surface, or behind it."""
LEAST_SPREAD = 0.5
"""Errors, in standard deviations of single depths, that are as good as none: halved images have
less noise where neighbours err independently."""
MIN_MATCHES = 100
"""With fewer matches a frame stays where it is."""
SETTLED = 1e-5
"""A step this small, as a share of the distance, is the last one."""


@njit(cache=True, nogil=True)
def matches(
    depth: FloatArray,
    planes: FloatArray,
    camera: FloatArray,
    pose: FloatArray,
    noise: FloatArray,
    reach: float,
    hits: NDArray[np.int32],
    errors: FloatArray,
    sigmas: FloatArray,
) -> None:  # pragma: no cover - compiled
    """Lay a frame's pixels onto a keyframe's planes.

    Args:
        depth: (H, W) of the frame, NaN for none.
        planes: (H, W, 4) of the keyframe, see ``planes_of``.
        camera: (5,) parameters of both.
        pose: (12,) row of keyframe_from_frame.
        noise: (2,) terms of single depths.
        reach: Share of the depth up to which a pixel lies on a plane, besides the noise.
        hits: (H, W) to be filled with flat indices of the keyframe's pixels, or what was met.
        errors: (H, W) to be filled with signed distances to the planes,
        sigmas: and with their standard deviations.
    """
    fx, fy, cx, cy = camera[1], camera[2], camera[3], camera[4]
    rows, columns = depth.shape
    for v, u in np.ndindex((rows, columns)):
        hits[v, u] = NOTHING
        z = depth[v, u]
        if not z > 0.0:
            continue
        x, y = (u - cx) / fx, (v - cy) / fy
        rx = pose[0] * x + pose[1] * y + pose[2]
        ry = pose[3] * x + pose[4] * y + pose[5]
        rz = pose[6] * x + pose[7] * y + pose[8]
        qx, qy, qz = z * rx + pose[9], z * ry + pose[10], z * rz + pose[11]
        if qz <= 0.0:
            continue
        i, j = int(np.rint(fx * qx / qz + cx)), int(np.rint(fy * qy / qz + cy))
        if i < 0 or j < 0 or i >= columns or j >= rows:
            continue
        a, b, c = planes[j, i, 0], planes[j, i, 1], planes[j, i, 2]
        length = np.sqrt(a * a + b * b + c * c)
        if not length > 0.0:
            continue
        error = (a * qx + b * qy + c * qz - 1.0) / length
        cosine = abs(a * rx + b * ry + c * rz) / length
        ray = np.sqrt(x * x + y * y + 1.0)
        deviation = noise[0] + noise[1] * z * z
        slant = OFF_GRID_PIXELS * z / fx * np.sqrt(max(0.0, 1.0 - (cosine / ray) ** 2))
        sigma = np.sqrt((deviation * cosine) ** 2 + slant * slant)
        errors[v, u] = error
        sigmas[v, u] = sigma
        if abs(error) <= reach * z + SIGNIFICANT_SIGMAS * sigma:
            hits[v, u] = j * columns + i
        else:
            hits[v, u] = FRONT if error < 0.0 else BEHIND


@njit(cache=True, nogil=True)
def spread_of_matches(
    hits: NDArray[np.int32], errors: FloatArray, sigmas: FloatArray
) -> float:  # pragma: no cover - compiled
    """Robust standard deviation of the errors of matches in units of their own; NaN if few.

    It is ``LEAST_SPREAD`` at least, else what fits by chance would outweigh all the rest.
    """
    ratios, count = np.empty(hits.size), 0
    for v, u in np.ndindex(hits.shape):
        if hits[v, u] >= 0:
            ratios[count] = abs(errors[v, u]) / sigmas[v, u]
            count += 1
    if count < MIN_MATCHES:
        return np.nan
    return max(MAD_TO_SIGMA * np.median(ratios[:count]), LEAST_SPREAD)


@njit(cache=True, nogil=True)
def accumulate(
    depth: FloatArray,
    planes: FloatArray,
    camera: FloatArray,
    pose: FloatArray,
    hits: NDArray[np.int32],
    errors: FloatArray,
    sigmas: FloatArray,
    spread: float,
    width: float,
    centre: FloatArray,
    turn_scale: float,
    h: FloatArray,
    g: FloatArray,
) -> None:  # pragma: no cover - compiled
    """Weighted normal equations h x = -g of the matches, of a turn about a centre and a shift."""
    h[:], g[:] = 0.0, 0.0
    jac, columns = np.empty(6), depth.shape[1]
    for v, u in np.ndindex(depth.shape):
        if hits[v, u] < 0:
            continue
        ratio = errors[v, u] / (TUKEY * spread * sigmas[v, u] + width * depth[v, u])
        if abs(ratio) >= 1.0:
            continue
        weight = ((1.0 - ratio * ratio) / sigmas[v, u]) ** 2
        j, i = hits[v, u] // columns, hits[v, u] % columns
        a, b, c = planes[j, i, 0], planes[j, i, 1], planes[j, i, 2]
        length = np.sqrt(a * a + b * b + c * c)
        a, b, c = a / length, b / length, c / length
        z = depth[v, u]
        x, y = z * (u - camera[3]) / camera[1], z * (v - camera[4]) / camera[2]
        qx = pose[0] * x + pose[1] * y + pose[2] * z + pose[9] - centre[0]
        qy = pose[3] * x + pose[4] * y + pose[5] * z + pose[10] - centre[1]
        qz = pose[6] * x + pose[7] * y + pose[8] * z + pose[11] - centre[2]
        jac[0] = turn_scale * (qy * c - qz * b)
        jac[1] = turn_scale * (qz * a - qx * c)
        jac[2] = turn_scale * (qx * b - qy * a)
        jac[3], jac[4], jac[5] = a, b, c
        for r in range(6):
            g[r] += weight * jac[r] * errors[v, u]
            for k in range(r + 1):
                h[r, k] += weight * jac[r] * jac[k]
    for r in range(6):
        for k in range(r):
            h[k, r] = h[r, k]


@njit(cache=True, nogil=True)
def settle(
    depth: FloatArray,
    planes: FloatArray,
    camera: FloatArray,
    pose: FloatArray,
    noise: FloatArray,
    reaches: FloatArray,
    widths: FloatArray,
    centre: FloatArray,
    turn_scale: float,
    damping: float,
    hits: NDArray[np.int32],
    errors: FloatArray,
    sigmas: FloatArray,
) -> float:  # pragma: no cover - compiled
    """Move a pose row in place until its matches are nearest, and match once more.

    Args:
        depth: (H, W) of the frame.
        planes: (H, W, 4) of the keyframe.
        camera: (5,) parameters of both.
        pose: (12,) row of keyframe_from_frame.
        noise: (2,) terms of single depths.
        reaches: Of the matches in each round, as shares of the depth.
        widths: Added to those of the biweight, likewise.
        centre: (3,) of the turns, in the keyframe's frame.
        turn_scale: Radians for a step of one.
        damping: Of motions away from the pose as it is given, relative to the mean diagonal.
        hits: (H, W) filled by ``matches``,
        errors: likewise,
        sigmas: likewise.

    Returns:
        The robust standard deviation of the errors in units of their own; NaN with few matches.
    """
    h, g, moved = np.empty((6, 6)), np.empty(6), np.zeros(6)
    far = np.sqrt((centre * centre).sum())
    for k in range(len(reaches)):
        matches(depth, planes, camera, pose, noise, reaches[k], hits, errors, sigmas)
        spread = spread_of_matches(hits, errors, sigmas)
        if not spread > 0.0:
            break
        accumulate(
            depth,
            planes,
            camera,
            pose,
            hits,
            errors,
            sigmas,
            spread,
            widths[k],
            centre,
            turn_scale,
            h,
            g,
        )
        g += damping * np.trace(h) / 6 * moved
        if not solve_damped(h, g, damping):
            break
        moved += g
        move(pose, g, centre, turn_scale)
        if np.sqrt((g * g).sum()) < SETTLED * far:
            break
    matches(depth, planes, camera, pose, noise, reaches[-1], hits, errors, sigmas)
    return spread_of_matches(hits, errors, sigmas)
