"""What people cut off their scans by hand, each by itself: another part of every scan."""

import numpy as np

from benchmarks.virtual.bodies import Rng
from benchmarks.virtual.depth_images import depth_of, only_pixels
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import random_rotation
from scanweld.geometry.scan import RangeScan, principal_diameter

NUM_BENDS, BEND = 5, 0.2
"""Waves of a curve drawn by hand, and how far the first goes in and out, as a share of its radius;
the others go less far the shorter they are."""
STRETCH = (0.8, 1.25)
"""Sides of a box, in standard deviations along them."""


def trimmed_along_curve(scan: RangeScan, rng: Rng, *, share: float) -> RangeScan:
    """So much is kept of the image inside of a closed curve, drawn by hand around the middle."""
    seen = np.isfinite(depth_of(scan))
    pixels = np.argwhere(seen).astype(float)
    aside = (pixels - pixels.mean(axis=0)) / pixels.std(axis=0)
    turn, bends = np.arctan2(*aside.T), np.arange(1, NUM_BENDS + 1)
    heights = rng.uniform(-BEND, BEND, size=NUM_BENDS) / np.sqrt(bends)
    phases = rng.uniform(0, 2 * np.pi, size=NUM_BENDS)
    curve = 1.0 + np.cos(turn[:, None] * bends + phases) @ heights
    kept = np.zeros_like(seen)
    kept[seen] = _innermost(np.linalg.norm(aside, axis=1) / curve, share)
    return only_pixels(scan, kept)


def boxed(scan: RangeScan, rng: Rng, *, share: float) -> RangeScan:
    """So much is kept inside of a box, turned anyhow."""
    aside = (scan.points - np.median(scan.points, axis=0)) @ random_rotation(rng)
    sides = aside.std(axis=0) * rng.uniform(*STRETCH, size=3)
    return scan.only(_innermost(np.abs(aside / sides).max(axis=1), share))


def with_holes(scan: RangeScan, rng: Rng, *, count: float, radius_diameters: float) -> RangeScan:
    """Round holes at random places of the surface, as where stains or markers were taken out."""
    radius = radius_diameters * principal_diameter(scan.points)
    spots = scan.points[rng.integers(len(scan.points), size=round(count))]
    away = np.linalg.norm(scan.points[:, None] - spots, axis=2).min(axis=1, initial=np.inf)
    return scan.only(away > radius)


def _innermost(away: FloatArray, share: float) -> BoolArray:
    """Which (N,) are the nearest, by a measure (N,) of how far out they are."""
    return away <= np.quantile(away, share)
