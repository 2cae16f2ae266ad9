"""What a posed scan says to the volume: surface points with weights, and rays that went on."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind, PreparedScan, RangeImage

_RIM_WEIGHT = 0.05
"""Weight of a pixel on the rim, where sensors mix near and far."""
_RAMP_PIXELS = 6.0
"""Distance from the rim at which a pixel has its full weight."""
_FREE_PIXELS = 3.0
"""Free pixels nearer to the silhouette do not carve."""
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


def pose_image(prepared: PreparedScan, world_from_sensor: Pose) -> PosedImage:
    """The range image of a prepared scan at its pose."""
    image = prepared.image
    points = image.points()
    weight = _weights(image, points)
    carving = np.where(image.is_rim, 0.0, weight)
    is_free = (image.kind == PixelKind.FREE) & (image.outside > _FREE_PIXELS * image.pixel)
    carving[is_free] = 1.0
    return PosedImage(
        camera=image.camera,
        sensor_from_world=world_from_sensor.inverse(),
        points=world_from_sensor.apply(points),
        normals=world_from_sensor.turn(image.normals),
        weight=weight,
        carving=carving,
        is_rim=_rim(image),
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
