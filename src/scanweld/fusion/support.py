"""How well each vertex of a fused mesh is known: the scans behind it, and their scatter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanweld.fusion.posed_image import PosedImage
from scanweld.fusion.sampling import sample_surface
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.gauss_newton import SIGNIFICANT_SIGMAS
from scanweld.geometry.prepared import MIN_COSINE

_PRIOR_SCANS = 4.0
"""The noise of the scans as a whole counts for as many scans as these; the local scatter besides.

With two or three scans the scatter alone would say next to nothing."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Support:
    """What stands behind V vertices.

    Attributes:
        count: (V,) number of scans whose surface lies there.
        stdev: (V,) standard deviation of the vertex along its normal; NaN without a scan.
    """

    count: IntArray
    stdev: FloatArray


def measure_support(
    images: Sequence[PosedImage], vertices: FloatArray, normals: FloatArray, voxel: float
) -> Support:
    """Hold vertices against the scans that they were fused from.

    The variance of a weighted mean follows from the scans' noise; how far the scans really lie
    apart at the vertex corrects it, the more the more of them there are.

    Args:
        images: With their noise.
        vertices: (V, 3), world frame.
        normals: (V, 3) unit, pointing out.
        voxel: Edge of a voxel.
    """
    size = len(vertices)
    count, total, squares, scatter = (np.zeros(size) for _ in range(4))
    for image in images:
        distance, weight = weights_at(image, vertices, normals)
        reach = max(voxel, SIGNIFICANT_SIGMAS * image.noise)
        supports = (weight > 0) & (np.abs(distance) < reach)
        w = np.where(supports, image.precision * weight, 0.0)
        count += supports
        total += w
        squares += (w * image.noise) ** 2
        scatter += w * np.where(supports, distance / image.noise, 0.0) ** 2
    known = count > 0
    scatter = count * np.divide(scatter, total, out=np.zeros(size), where=known)
    expected = np.divide(squares, total**2, out=np.full(size, np.nan), where=known)
    factor = (_PRIOR_SCANS + scatter) / (_PRIOR_SCANS + np.maximum(count - 1, 0))
    return Support(count=count.astype(np.int64), stdev=np.sqrt(expected * factor))


def weights_at(
    image: PosedImage, vertices: FloatArray, normals: FloatArray
) -> tuple[NDArray, NDArray]:
    """Distances (V,) of vertices from an image's surface, and weights (V,), 0 where it has none."""
    distance, weight = sample_surface(image, vertices)
    rays = image.camera.view_directions(image.sensor_from_world.apply(vertices))
    cosine = -np.einsum("vk,vk->v", image.sensor_from_world.turn(normals), rays)
    return distance, np.where(cosine > MIN_COSINE, weight, np.float32(0))
