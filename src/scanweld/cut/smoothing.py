"""What neighbouring pixels of a depth camera err alike, and what each errs alone."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray

FIELD_SHARE = 1 / 64
"""Width of the smoothing as a share of the image's: errors that are alike over centimetres are
followed by it, the object is not."""
BLOCK = 4
"""Pixels that are averaged before smoothing, which is much faster then."""
FAINT = 1e-2
"""Weight of a smoothing four times as wide: it counts only where the narrower one has no data."""
TRIMMED, TRIMMED_RMS = 0.8, 0.661
"""Share of the smallest deviations that noise is measured by, and their root mean square where the
deviations are normal with a standard deviation of 1."""
NUM_LEVELS = 8
"""Ranges of depth in which noise is measured."""
LEAST_NOISE = 2e-4
"""Noise of the best depth cameras as a share of the depth: none is taken for better."""


def smooth_field(values: FloatArray, is_used: BoolArray) -> FloatArray:
    """A smooth image (H, W) through some pixels' values (H, W), continued to all others."""
    from scipy import ndimage

    total, weight = _blocks(np.where(is_used, values, 0.0)), _blocks(is_used.astype(np.float64))
    width = FIELD_SHARE * values.shape[1] / BLOCK
    sums, weights = np.zeros_like(total), np.full_like(weight, np.finfo(np.float64).tiny)
    for level in range(3):
        sigma, faint = width * 4**level, FAINT**level
        sums += faint * ndimage.gaussian_filter(total, sigma, mode="constant")
        weights += faint * ndimage.gaussian_filter(weight, sigma, mode="constant")
    field = ndimage.zoom(sums / weights, BLOCK, order=1, mode="nearest", grid_mode=True)
    return np.asarray(field, dtype=np.float64)[: values.shape[0], : values.shape[1]]


def _blocks(image: FloatArray) -> FloatArray:
    """Sums over blocks of pixels; the image is filled up with zeros."""
    down, across = (-size % BLOCK for size in image.shape)
    padded = np.pad(image, ((0, down), (0, across)))
    rows, columns = (size // BLOCK for size in padded.shape)
    return padded.reshape(rows, BLOCK, columns, BLOCK).sum(axis=(1, 3))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Noise:
    """Noise of single pixels by depth.

    Attributes:
        depth: (L,) increasing,
        sigma: (L,) standard deviation there.
    """

    depth: FloatArray
    sigma: FloatArray

    def at(self, depth: FloatArray) -> FloatArray:
        """Standard deviation at depths of any shape; NaN where they are."""
        return np.interp(depth, self.depth, self.sigma)


def noise_of(deviations: FloatArray, depth: FloatArray) -> Noise:
    """Noise of deviations (N,) at depths (N,), whatever some of them are."""
    edges = np.quantile(depth, np.linspace(0, 1, NUM_LEVELS + 1))
    level = np.clip(np.searchsorted(edges, depth, side="right") - 1, 0, NUM_LEVELS - 1)
    parts = [np.flatnonzero(level == k) for k in range(NUM_LEVELS)]
    parts = [part for part in parts if len(part)]
    middle = np.array([np.median(depth[part]) for part in parts])
    sigma = np.array([trimmed_rms(deviations[part]) for part in parts])
    return Noise(depth=middle, sigma=np.maximum(sigma, LEAST_NOISE * middle))


def uneven(image: FloatArray) -> tuple[FloatArray, FloatArray]:
    """By how much single depths (H, W) err, and these: both (N,).

    On a smooth surface only noise is left of how a depth differs from the middle of its neighbours,
    and it has 3/2 of its variance. Differences at jumps are many times larger; ``noise_of`` leaves
    out the largest.
    """
    middle = image[:, 1:-1]
    difference = middle - 0.5 * (image[:, :-2] + image[:, 2:])
    is_smooth = np.isfinite(difference)
    return difference[is_smooth] / np.sqrt(1.5), middle[is_smooth]


def trimmed_rms(deviations: FloatArray) -> float:
    """Standard deviation about 0 of normal deviations (N,) of which a fifth may be anything."""
    size = np.abs(deviations)
    kept = size[size <= np.quantile(size, TRIMMED)]
    return float(np.sqrt(np.mean(kept**2)) / TRIMMED_RMS)
