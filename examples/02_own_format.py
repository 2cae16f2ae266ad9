"""Learn to bring your own format: a depth image and its camera become a scan.

The more a scan says of its sensor, the less has to be guessed: give the grid, the camera and where
the sensor stood. Points alone do too; then scanweld estimates the viewpoint, and says so.
"""

import numpy as np

from scanweld import Camera, CameraModel, Pose, RangeScan, Viewpoint, describe_scan

CAMERA = Camera(model=CameraModel.PINHOLE, width=96, height=80, fx=120, fy=120, cx=47.5, cy=39.5)


def depth_of_a_bump() -> np.ndarray:
    """A depth image (H, W) in metres, NaN where the sensor saw nothing."""
    rows, columns = np.mgrid[: CAMERA.height, : CAMERA.width]
    radius = np.hypot(rows - CAMERA.cy, columns - CAMERA.cx) / 35
    bump = 0.1 * np.cos(3 * radius) + 0.02 * np.sin(columns / 7)
    return np.where(radius < 1, 1.0 - bump, np.nan)


def scan_from_depth(name: str, depth: np.ndarray) -> RangeScan:
    """A scan in the sensor's own frame: x right, y down, z away from the sensor."""
    seen = np.isfinite(depth)
    grid = np.where(seen, np.cumsum(seen).reshape(seen.shape) - 1, -1)
    return RangeScan(
        name=name,
        points=CAMERA.unproject_image(depth)[seen],
        grid=grid,
        camera=CAMERA,
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
    )


if __name__ == "__main__":
    print(describe_scan(scan_from_depth("bump", depth_of_a_bump())))
    points = scan_from_depth("points alone", depth_of_a_bump()).points
    print(describe_scan(RangeScan(name="points alone", points=points)))
