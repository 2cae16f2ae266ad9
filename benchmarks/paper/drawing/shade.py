"""Ambient occlusion in the picture: how much of the sky reaches each pixel's surface."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scanweld.geometry.arrays import BoolArray, FloatArray

_NUM_DIRECTIONS = 10
_REACH = 0.09
"""How far away something still takes light, as a share of the picture's longer side."""
_NUM_STEPS = 5
_STRENGTH = 1.15
_SOFTEN = 1.2


def ambient_occlusion(depth: FloatArray, pixels_per_unit: float) -> FloatArray:
    """Share (H, W) of the sky that is open over a depth image (H, W), NaN where nothing is.

    In each of several directions the horizon is the steepest rise within reach, the less steep the
    farther it is (after Bavoil et al. 2008).
    """
    reach = _REACH * max(depth.shape)
    radii = np.unique(np.rint(np.geomspace(1.5, reach, _NUM_STEPS)).astype(int))
    farthest = np.nanmax(depth, initial=0.0)
    height = np.where(np.isfinite(depth), farthest - depth, -np.inf) * pixels_per_unit
    bounds = _around(np.isfinite(depth))
    closed = np.zeros(depth.shape, dtype=np.float32)
    padded = np.pad(height.astype(np.float32), int(reach) + 1, constant_values=-np.inf)
    for k in range(_NUM_DIRECTIONS):
        angle = 2 * np.pi * (k + 0.5) / _NUM_DIRECTIONS
        steps = [(round(r * float(np.cos(angle))), round(r * float(np.sin(angle)))) for r in radii]
        closed[bounds] += _horizon(padded, bounds, steps, reach)
    share = np.clip(1 - _STRENGTH * closed / _NUM_DIRECTIONS, 0.0, 1.0)
    return ndimage.gaussian_filter(share.astype(np.float64), _SOFTEN)


def _horizon(
    padded: NDArray[np.float32],
    bounds: tuple[slice, slice],
    steps: Sequence[tuple[int, int]],
    reach: float,
) -> NDArray[np.float32]:
    """Sine of the angle by which the highest neighbour in a direction rises, within bounds."""
    border = int(reach) + 1
    rows, columns = bounds

    def at(dx: int, dy: int) -> NDArray[np.float32]:
        return padded[
            rows.start + border + dy : rows.stop + border + dy,
            columns.start + border + dx : columns.stop + border + dx,
        ]

    here = np.maximum(at(0, 0), 0)
    highest = np.zeros(here.shape, dtype=np.float32)
    for dx, dy in steps:
        rise = np.maximum(at(dx, dy) - here, 0)
        length = np.float32(np.hypot(dx, dy))
        slant = np.sqrt(rise * rise + length * length)
        # What rises much more than it is near stands in front and is no wall of the same valley.
        near = np.maximum(1 - slant / np.float32(2.5 * reach), 0)
        fade = np.float32(1 - 0.5 * length / reach)
        np.maximum(highest, rise / slant * near * fade, out=highest)
    return highest


def _around(is_there: BoolArray) -> tuple[slice, slice]:
    """The box of what is there."""
    rows, columns = (np.flatnonzero(is_there.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
