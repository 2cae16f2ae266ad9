"""Where a scan's sensor stood: given, fitted to its grid, or estimated from the points alone."""

import logging
from dataclasses import replace

import numpy as np

from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter
from scanweld.prepare.camera_fit import CameraFit, fit_orthographic, fit_pinhole
from scanweld.prepare.line_scanner import line_of_sight
from scanweld.prepare.resolution import point_spacing
from scanweld.prepare.sensor_side import find_side
from scanweld.prepare.viewpoint import depth_image, principal_frame

logger = logging.getLogger(__name__)

MIN_POINTS = 50
"""A scan of fewer points is refused."""
MIN_WIDTH = 1e-6
"""Points whose second principal extent is below this share of the first lie on a line."""
MAX_FIT_CELLS = 10_000
"""Grid cells that a camera is fitted to."""
SAME_RMS_PIXELS = 0.02
"""Below this residual an orthographic camera is as good as any."""
SAME_RMS_RATIO = 1.5
"""A pinhole must be this many times better than an orthographic camera to be preferred."""
STAND_OFF_DIAMETERS = 2.0
"""How far before the object's centroid a sensor is put of which only the direction is known."""

OBLIQUE_NOTE = (
    "the grid looks obliquely to the scanner's travel, as a camera beside a sheet of light does; "
    "the viewing direction is halfway between both"
)


def locate_sensor(scan: RangeScan) -> RangeScan:
    """The scan with its sensor: as given, fitted to the grid, or estimated from the surface.

    An organised grid gets the pinhole or orthographic camera that reproduces it to a fraction of
    a pixel; if no such camera exists (line scanners), only its viewing direction is found, and the
    sensor is put well before the object. The same holds for meshes and points without a grid. A
    grid that mirrors its camera's image comes back with its rows reversed.

    Raises:
        InputError: If there are fewer than 50 points, or if all of them lie on one line.
    """
    _check_usable(scan)
    if scan.scan_from_sensor is not None:
        return scan
    if scan.grid is not None and np.count_nonzero(scan.grid >= 0) >= MIN_POINTS:
        found = _from_grid(scan, scan.grid)
    else:
        found = _from_surface(scan)
    logger.debug("%s: sensor %s, %s", scan.name, found.viewpoint, "; ".join(found.notes))
    return found


def _check_usable(scan: RangeScan) -> None:
    n = len(scan.points)
    if n < MIN_POINTS:
        raise InputError(
            f"{scan.name}: a scan of {n} points is too small to register; "
            f"give at least {MIN_POINTS}"
        )
    extents = np.linalg.eigvalsh(np.cov(scan.points.T))
    if extents[1] <= MIN_WIDTH**2 * extents[2]:
        raise InputError(f"{scan.name}: all points lie on one line; a scan needs a surface")


def _from_grid(scan: RangeScan, grid: IntArray) -> RangeScan:
    """Fit the simplest camera to a grid, or else its line of sight."""
    rows, columns = np.nonzero(grid >= 0)
    stride = max(1, len(rows) // MAX_FIT_CELLS)
    pixels = np.stack([columns, rows], axis=1)[::stride].astype(np.float64)
    points = scan.points[grid[rows, columns]][::stride]
    height, width = grid.shape
    sight = line_of_sight(points, pixels)
    orthographic = fit_orthographic(points, pixels, (height, width), sight.axis)
    if orthographic is None or orthographic.rms > SAME_RMS_PIXELS:
        pinhole = fit_pinhole(points, pixels, (height, width))
        if pinhole and not (orthographic and orthographic.rms < SAME_RMS_RATIO * pinhole.rms):
            return _with_camera(scan, pinhole)
    axis, notes = sight.axis, ()
    if not sight.has_side:
        depth = np.full(grid.shape, np.nan)
        depth[rows, columns] = scan.points[grid[rows, columns]] @ axis
        axis, notes = _sided(scan, axis, depth, sight.pitch)
    if orthographic:
        turned = fit_orthographic(points, pixels, (height, width), axis)
        return _with_camera(scan, turned or orthographic, *notes)
    if sight.is_oblique:
        notes = (OBLIQUE_NOTE, *notes)
    note = "no frame camera explains the grid; its line of sight was fitted"
    return _with_direction(scan, axis, sight.right, Viewpoint.FITTED, note, *notes)


def _from_surface(scan: RangeScan) -> RangeScan:
    """Estimate the viewing direction of points or a mesh without a grid."""
    frame = principal_frame(scan.points)
    cell = 2 * point_spacing(scan.points)
    axis, notes = _sided(scan, frame[2], depth_image(scan.points, frame, cell), cell)
    note = "the file says nothing of the viewpoint; it was estimated from the points"
    return _with_direction(scan, axis, frame[0], Viewpoint.ESTIMATED, note, *notes)


def _sided(
    scan: RangeScan, axis: FloatArray, depth: FloatArray, pixel: float
) -> tuple[FloatArray, tuple[str, ...]]:
    """The axis (3,) with the sign of the side that the sensor stood on, and what to say of it."""
    side = find_side(scan, axis, depth, pixel)
    note = side.note()
    return side.sign * axis, () if note is None else (note,)


def _with_camera(scan: RangeScan, fit: CameraFit, *notes: str) -> RangeScan:
    """The scan with a camera fitted to its grid, whose rows are reversed if they mirror it."""
    pose = fit.sensor_from_scan
    if fit.camera.model is CameraModel.ORTHOGRAPHIC:
        shift = np.array([0.0, 0.0, _stand_off(scan.points, pose.rotation[2])])
        pose = Pose(rotation=pose.rotation, translation=pose.translation + shift)
    if fit.is_mirrored and scan.grid is not None:
        scan = replace(scan, grid=scan.grid[::-1])
        notes = ("the grid mirrors what its camera saw; its rows were reversed", *notes)
    note = f"{fit.camera.model.name.lower()} camera fitted to the grid to {fit.rms:.2g} pixels"
    return scan.with_sensor(pose.inverse(), Viewpoint.FITTED, note, *notes, camera=fit.camera)


def _with_direction(
    scan: RangeScan, axis: FloatArray, right: FloatArray, viewpoint: Viewpoint, *notes: str
) -> RangeScan:
    """The scan with a sensor well before it that looks along the axis (3,), x to the right (3,)."""
    rotation = nearest_rotation(np.stack([right, np.cross(axis, right), axis], axis=1))
    origin = scan.points.mean(axis=0) - _stand_off(scan.points, axis) * axis
    pose = Pose(rotation=rotation, translation=origin)
    return replace(scan, camera=None).with_sensor(pose, viewpoint, *notes)


def _stand_off(points: FloatArray, axis: FloatArray) -> float:
    """How far before the centroid a sensor sees every point, strays too, at a positive depth."""
    diameter = principal_diameter(points)
    nearest = float(((points - points.mean(axis=0)) @ axis).min())
    return max(STAND_OFF_DIAMETERS * diameter, diameter - nearest)
