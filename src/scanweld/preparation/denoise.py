"""Range images of poor scans: noise smoothed, outliers dropped and lost returns filled.

Each pixel takes the depth of a plane that fits its neighbours on the same surface, robustly: a
surface moves by less than its noise, and steps between surfaces stay.
"""

from math import comb

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import MAD_TO_SIGMA

CLEAN_NOISE_PIXELS = 0.15
"""Noise of depth, in footprints, below which an image is not smoothed: its normals are good."""
MIN_BRIDGES = 2
"""An empty pixel with so many pairs of opposite neighbours, of four, is a pinhole."""
MAX_PINHOLE_SHARE = 0.05
"""Pinholes, as a share of the surface's pixels, up to which a scan needs no filling."""
MAX_RADIUS = 4
"""Largest radius of a neighbourhood, in pixels."""
NORMAL_ERROR = 0.05
"""Slope error of the fitted planes, by noise, that the radius of a neighbourhood aims at."""
NUM_ROUNDS = 4
"""Rounds of reweighting of a plane, from steps that a surface may have to the noise alone."""
NOISE_REACH = 2.5
"""Depths farther than so many standard deviations from a plane hardly belong to it."""
MIN_PLANE_SHARE = 0.25
"""Share of a neighbourhood that must lie on its plane; at a corner it is a quarter."""
MIN_FILL_SHARE = 0.4
"""The same for a pixel that has no depth of its own, or one off the plane,"""
MAX_FILL_OFFSET = 0.3
"""whose neighbours must lie all around it: their mean is no farther off, in radii."""


def clean_depth(
    depth: FloatArray,
    pixel: float,
    max_step: float,
    max_noise_pixels: float = CLEAN_NOISE_PIXELS,
) -> FloatArray:
    """A depth image without noise, outliers and small gaps, where it has more than a good scan.

    Args:
        depth: (H, W), NaN where there is no surface.
        pixel: Footprint of a pixel, in the scans' unit.
        max_step: Depth step between neighbours above which they are two surfaces.
        max_noise_pixels: Noise, in footprints, up to which a scan is a good one.

    Returns:
        (H, W) depth; as given where the scan is good.
    """
    sigma = noise_of(depth)
    if sigma < max_noise_pixels * pixel and not has_gaps(depth):
        return depth
    radius = smoothing_radius(sigma / pixel)
    # Where there is little noise, surfaces still leave the plane by a pixel: they curve.
    reach = max(NOISE_REACH * sigma, pixel)
    return _fit_planes(np.ascontiguousarray(depth), radius, max(max_step, reach), reach)


def noise_of(depth: FloatArray) -> float:
    """Standard deviation of depth (H, W) by its differences along rows and columns, robust.

    Second differences see curvature as noise; fourth ones do not, where there are enough.
    """
    second, num_second = _noise_by_differences(depth, 2)
    fourth, num_fourth = _noise_by_differences(depth, 4)
    return min(second, fourth) if num_fourth > num_second / 2 else second


def _noise_by_differences(depth: FloatArray, order: int) -> tuple[float, int]:
    steps = np.concatenate([np.diff(depth, order, axis=axis).ravel() for axis in (0, 1)])
    steps = np.abs(steps[np.isfinite(steps)])
    growth = np.sqrt(comb(2 * order, order))
    return float(MAD_TO_SIGMA * np.median(steps) / growth) if len(steps) else 0.0, len(steps)


def has_gaps(depth: FloatArray) -> bool:
    """Whether the surface of a depth image (H, W) has more pinholes than a good scan's."""
    seen = np.isfinite(depth)
    padded = np.pad(seen, 1)
    height, width = seen.shape
    bridges = np.zeros(seen.shape, dtype=np.int64)
    for y, x in ((0, 1), (1, 0), (1, 1), (1, -1)):
        before = padded[1 - y : 1 - y + height, 1 - x : 1 - x + width]
        bridges += before & padded[1 + y : 1 + y + height, 1 + x : 1 + x + width]
    pinholes = ~seen & (bridges >= MIN_BRIDGES)
    return bool(pinholes.sum() > MAX_PINHOLE_SHARE * seen.sum())


def smoothing_radius(noise_pixels: float) -> int:
    """Radius, in pixels, of the neighbourhoods whose planes are good to ``NORMAL_ERROR``."""
    for radius in range(2, MAX_RADIUS):
        spread = (2 * radius + 1) ** 2 * radius * (radius + 1) / 3
        if noise_pixels / np.sqrt(spread) <= NORMAL_ERROR:
            return radius
    return MAX_RADIUS


@njit(cache=True, nogil=True)
def _fit_planes(
    depth: FloatArray, radius: int, first_reach: float, last_reach: float
) -> FloatArray:
    """Depth (H, W) of a plane fitted to the neighbours of each pixel, NaN where none holds."""
    height, width = depth.shape
    fitted = np.full((height, width), np.nan)
    for row in range(height):
        for column in range(width):
            own = depth[row, column]
            value, share, offset = np.nan, 0.0, 1.0
            if np.isfinite(own):
                value, share, offset = _plane_at(
                    depth, row, column, own, radius, first_reach, last_reach
                )
            is_own = share >= MIN_PLANE_SHARE and abs(value - own) <= 3.0 * last_reach
            if not is_own:
                start = _common_depth(depth, row, column, radius, first_reach)
                if np.isnan(start):
                    continue
                value, share, offset = _plane_at(
                    depth, row, column, start, radius, first_reach, last_reach
                )
                if share < MIN_FILL_SHARE or offset > MAX_FILL_OFFSET:
                    continue
            fitted[row, column] = value
    return fitted


@njit(cache=True, nogil=True)
def _common_depth(depth: FloatArray, row: int, column: int, radius: int, reach: float) -> float:
    """The neighbours' depth that most neighbours are near to, NaN without neighbours."""
    height, width = depth.shape
    best, best_count = np.nan, 0
    top, bottom = max(row - radius, 0), min(row + radius + 1, height)
    left, right = max(column - radius, 0), min(column + radius + 1, width)
    for y in range(top, bottom):
        for x in range(left, right):
            z = depth[y, x]
            if np.isnan(z):
                continue
            count = 0
            for v in range(top, bottom):
                for u in range(left, right):
                    if abs(depth[v, u] - z) <= reach:
                        count += 1
            if count > best_count:
                best, best_count = z, count
    return best


@njit(cache=True, nogil=True)
def _plane_at(
    depth: FloatArray,
    row: int,
    column: int,
    start: float,
    radius: int,
    first_reach: float,
    last_reach: float,
) -> tuple[float, float, float]:
    """Fit z = a + b x + c y to a pixel's neighbours, those near the plane counting most.

    Returns:
        Its depth at the pixel, the share of the neighbourhood that lies on it, and how far off
        the pixel the middle of that is, in radii.
    """
    height, width = depth.shape
    a, b, c = start, 0.0, 0.0
    total, mean_x, mean_y = 0.0, 0.0, 0.0
    reach = first_reach
    shrink = (last_reach / first_reach) ** (1.0 / (NUM_ROUNDS - 1))
    for _ in range(NUM_ROUNDS):
        s0 = sx = sy = sxx = sxy = syy = sz = sxz = syz = 0.0
        for y in range(max(-radius, -row), min(radius, height - 1 - row) + 1):
            for x in range(max(-radius, -column), min(radius, width - 1 - column) + 1):
                z = depth[row + y, column + x]
                if np.isnan(z):
                    continue
                off = (z - a - b * x - c * y) / reach
                if abs(off) > 1.5:
                    continue
                w = np.exp(-2.0 * off * off)
                s0 += w
                sx += w * x
                sy += w * y
                sxx += w * x * x
                sxy += w * x * y
                syy += w * y * y
                sz += w * z
                sxz += w * x * z
                syz += w * y * z
        if s0 < 3.0:
            return np.nan, 0.0, 1.0
        total, mean_x, mean_y = s0, sx / s0, sy / s0
        # Slopes with a slight pull to zero, which fixes them where the neighbours lie in a line.
        xx, yy = sxx - sx * mean_x + 0.5, syy - sy * mean_y + 0.5
        xy = sxy - sx * mean_y
        xz, yz = sxz - sz * mean_x, syz - sz * mean_y
        det = xx * yy - xy * xy
        b, c = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
        a = sz / s0 - b * mean_x - c * mean_y
        reach = max(reach * shrink, last_reach)
    share = total / (2 * radius + 1) ** 2
    return a, share, np.sqrt(mean_x * mean_x + mean_y * mean_y) / radius
