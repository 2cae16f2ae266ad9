"""Where a scan's sensor stood: given, fitted to its grid, or estimated from the points alone."""

import logging
from dataclasses import replace

import numpy as np

from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray, IndexArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter
from scanweld.preparation.camera_fit import (
    MAX_RMS_PIXELS,
    CameraFit,
    fit_orthographic,
    fit_pinhole,
)
from scanweld.preparation.line_scanner import line_of_sight
from scanweld.preparation.resolution import point_spacing
from scanweld.preparation.sensor_side import find_side
from scanweld.preparation.spherical_fit import fit_spherical
from scanweld.preparation.viewpoint import (
    depth_image,
    line_of_sight_of_points,
    surface_points,
)

logger = logging.getLogger(__name__)

MIN_POINTS = 50
"""A scan of fewer points, or of fewer samples on its surface, is refused."""
MIN_WIDTH = 1e-6
"""Points whose second principal extent is below this share of the first lie on a line."""
MAX_FIT_CELLS = 10_000
"""Grid cells that a camera is fitted to."""
SAME_RMS_PIXELS = 0.02
"""Residual below which an orthographic camera is accepted without trying a pinhole."""
SAME_RMS_RATIO = 1.5
"""Factor by which a pinhole must fit better than an orthographic camera to be preferred."""
MAX_MISFIT = 0.1
"""Residual of the line of sight's fit, as a share of the grid, above which the grid does not belong
to a single viewpoint."""
MAX_LAYERED = 0.25
"""Share of points behind others above which they cannot have been seen from one viewpoint."""
IMAGE_SPACINGS = 2.0
"""Size of the pixels, in point spacings, of the depth image from which the side is found."""
STAND_OFF_DIAMETERS = 2.0
"""Distance from the object's centroid of a sensor of which only the direction is known."""

OBLIQUE_NOTE = (
    "the grid looks obliquely to the scanner's travel, as a camera beside a sheet of light does; "
    "the viewing direction is halfway between both"
)

COMPLETE_NOTE = (
    "the surface was not seen from one viewpoint: a complete model, or several scans in one file"
)


def locate_sensor(scan: RangeScan) -> RangeScan:
    """The scan with its sensor: as given, fitted to the grid, or estimated from the surface.

    An organised grid gets the pinhole, orthographic or spherical camera that reproduces it to a
    fraction of a pixel; if no such camera exists (line scanners), only its viewing direction is
    found, and the sensor is put well before the object. The same holds for meshes and points
    without a grid. A grid that mirrors its camera's image comes back with its rows reversed.

    Raises:
        InputError: If there are fewer than 50 points, if all of them lie on one line, or if a
            spherical scanner stood amid them.
    """
    _check_usable(scan)
    if scan.scan_from_sensor is not None:
        return scan
    found = _in_own_frame(scan) or _from_grid(scan) or _from_surface(scan)
    logger.debug("%s: sensor %s, %s", scan.name, found.viewpoint, "; ".join(found.notes))
    return found


def _check_usable(scan: RangeScan) -> None:
    n = len(scan.points)
    if n < MIN_POINTS:
        raise InputError(
            f"{scan.name}: a scan of {n} points is too small to register; "
            f"give at least {MIN_POINTS}"
        )
    if _are_on_line(scan.points):
        raise InputError(f"{scan.name}: all points lie on one line; a scan needs a surface")


def _are_on_line(points: FloatArray) -> bool:
    extents = np.linalg.eigvalsh(np.cov(points.T))
    return bool(extents[1] <= MIN_WIDTH**2 * extents[2])


def _in_own_frame(scan: RangeScan) -> RangeScan | None:
    """The scan with the sensor at the origin, if its camera has no pose but sees it from there."""
    if scan.camera is None:
        return None
    size = (scan.camera.width, scan.camera.height)
    if scan.grid is None:
        pixels, depth = scan.camera.project(scan.points)
        is_seen = ((pixels > -1) & (pixels < size)).all(axis=1) & (depth > 0)
    else:
        points, cells = _cells(scan.points, scan.grid)
        pixels, _ = scan.camera.project(points)
        is_seen = (np.abs(pixels - cells) < MAX_RMS_PIXELS).all(axis=1)
        is_seen &= size == scan.grid.shape[::-1]
    if not is_seen.all():
        return None
    note = "the camera has no pose; the points fit it as they are, so they are in its frame"
    return scan.with_sensor(Pose.identity(), Viewpoint.ESTIMATED, note)


def _cells(points: FloatArray, grid: IndexArray) -> tuple[FloatArray, FloatArray]:
    """The grid's points (M, 3) and their cells (M, 2) (column, row), evenly thinned."""
    rows, columns = np.nonzero(grid >= 0)
    stride = max(1, len(rows) // MAX_FIT_CELLS)
    rows, columns = rows[::stride], columns[::stride]
    return points[grid[rows, columns]], np.stack([columns, rows], axis=1).astype(np.float64)


def _from_grid(scan: RangeScan) -> RangeScan | None:
    """The scan with the simplest camera fitted to its grid, or else its line of sight."""
    if scan.grid is None or np.count_nonzero(scan.grid >= 0) < MIN_POINTS:
        return None
    points, pixels = _cells(scan.points, scan.grid)
    if pixels.std(axis=0).min() < 1 or _are_on_line(points):
        return None
    sight = line_of_sight(points, pixels)
    if sight.misfit > MAX_MISFIT:
        return _from_angles(scan)
    axis, notes = sight.axis, ()
    if not sight.has_side:
        depth = np.where(scan.grid >= 0, (scan.points @ axis)[scan.grid], np.nan)
        axis, notes = _sided(scan, axis, depth, sight.pitch)
    height, width = scan.grid.shape
    fit = _simplest_camera(points, pixels, (height, width), axis)
    turning = _from_angles(scan, fit)
    if turning is not None:
        return turning
    if fit and fit.camera.model is CameraModel.PINHOLE:
        return _with_camera(scan, fit)
    if fit:
        return _with_camera(scan, fit, *notes)
    if sight.is_oblique:
        notes = (OBLIQUE_NOTE, *notes)
    note = "no camera fits the grid; its line of sight was fitted"
    return _with_direction(scan, axis, sight.right, Viewpoint.FITTED, note, *notes)


def _from_angles(scan: RangeScan, other: CameraFit | None = None) -> RangeScan | None:
    """The scan with a spherical camera, if its grid shows one clearly better than another camera.

    A pinhole comes near it where the scan is narrow, but stands elsewhere.
    """
    if other is not None and other.rms < SAME_RMS_PIXELS:
        return None
    found = fit_spherical(scan)
    if found is None or (other is not None and SAME_RMS_RATIO * found[0].rms > other.rms):
        return None
    fit, grid = found
    return _with_camera(replace(scan, grid=grid), fit)


def _simplest_camera(
    points: FloatArray, pixels: FloatArray, shape: tuple[int, int], viewing: FloatArray
) -> CameraFit | None:
    """An orthographic camera unless a pinhole is clearly better; None if neither will do."""
    orthographic = fit_orthographic(points, pixels, shape, viewing)
    if orthographic and orthographic.rms < SAME_RMS_PIXELS:
        return orthographic
    pinhole = fit_pinhole(points, pixels, shape)
    if orthographic and not (pinhole and SAME_RMS_RATIO * pinhole.rms < orthographic.rms):
        return orthographic
    return pinhole


def _from_surface(scan: RangeScan) -> RangeScan:
    """Estimate the viewing direction of points or a mesh without a usable grid."""
    points = surface_points(scan)
    axis, right, layered = line_of_sight_of_points(points)
    cell = IMAGE_SPACINGS * point_spacing(points)
    axis, notes = _sided(scan, axis, depth_image(points, axis, right, cell), cell)
    if layered > MAX_LAYERED:
        notes = (COMPLETE_NOTE, *notes)
    note = "the file does not give the viewpoint; it was estimated from the surface"
    return _with_direction(scan, axis, right, Viewpoint.ESTIMATED, note, *notes)


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
