"""Scans as depth images, so that what a sensor does to pixels can be done to scans."""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.scan import RangeScan

JUMP_DIAMETERS = 0.03
"""Depth step that counts as a jump between two surfaces."""


def depth_of(scan: RangeScan) -> FloatArray:
    """Depth (H, W) of a scan in its sensor's frame, NaN where nothing was seen."""
    assert scan.grid is not None
    return np.where(scan.grid >= 0, scan.points[scan.grid, 2], np.nan)


def with_depth(scan: RangeScan, depth: FloatArray) -> RangeScan:
    """The scan with other depths (H, W), NaN for none."""
    assert scan.camera is not None
    seen = np.isfinite(depth)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[seen] = np.arange(int(seen.sum()))
    points = scan.camera.unproject_image(depth)[seen]
    return replace(scan, points=points, grid=grid, colors=None)


def points_in(scan: RangeScan, pixels: BoolArray) -> BoolArray:
    """Which points (N,) some pixels (H, W) saw."""
    assert scan.grid is not None
    is_in = np.zeros(len(scan.points), dtype=bool)
    is_in[scan.grid[pixels & (scan.grid >= 0)]] = True
    return is_in


def only_pixels(scan: RangeScan, kept: BoolArray) -> RangeScan:
    """The scan with what some pixels (H, W) saw only."""
    return scan.only(points_in(scan, kept))


def silhouette(depth: FloatArray) -> BoolArray:
    """Pixels (H, W) of the surface: a lost return is a gap in it, not a look past it."""
    return np.asarray(ndimage.binary_closing(np.isfinite(depth), np.ones((3, 3))), dtype=bool)


def smooth_field(shape: tuple[int, ...], width: float, rng: np.random.Generator) -> FloatArray:
    """Values with mean 0 and variance 1 that change over about ``width`` pixels."""
    field = ndimage.gaussian_filter(rng.normal(size=shape), width)
    return (field - field.mean()) / field.std()
