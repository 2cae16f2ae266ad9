"""The sensors' noise, measured where placed scans overlap."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.optimize import nnls

from scanweld.fusion.posed_image import PosedImage
from scanweld.fusion.sampling import sample_surface
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import MAD_TO_SIGMA
from scanweld.work.threads import map_in_rows

logger = logging.getLogger(__name__)

MIN_COMMON = 50
"""Points that two scans must have in common to be compared."""
_FLOOR_PIXELS = 0.02
"""Least noise, in footprints of a pixel: normals and interpolation are no better."""
_RIDGE = 0.02
"""Weight of the assumption that all scans have the same noise, beside a pair of scans: it decides
where pairs do not."""
_MAX_PRECISION = 4.0
"""Most that a scan counts for, and least if inverted, beside the median scan."""
_GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of a sequence that fills the unit square evenly (Roberts 2018)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class _Comparison:
    """Which points of a scan are held against another one's surface.

    Attributes:
        num_points: About so many.
        reach_pixels: Points farther from that surface are not on it,
        min_cosine: nor are those that its sensor would see more obliquely (cosine).
    """

    num_points: int = 1500
    reach_pixels: float = 4.0
    min_cosine: float = 0.5


_COMPARED = _Comparison()


def with_noise(images: Sequence[PosedImage], workers: int = 1) -> list[PosedImage]:
    """The images with their noise, and the precision that follows from it.

    A weight tells how much is known of a patch of surface: the number of pixels on it over their
    variance. The median scan has a precision of 1.
    """
    noise = scan_noise(images, workers)
    pixel = np.array([image.pixel for image in images])
    precision = 1.0 / (noise * pixel) ** 2
    precision = np.clip(precision / np.median(precision), 1.0 / _MAX_PRECISION, _MAX_PRECISION)
    logger.debug("noise in pixels: %s", np.round(noise / pixel, 3))
    return [
        replace(image, noise=float(s), precision=float(p))
        for image, s, p in zip(images, noise, precision, strict=True)
    ]


def scan_noise(images: Sequence[PosedImage], workers: int = 1) -> FloatArray:
    """Standard deviation (N,) of each image's surface along its normal, between pixels.

    The variance of the distance between two surfaces is the sum of theirs: all pairs together give
    each by least squares. It holds what is left of errors of the poses, too. A scan that overlaps
    with none has the noise of the typical one; a single one, that of its own pixels.
    """
    points = [_between_pixels(image) for image in images]
    floor = np.array([_FLOOR_PIXELS * image.pixel for image in images])
    rows, variances, counts = [], [], []
    ways = [*permutations(range(len(images)), 2)]
    spreads = map_in_rows(lambda way: _spread(points[way[0]], images[way[1]]), ways, workers)
    for (i, j), (spread, count) in zip(ways, spreads, strict=True):
        if count >= MIN_COMMON:
            row = np.zeros(len(images))
            row[[i, j]] = 1.0
            rows.append(row)
            variances.append(max(spread, floor[i], floor[j]) ** 2)
            counts.append(count)
    if not rows:
        own = np.array([_own_noise(image) for image in images])
        return np.maximum(own, floor)
    # A variance is known to a share of itself: without that, noisy pairs drown the others.
    weights = np.sqrt(counts) / np.array(variances)
    typical = 0.5 * float(np.median(variances))
    ridge = _RIDGE * float(np.median(weights))
    system = np.concatenate([weights[:, None] * np.array(rows), ridge * np.eye(len(images))])
    wanted = np.concatenate([weights * variances, np.full(len(images), ridge * typical)])
    variance, _ = nnls(system / ridge, wanted / ridge)
    return np.maximum(np.sqrt(variance), floor)


def _between_pixels(image: PosedImage) -> tuple[FloatArray, FloatArray]:
    """Some points (P, 3) and normals (P, 3) of a surface, anywhere between pixels, world frame."""
    inner = (image.weight > 0) & ~image.is_rim
    whole = inner[:-1, :-1] & inner[:-1, 1:] & inner[1:, :-1] & inner[1:, 1:]
    row, column = np.nonzero(whole)
    step = max(1, len(row) // _COMPARED.num_points)
    row, column = row[::step], column[::step]
    s, t = (np.arange(len(row)) * g % 1.0 for g in _GOLDEN)
    points, normals = np.zeros((len(row), 3)), np.zeros((len(row), 3))
    for y in (0, 1):
        for x in (0, 1):
            share = ((s if x else 1 - s) * (t if y else 1 - t))[:, None]
            depth = image.depth[row + y, column + x].astype(np.float64)
            pixels = np.stack([column + x, row + y], axis=1).astype(np.float64)
            points += share * image.camera.unproject(pixels, depth)
            normals += share * image.normals[row + y, column + x]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    world_from_sensor = image.sensor_from_world.inverse()
    return world_from_sensor.apply(points), world_from_sensor.turn(normals)


def _spread(points: tuple[FloatArray, FloatArray], image: PosedImage) -> tuple[float, int]:
    """Robust standard deviation of the distances of points to a surface, and their number."""
    distance, weight = sample_surface(image, *points, _COMPARED.min_cosine)
    near = (weight > 0) & (np.abs(distance) < _COMPARED.reach_pixels * image.pixel)
    if not near.any():
        return 0.0, 0
    return MAD_TO_SIGMA * float(np.median(np.abs(distance[near]))), int(near.sum())


def _own_noise(image: PosedImage) -> float:
    """Noise of an image by itself: of pixels, against the planes of their neighbours."""
    points = image.camera.unproject_image(image.depth.astype(np.float64))
    inner = (image.weight > 0) & ~image.is_rim
    away = np.zeros(inner.shape)
    for shift, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1)):
        other = np.roll(points, shift, axis)
        away += 0.25 * np.einsum("hwk,hwk->hw", np.roll(image.normals, shift, axis), points - other)
    known = np.abs(away[inner & np.isfinite(away)])
    if not len(known):
        return 0.0
    # A pixel against the mean of four has 5/4 of its variance, a point between pixels 4/9.
    return MAD_TO_SIGMA * float(np.median(known)) * np.sqrt(4 / 9 * 4 / 5)
