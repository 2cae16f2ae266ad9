"""How well each vertex of a fused mesh is known: the scans that agree on it, and their scatter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.fusion.posed_image import PosedImage
from scanweld.fusion.sampling import sample_surface
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.gauss_newton import SIGNIFICANT_SIGMAS
from scanweld.work.threads import map_in_order

_PRIOR_SCANS = 4.0
"""The scans' overall noise counts like the scatter of so many scans at a vertex: of two or three
scans alone the scatter would be known too poorly."""

PART = 1 << 14
"""Vertices that are worked on together: bounds the memory, and is a worker's share."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Agreement:
    """What the scans say of V vertices.

    Attributes:
        count: (V,) number of scans whose surface lies there.
        stdev: (V,) standard deviation of the vertex along its normal; NaN without a scan.
    """

    count: IntArray
    stdev: FloatArray


def measure_agreement(
    images: Sequence[PosedImage],
    vertices: FloatArray,
    normals: FloatArray,
    voxel: float,
    workers: int = 1,
) -> Agreement:
    """Compare vertices with the scans that they were fused from.

    A vertex is a weighted mean of the scans' surfaces. Its variance follows from the scans' noise,
    corrected by the scatter of these surfaces at the vertex: the more scans, the stronger.

    Args:
        images: Posed scans whose noise is known.
        vertices: (V, 3), world frame.
        normals: (V, 3) unit, pointing out.
        voxel: Edge of a voxel.
        workers: Threads; the result is the same for any number.
    """

    def work(part: slice) -> Agreement:
        return _agreement(images, vertices[part], normals[part], voxel)

    parts = [*map_in_order(work, parts_of(len(vertices)), workers)]
    return Agreement(
        count=np.concatenate([part.count for part in parts]),
        stdev=np.concatenate([part.stdev for part in parts]),
    )


def parts_of(size: int) -> list[slice]:
    """Vertices that are worked on together; one part at least."""
    return [slice(start, start + PART) for start in range(0, max(size, 1), PART)]


def _agreement(
    images: Sequence[PosedImage], vertices: FloatArray, normals: FloatArray, voxel: float
) -> Agreement:
    size = len(vertices)
    count, total, squares, scatter = (np.zeros(size) for _ in range(4))
    for image in images:
        distance, weight = sample_surface(image, vertices, normals)
        reach = max(voxel, SIGNIFICANT_SIGMAS * image.noise)
        agrees = (weight > 0) & (np.abs(distance) < reach)
        w = np.where(agrees, image.precision * weight, 0.0)
        count += agrees
        total += w
        squares += (w * image.noise) ** 2
        scatter += w * np.where(agrees, distance / image.noise, 0.0) ** 2
    known = count > 0
    scatter = count * np.divide(scatter, total, out=np.zeros(size), where=known)
    expected = np.divide(squares, total**2, out=np.full(size, np.nan), where=known)
    factor = (_PRIOR_SCANS + scatter) / (_PRIOR_SCANS + np.maximum(count - 1, 0))
    return Agreement(count=count.astype(np.int64), stdev=np.sqrt(expected * factor))
