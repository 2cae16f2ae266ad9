"""Scans as depth images of one camera."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan

MAX_OFF_PIXELS = 0.6
"""How far from its cell a point may lie in the camera's image: half a cell, and rounding."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Frames:
    """Depth images of one camera.

    Attributes:
        scans: What they are of, ordered by content.
        camera: Of all of them, a pinhole.
    """

    scans: tuple[RangeScan, ...]
    camera: Camera

    def depth(self, k: int) -> FloatArray:
        """(H, W) depth of a frame, NaN where nothing was seen."""
        return depth_image(self.scans[k])


def frames_of(scans: Sequence[RangeScan]) -> Frames | str:
    """Scans that are depth images of one camera, or why they are none.

    Args:
        scans: At least one; those without points are left out.
    """
    seen = [scan for scan in scans if len(scan.points)]
    if len(seen) < 2:
        return "fewer than two frames saw anything"
    camera = camera_of(seen)
    if camera is None:
        return "the scans are no depth images of one pinhole camera"
    if not all(_fits(scan, camera) for scan in seen):
        return "the points of the scans do not lie where their camera sees them"
    return Frames(scans=tuple(sorted(seen, key=RangeScan.content_hash)), camera=camera)


def camera_of(scans: Sequence[RangeScan]) -> Camera | None:
    """The pinhole camera that all scans that saw anything have alike, if there is one."""
    cameras = {scan.camera for scan in scans if len(scan.points)}
    camera = cameras.pop() if len(cameras) == 1 else None
    return camera if camera is not None and camera.model is CameraModel.PINHOLE else None


def depth_image(scan: RangeScan) -> FloatArray:
    """(H, W) depth of a scan with a grid along its sensor's axis, NaN where nothing was seen."""
    if scan.grid is None:
        raise ValueError(f"{scan.name}: has no grid")
    sensor_from_scan = (scan.scan_from_sensor or Pose.identity()).inverse()
    x, y, z = sensor_from_scan.rotation[2]
    depth = x * scan.points[:, 0] + y * scan.points[:, 1] + z * scan.points[:, 2]
    return np.append(depth + sensor_from_scan.translation[2], np.nan)[scan.grid]


def _fits(scan: RangeScan, camera: Camera) -> bool:
    """Whether a scan's grid is its camera's image."""
    if scan.grid is None or scan.grid.shape != (camera.height, camera.width):
        return False
    rows, columns = np.nonzero(scan.grid >= 0)
    sensor_from_scan = (scan.scan_from_sensor or Pose.identity()).inverse()
    pixels, _ = camera.project(sensor_from_scan.apply(scan.points[scan.grid[rows, columns]]))
    off = np.abs(pixels - np.stack([columns, rows], axis=1))
    return len(rows) > 0 and bool((off <= MAX_OFF_PIXELS).all())
