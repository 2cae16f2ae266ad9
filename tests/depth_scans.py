"""Scans of depths and of a ball, and what is asked of their range images."""

from functools import lru_cache

import numpy as np

from scanweld.config import PrepareConfig
from scanweld.evaluation.primitives import sphere
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind, PreparedScan
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.preparation import prepare
from tests.scenes import random_motion

CONFIG = PrepareConfig()
MODELS = (CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC)
RADIUS = 50.0


@lru_cache
def ball(model: CameraModel) -> tuple[PreparedScan, FloatArray]:
    """A ball, prepared, and its centre (3,) in the sensor frame."""
    mesh = sphere(RADIUS)
    view = view_of(mesh, 40, 20, 70, pixels=120, model=model)
    motion = random_motion(np.random.default_rng(4), 200.0)
    scan = scan_mesh(mesh, view.camera, view.world_from_sensor, scan_from_sensor=motion)
    return prepare(scan, CONFIG), view.world_from_sensor.inverse().translation


def ortho(width: int, height: int) -> Camera:
    """One unit a pixel."""
    return Camera(
        model=CameraModel.ORTHOGRAPHIC, width=width, height=height, fx=1, fy=1, cx=0, cy=0
    )


def scan_of_depth(depth: FloatArray, camera: Camera | None = None) -> RangeScan:
    """A scan of a depth image (H, W), NaN where nothing was seen, in the sensor's frame."""
    camera = camera or ortho(depth.shape[1], depth.shape[0])
    has = np.isfinite(depth)
    grid = np.full(depth.shape, -1)
    grid[has] = np.arange(has.sum())
    return RangeScan(
        name="drawn",
        points=camera.unproject_image(depth)[has],
        grid=grid,
        camera=camera,
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
    )


def bumps(rows: int = 90, columns: int = 90, margin: int = 15) -> FloatArray:
    """Depth of a wavy patch in the middle of the image, nothing around it."""
    v, u = np.mgrid[:rows, :columns]
    depth = 200 + 4 * np.sin(u / 9) + 5 * np.cos(v / 11)
    inside = (np.minimum(u, columns - 1 - u) >= margin) & (np.minimum(v, rows - 1 - v) >= margin)
    return np.where(inside, depth, np.nan)


def xy_of(scan: PreparedScan) -> tuple[FloatArray, FloatArray]:
    """Coordinates (H, W) of the image's pixels in the plane of an orthographic scan."""
    ones = scan.image.camera.unproject_image(np.ones(scan.image.depth.shape))
    return ones[..., 0], ones[..., 1]


def kind_at(scan: PreparedScan, x: float, y: float) -> PixelKind:
    """Kind of the pixel at (x, y) of an orthographic scan."""
    camera = scan.image.camera
    column, row = round(camera.fx * x + camera.cx), round(camera.fy * y + camera.cy)
    return PixelKind(scan.image.kind[row, column])


def angles_deg(a: FloatArray, b: FloatArray) -> FloatArray:
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.degrees(np.arctan2(sine, (a * b).sum(axis=-1)))
