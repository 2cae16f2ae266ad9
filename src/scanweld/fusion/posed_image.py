"""What a posed scan says to the volume: surface points with weights, and rays that went on."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind, PreparedScan, RangeImage

logger = logging.getLogger(__name__)

_RIM_WEIGHT = 0.05
"""Weight of a pixel on the rim, where sensors mix near and far."""
_RAMP_PIXELS = 6.0
"""Distance from the rim at which a pixel has its full weight."""
_FREE_PIXELS = 10.0
"""Free pixels nearer to the silhouette do not carve."""
_MAX_LOST = 0.02
"""An image on whose free pixels lies this share of another scan's surface does not carve there."""
_NUM_TRUST_POINTS = 2000
"""Points of a scan by which the others' free pixels are judged, about."""
_MIN_COSINE = 0.1
"""Pixels seen more obliquely than this have no say."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PosedImage:
    """A posed range image of (H, W) pixels, ready for compiled kernels.

    Attributes:
        camera: Pinhole or orthographic.
        sensor_from_world: Where the sensor stood.
        points: (H, W, 3), world frame; NaN where there is no surface.
        normals: (H, W, 3) unit, world frame, towards the sensor; NaN where there is no surface.
        weight: (H, W) in [0, 1]: cosine of incidence, less towards the rim; 0 off the surface.
        carving: (H, W) in [0, 1]: how far the ray speaks for the space before the surface, or on a
            free pixel all along it, being empty.
        is_rim: (H, W) pixels next to a jump, a hole, the silhouette or the image's edge.
    """

    camera: Camera
    sensor_from_world: Pose
    points: FloatArray
    normals: FloatArray
    weight: FloatArray
    carving: FloatArray
    is_rim: BoolArray


def pose_images(
    scans: Sequence[PreparedScan], world_from_sensor: Sequence[Pose]
) -> list[PosedImage]:
    """The range images of prepared scans at their poses."""
    posed = zip(scans, world_from_sensor, strict=True)
    images = [_pose_image(scan.image, pose) for scan, pose in posed]
    free = [
        (scan.image.kind == PixelKind.FREE) & (scan.image.outside > _FREE_PIXELS * scan.image.pixel)
        for scan in scans
    ]
    trusts = free_space_trusts(images, free)
    return [
        replace(image, carving=np.where(is_free, trust, image.carving))
        for image, is_free, trust in zip(images, free, trusts, strict=True)
    ]


def free_space_trusts(images: Sequence[PosedImage], free: Sequence[BoolArray]) -> FloatArray:
    """How far (N,) images are to be believed where they saw nothing, from 0 to 1.

    A pixel without a return is empty space for an ideal sensor only: a real one loses dark, oblique
    and far parts of an object. One that lost a part of what another scan saw is not believed.
    """
    points = [_sparse(image) for image in images]
    trusts = np.ones(len(images))
    for j, (image, is_free) in enumerate(zip(images, free, strict=True)):
        seen = [image.sensor_from_world.apply(p) for p in points if len(p)]
        lost = [look_up(is_free, image.camera, p).mean() for p in seen]
        trusts[j] = max(0.0, 1.0 - max(lost, default=0.0) / _MAX_LOST)
    logger.debug("trust in free space: %s", np.round(trusts, 2))
    return trusts


def look_up(values: NDArray, camera: Camera, points: FloatArray) -> NDArray:
    """The values (P,) of pixels (H, W) where points (P, 3), sensor frame, project; 0 outside."""
    pixels, _ = camera.project(points)
    column, row = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.int64).T
    height, width = values.shape
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    found = np.zeros(len(points), dtype=values.dtype)
    found[inside] = values[row[inside], column[inside]]
    return found


def _sparse(image: PosedImage) -> FloatArray:
    """Some surface points (P, 3), off the rims, world frame."""
    points = image.points[(image.weight > 0) & ~image.is_rim]
    return points[:: max(1, len(points) // _NUM_TRUST_POINTS)]


def _pose_image(image: RangeImage, world_from_sensor: Pose) -> PosedImage:
    points = image.points()
    weight = _weights(image, points)
    is_rim = _rim(image)
    return PosedImage(
        camera=image.camera,
        sensor_from_world=world_from_sensor.inverse(),
        points=world_from_sensor.apply(points),
        normals=world_from_sensor.turn(image.normals),
        weight=weight,
        carving=np.where(is_rim, 0.0, weight),
        is_rim=is_rim,
    )


def _weights(image: RangeImage, points: FloatArray) -> FloatArray:
    """(H, W) cosine of incidence times a ramp that rises from the rim; 0 off the surface."""
    rays = image.camera.view_directions(points)
    cosine = -np.einsum("hwk,hwk->hw", image.normals, rays)
    is_surface = (image.kind == PixelKind.SURFACE) & (cosine > _MIN_COSINE)
    inner = np.pad(is_surface & ~image.is_rim, 1)
    depth = np.asarray(distance_transform_edt(inner))[1:-1, 1:-1]
    ramp = _RIM_WEIGHT + (1 - _RIM_WEIGHT) * np.minimum(depth / _RAMP_PIXELS, 1.0)
    return np.where(is_surface, cosine * ramp, 0.0)


def _rim(image: RangeImage) -> BoolArray:
    is_rim = np.array(image.is_rim)
    is_rim[[0, -1], :] = True
    is_rim[:, [0, -1]] = True
    return is_rim
