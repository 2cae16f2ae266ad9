"""Lens distortion undone: the depth image that a pinhole would have seen."""

from collections.abc import Sequence

import numpy as np

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray
from scanweld.geometry.camera import Camera

_JUMP = 0.02
"""Share of the depth by which neighbours differ that are not of one surface."""


def undistorted(depth: FloatArray, camera: Camera, lens: Sequence[float]) -> FloatArray:
    """Depth image (H, W) of a pinhole, from that of the same camera behind a lens.

    Each pixel takes the depth of the place where the lens put it: between neighbours of one surface
    inversely interpolated, which is exact on planes, and else that of the nearest.

    Args:
        depth: (H, W), NaN where there is none.
        camera: Without the lens.
        lens: k1 k2 p1 p2 k3 k4 k5 k6 (Brown and Conrady, rational), as OpenCV takes them.
    """
    u, v, is_inside = _sources(camera, lens)
    nearest = depth[np.rint(v).astype(int), np.rint(u).astype(int)]
    left, top = np.floor(u).astype(int), np.floor(v).astype(int)
    right, below = np.minimum(left + 1, camera.width - 1), np.minimum(top + 1, camera.height - 1)
    corners = np.stack(
        [depth[top, left], depth[top, right], depth[below, left], depth[below, right]]
    )
    a, b = u - left, v - top
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
    is_smooth = corners.max(axis=0) <= (1 + _JUMP) * corners.min(axis=0)  # False where one is NaN
    between = 1.0 / (weights / corners).sum(axis=0)
    return np.where(is_inside, np.where(is_smooth, between, nearest), np.nan)


def undistorted_colors(colors: ByteArray, camera: Camera, lens: Sequence[float]) -> ByteArray:
    """The same of colours (H, W, 3), each pixel's that of the nearest place."""
    u, v, _ = _sources(camera, lens)
    return colors[np.rint(v).astype(int), np.rint(u).astype(int)]


def _sources(camera: Camera, lens: Sequence[float]) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Column and row (H, W) where the lens put each pixel, and whether that is in the image."""
    rows, columns = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    x, y = (columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy
    x, y = _through(x, y, lens)
    u, v = camera.fx * x + camera.cx, camera.fy * y + camera.cy
    is_inside = (u >= 0) & (v >= 0) & (u <= camera.width - 1) & (v <= camera.height - 1)
    u = np.clip(np.nan_to_num(u), 0, camera.width - 1)
    v = np.clip(np.nan_to_num(v), 0, camera.height - 1)
    return u, v, is_inside


def _through(x: FloatArray, y: FloatArray, lens: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """Where a lens puts directions (x/z, y/z); NaN where it folds the image back."""
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    square = x * x + y * y
    above = 1 + square * (k1 + square * (k2 + square * k3))
    below = 1 + square * (k4 + square * (k5 + square * k6))
    radial = above / below
    slope = (k1 + square * (2 * k2 + square * 3 * k3)) / below - above / below**2 * (
        k4 + square * (2 * k5 + square * 3 * k6)
    )
    radial = np.where(radial + 2 * square * slope > 0, radial, np.nan)
    return (
        x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
        y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
    )
