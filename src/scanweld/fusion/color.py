"""Colours of a fused mesh, blended from the scans that saw each vertex."""

import logging
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.spatial import KDTree

from scanweld.fusion.agreement import parts_of
from scanweld.fusion.noise import MIN_COMMON
from scanweld.fusion.posed_image import PosedImage, SingleArray
from scanweld.fusion.sampling import sample_colors, sample_surface
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.mesh import UNCOLORED
from scanweld.geometry.sampling import NUM_SAMPLED
from scanweld.work.threads import map_in_order

logger = logging.getLogger(__name__)

_MIN_FAIR = 0.1
"""Share of the vertices common to two scans that must be neither too dark nor too bright."""
_CLIPPED = 12.0
"""Values (0 to 255) nearer than this to black or white say little of a sensor's exposure."""
_RIDGE = 1e-3
"""Share of a scan's comparisons that the wish to leave it as it is weighs."""


def blend_colors(
    vertices: FloatArray,
    normals: FloatArray,
    images: Sequence[PosedImage],
    reach: float,
    workers: int = 1,
) -> ByteArray | None:
    """Colours (V, 3) of vertices (V, 3) with unit normals (V, 3); None if no scan has colours.

    Scans weigh as they do in the volume, after their exposures have been balanced. Vertices that no
    scan with colours saw get the colour of the nearest vertex that has one.

    Args:
        vertices: World frame.
        normals: Unit, pointing out.
        images: With or without colours.
        reach: How far from a vertex a scan's surface may lie, in the scans' unit.
        workers: Threads; the result is the same for any number.
    """
    colored = [image for image in images if image.colors is not None]
    if not colored:
        return None
    gains = exposure_gains(vertices, normals, colored, reach)

    def work(part: slice) -> tuple[FloatArray, FloatArray]:
        return _sums(vertices[part], normals[part], colored, gains, reach)

    sums = [*map_in_order(work, parts_of(len(vertices)), workers)]
    total, weight = (np.concatenate(each) for each in zip(*sums, strict=True))
    has_color = weight > 0
    color = np.full((len(vertices), 3), float(UNCOLORED))
    color[has_color] = total[has_color] / weight[has_color, None]
    if has_color.any() and not has_color.all():
        _, nearest = KDTree(vertices[has_color]).query(vertices[~has_color])
        color[~has_color] = color[has_color][nearest]
    return np.clip(np.rint(color), 0, 255).astype(np.uint8)


def _sums(
    vertices: FloatArray,
    normals: FloatArray,
    images: Sequence[PosedImage],
    gains: FloatArray,
    reach: float,
) -> tuple[FloatArray, FloatArray]:
    """Weighted sums (V, 3) of the colours, balanced, and of the weights (V,)."""
    total, weight = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    for image, gain in zip(images, gains, strict=True):
        color, share = _colors_at(image, vertices, normals, reach)
        total += share[:, None] * color / gain
        weight += share
    return total, weight


def exposure_gains(
    vertices: FloatArray, normals: FloatArray, images: Sequence[PosedImage], reach: float
) -> FloatArray:
    """How much brighter (N, 3) each scan shows red, green and blue than the scans together do.

    A gain times the stored value is a gain of the light as well, whatever the gamma. Ratios of all
    pairs where both saw the same surface, their medians, give the gains by least squares; their
    geometric mean over the scans is 1.
    """
    step = max(1, len(vertices) // NUM_SAMPLED)
    vertices, normals = vertices[::step], normals[::step]
    found = [_colors_at(image, vertices, normals, reach) for image in images]
    seen = [share > 0 for _, share in found]
    logs = [_log_colors(color, share) for color, share in found]
    size = len(images)
    system, wanted = np.zeros((3, size, size)), np.zeros((3, size))
    for i, j in combinations(range(size), 2):
        for channel in range(3):
            difference = logs[i][:, channel] - logs[j][:, channel]
            num_common = int((seen[i] & seen[j]).sum())
            difference = difference[np.isfinite(difference)]
            if len(difference) < max(MIN_COMMON, _MIN_FAIR * num_common):
                continue
            n = float(len(difference))
            pair = np.ix_([i, j], [i, j])
            system[channel][pair] += n * np.array([[1.0, -1.0], [-1.0, 1.0]])
            wanted[channel][[i, j]] += n * float(np.median(difference)) * np.array([1.0, -1.0])
    gains = np.zeros((size, 3))
    for channel in range(3):
        ridge = _RIDGE * np.trace(system[channel]) / size + 1.0
        solved = np.linalg.solve(system[channel] + ridge * np.eye(size), wanted[channel])
        gains[:, channel] = solved - solved.mean()
    logger.debug("exposures: %s", np.round(np.exp(gains.mean(axis=1)), 3))
    return np.exp(gains)


def _log_colors(color: FloatArray, share: SingleArray) -> FloatArray:
    """Logarithms (V, 3) of colours, NaN where a scan says nothing of them."""
    fair = (share > 0)[:, None] & (color > _CLIPPED) & (color < 255.0 - _CLIPPED)
    return np.log(color, out=np.full(color.shape, np.nan), where=fair)


def _colors_at(
    image: PosedImage, vertices: FloatArray, normals: FloatArray, reach: float
) -> tuple[FloatArray, SingleArray]:
    distance, weight = sample_surface(image, vertices, normals)
    color, _ = sample_colors(image, vertices)
    near = np.abs(distance) < reach
    return color.astype(np.float64), np.where(near, weight, np.float32(0))
