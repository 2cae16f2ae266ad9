"""A posed scan ready for fusion: its weighted surface, and the rays that met nothing."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scanweld.config import PrepareConfig
from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import MIN_COSINE, PixelKind, PreparedScan
from scanweld.geometry.sampling import NUM_FEW
from scanweld.preparation.prepare import surface_points
from scanweld.preparation.range_image import (
    incidence_cosines,
    normals_image,
    render_surface,
    rim_pixels,
)

logger = logging.getLogger(__name__)

SingleArray = NDArray[np.float32]

_RIM_WEIGHT = 0.05
"""Weight of a pixel on the rim, where sensors mix near and far."""
_RAMP_PIXELS = 6.0
"""Distance from the rim at which a pixel has its full weight."""
_FREE_PIXELS = 10.0
"""Free pixels of the working image nearer to the silhouette than this do not show empty space."""
_MAX_LOST = 0.02
"""Share of another scan's surface in front of an image's free pixels at which these are trusted no
more: the sensor lost returns."""
_MARGIN_PIXELS = 2.0
"""Space around the surface that the image holds."""
_MAX_NOISE_PIXELS = 0.5
"""Noise of depth above which a scan is smoothed: below it, averaging scans blurs less."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PosedImage:
    """A posed range image of (H, W) pixels, in the sensor frame, ready for compiled kernels.

    Attributes:
        camera: Pinhole or orthographic.
        sensor_from_world: Where the sensor stood.
        depth: (H, W); NaN where there is no surface.
        normals: (H, W, 3) unit, towards the sensor; NaN where there is no surface.
        weight: (H, W) in [0, 1]: cosine of incidence, less towards the rim; 0 off the surface.
        is_rim: (H, W) pixels next to a jump, a hole, the silhouette or the image's edge.
        pixel: Footprint of a pixel on the object.
        colors: (H, W, 3) as measured, black off the surface; or None.
        free_camera: Of the image below.
        is_free: (h, w) pixels of the working image whose rays passed the object.
        trust: Weight of these rays, from 0 to 1.
        noise: Standard deviation of the surface's distance between pixels, along its normal.
        precision: What the scan's weights are multiplied by, about 1.
    """

    camera: Camera
    sensor_from_world: Pose
    depth: SingleArray
    normals: SingleArray
    weight: SingleArray
    is_rim: BoolArray
    pixel: float
    colors: ByteArray | None
    free_camera: Camera
    is_free: BoolArray
    trust: float = 1.0
    noise: float = 0.0
    precision: float = 1.0

    def points(self) -> FloatArray:
        """(N, 3) points of the surface that have a weight, world frame."""
        local = self.camera.unproject_image(self.depth.astype(np.float64))[self.weight > 0]
        return self.sensor_from_world.inverse().apply(local)


def pose_image(
    scan: PreparedScan, world_from_sensor: Pose, pixel: float, config: PrepareConfig
) -> PosedImage:
    """The range image of a prepared scan at its pose.

    Args:
        scan: The scan.
        world_from_sensor: Its pose.
        pixel: Footprint of the image's pixels, unless those of the working image are finer.
        config: Settings of the scan's preparation.
    """
    coarse = scan.image
    kept, points = surface_points(scan)
    spacing, pixel = pixel, min(pixel, coarse.pixel)
    margin = _MARGIN_PIXELS * pixel
    camera, depth, mesh = render_surface(
        kept, points, spacing, pixel, margin, config, _MAX_NOISE_PIXELS
    )
    normals = normals_image(depth, mesh)
    is_rim = rim_pixels(depth, mesh, config.rim_pixels)
    is_rim[[0, -1], :] = True
    is_rim[:, [0, -1]] = True
    colors = None
    if kept.colors is not None:
        max_step = config.jump_pixels * pixel
        colors = _color_image(points, kept.colors, camera, depth, max_step)
    return PosedImage(
        camera=camera,
        sensor_from_world=world_from_sensor.inverse(),
        depth=depth.astype(np.float32),
        normals=normals.astype(np.float32),
        weight=_weights(camera, depth, normals, is_rim),
        is_rim=is_rim,
        pixel=pixel,
        colors=colors,
        free_camera=coarse.camera,
        is_free=(coarse.kind == PixelKind.FREE) & (coarse.outside > _FREE_PIXELS * coarse.pixel),
    )


def free_space_trusts(images: Sequence[PosedImage]) -> FloatArray:
    """Weights (N,), from 0 to 1, of the images' pixels without a return as signs of empty space.

    Only an ideal sensor gets a return from every surface: a real one loses dark, oblique and far
    parts of an object. An image that lost a part of what another scan saw gets a low weight.
    """
    points = [_sparse(image) for image in images]
    trusts = np.ones(len(images))
    for j, image in enumerate(images):
        seen = [image.sensor_from_world.apply(p) for p in points if len(p)]
        lost = [look_up(image.is_free, image.free_camera, p).mean() for p in seen]
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
    chosen = np.flatnonzero((image.weight > 0) & ~image.is_rim)
    chosen = chosen[:: max(1, len(chosen) // NUM_FEW)]
    row, column = np.divmod(chosen, image.camera.width)
    pixels = np.stack([column, row], axis=1).astype(np.float64)
    depth = image.depth[row, column].astype(np.float64)
    return image.sensor_from_world.inverse().apply(image.camera.unproject(pixels, depth))


def _weights(
    camera: Camera, depth: FloatArray, normals: FloatArray, is_rim: BoolArray
) -> SingleArray:
    """(H, W) cosine of incidence times a ramp that rises from the rim; 0 off the surface."""
    cosine = incidence_cosines(camera, depth, normals)
    is_surface = np.isfinite(depth) & (cosine > MIN_COSINE)
    inner = np.pad(is_surface & ~is_rim, 1)
    inward = np.asarray(distance_transform_edt(inner))[1:-1, 1:-1]
    ramp = _RIM_WEIGHT + (1 - _RIM_WEIGHT) * np.minimum(inward / _RAMP_PIXELS, 1.0)
    return np.where(is_surface, cosine * ramp, 0.0).astype(np.float32)


def _color_image(
    points: FloatArray, colors: ByteArray, camera: Camera, depth: FloatArray, max_step: float
) -> ByteArray:
    """Colours (H, W, 3): of the point nearest to the pixel's centre, else of the nearest pixel."""
    pixels, z = camera.project(points)
    column, row = np.rint(pixels).astype(np.int64).T
    inside = (row >= 0) & (row < camera.height) & (column >= 0) & (column < camera.width)
    off_centre = np.abs(pixels - np.rint(pixels)).max(axis=1)
    index = np.flatnonzero(inside)
    index = index[np.abs(depth[row[index], column[index]] - z[index]) <= max_step]
    index = index[np.argsort(-off_centre[index], kind="stable")]
    image = np.zeros((camera.height, camera.width, 3), np.uint8)
    has_color = np.zeros((camera.height, camera.width), dtype=bool)
    # Where several points fall into a pixel, the last one written is the nearest.
    image[row[index], column[index]] = colors[index]
    has_color[row[index], column[index]] = True
    if has_color.any():
        nearest = distance_transform_edt(~has_color, return_distances=False, return_indices=True)
        image = image[tuple(np.asarray(nearest))]
    image[~np.isfinite(depth)] = 0
    return image
