"""What real depth sensors do, each by itself, to scans with a grid and a camera.

Lengths are given in diameters of what the scan shows. The sensor's place, and with it the truth,
stays as it is.
"""

import numpy as np
from scipy import ndimage
from scipy.special import ndtr

from benchmarks.virtual.bodies import Rng
from benchmarks.virtual.depth_images import (
    JUMP_DIAMETERS,
    depth_of,
    only_pixels,
    silhouette,
    smooth_field,
    with_depth,
)
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.scan import RangeScan, principal_diameter

NUM_WAVES = 12
"""Waves that are summed to an error that is nowhere the same."""
EDGE_PIXELS = 8.0
"""Over so many pixels the width changes by which an edge is eaten."""


def depth_waves(
    scan: RangeScan,
    rng: Rng,
    *,
    length_diameters: float,
    rms_diameters: float = 0.0,
    of_depth: float = 0.0,
) -> RangeScan:
    """Depth off by waves across the image and along the line of sight: neighbours err alike.

    Args:
        scan: With a grid and a camera.
        rng: Of the waves.
        length_diameters: Of the shortest wave; the longest is twice as long.
        rms_diameters: Root mean square of the error, where it does not grow with depth.
        of_depth: The same as a share of depth, where it does.
    """
    depth, size = depth_of(scan), principal_diameter(scan.points)
    seen = np.isfinite(depth)
    assert scan.grid is not None
    phases = scan.points[scan.grid[seen]] @ _waves(length_diameters * size, rng).T
    waves = np.sin(phases + rng.uniform(0, 2 * np.pi, size=NUM_WAVES)).sum(axis=1)
    waves /= np.sqrt(np.mean(waves**2))
    depth[seen] += (rms_diameters * size + of_depth * depth[seen]) * waves
    return with_depth(scan, depth)


def quantised(scan: RangeScan, rng: Rng, *, step_diameters: float) -> RangeScan:
    """Depth in steps, as in a file of whole millimetres."""
    step = step_diameters * principal_diameter(scan.points)
    return with_depth(scan, step * np.round(depth_of(scan) / step))


def eaten_edges(scan: RangeScan, rng: Rng, *, least: float, most: float) -> RangeScan:
    """No return from pixels beside the silhouette or a jump, in a band that is as wide."""
    depth = depth_of(scan)
    # Steep is no jump: the step to the next pixel differs from the one before.
    bends = [np.abs(ndimage.convolve1d(depth, [1.0, -2.0, 1.0], axis=axis)) for axis in (0, 1)]
    is_jump = np.fmax(*bends) > JUMP_DIAMETERS * principal_diameter(scan.points)
    # Beyond the image's border nothing was seen.
    inside = np.pad(silhouette(depth) & ~is_jump, 1)
    inwards = np.asarray(ndimage.distance_transform_edt(inside))[1:-1, 1:-1]
    width = least + (most - least) * ndtr(smooth_field(depth.shape, EDGE_PIXELS, rng))
    return only_pixels(scan, inwards > width)


def stereo_shadow(scan: RangeScan, rng: Rng, *, baseline_diameters: float) -> RangeScan:
    """No return from what a second camera, to the right of the first, does not see.

    That is a band beside every near surface, on its left. A surface is hidden from the second
    camera where something further to the right in the first image comes to lie left of it.
    """
    assert scan.camera is not None
    depth = depth_of(scan)
    baseline = baseline_diameters * principal_diameter(scan.points)
    columns = np.arange(depth.shape[1]) - scan.camera.fx * baseline / depth
    column = np.where(np.isfinite(depth), columns, np.inf)
    leftmost = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    return only_pixels(scan, column <= leftmost)


def without_grazing(scan: RangeScan, rng: Rng, *, max_incidence_deg: float) -> RangeScan:
    """No return from surfaces that are seen at a larger angle from their normal."""
    assert scan.camera is not None
    points = scan.camera.unproject_image(depth_of(scan))
    down, right = np.gradient(_smoothed(points), axis=(0, 1))
    normals = np.cross(down, right)
    rays = scan.camera.view_directions(points)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.abs(np.sum(normals * rays, axis=-1)) / np.linalg.norm(normals, axis=-1)
        return only_pixels(scan, cosine >= np.cos(np.radians(max_incidence_deg)))


def _waves(length: float, rng: Rng) -> FloatArray:
    """Wave vectors (NUM_WAVES, 3) in all directions, radians per unit."""
    ways = rng.normal(size=(NUM_WAVES, 3))
    lengths = length * rng.uniform(1, 2, size=(NUM_WAVES, 1))
    return 2 * np.pi * ways / np.linalg.norm(ways, axis=1, keepdims=True) / lengths


def _smoothed(points: FloatArray) -> FloatArray:
    """Points (H, W, 3) averaged over the pixels around them that saw something."""
    seen = np.isfinite(points[..., :1])
    width = (1.5, 1.5, 0.0)
    total = ndimage.gaussian_filter(np.where(seen, points, 0.0), width)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(seen, total / ndimage.gaussian_filter(seen.astype(float), width), np.nan)
