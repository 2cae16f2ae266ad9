"""The spherical camera behind a grid of angles, as scanners on a tripod make them.

The scanner stands at the origin of the scan's frame and turns about the frame's z axis: columns
count azimuths, rows elevations. That is how PTX and E57 files hold such scans.
"""

import numpy as np

from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray, IndexArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.scan import MOST_BEHIND, RangeScan
from scanweld.preparation.camera_fit import MAX_RMS_PIXELS, CameraFit


def fit_spherical(scan: RangeScan) -> tuple[CameraFit, IntArray] | None:
    """The spherical camera at the origin that sees the grid's points in their cells, or None.

    Args:
        scan: With a grid. A grid around the whole horizon may begin anywhere on the object.

    Returns:
        The camera, whose z axis is level and looks to the middle of the points, and the grid
        turned so that it does not begin on the object.

    Raises:
        InputError: If there is such a camera, and it stands amid the points.
    """
    if scan.grid is None:
        return None
    step = _azimuth_step(scan.points, scan.grid)
    if step is None:
        return None
    grid = _begun_elsewhere(scan.grid, step)
    rows, columns = np.nonzero(grid >= 0)
    points = scan.points[grid[rows, columns]]
    azimuth = _unwrapped(np.arctan2(points[:, 1], points[:, 0]), step * columns.astype(np.float64))
    ahead = float(azimuth.mean())
    azimuth = azimuth - ahead
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    u, v = _line(azimuth, columns), _line(elevation, rows)
    if u is None or v is None:
        return None
    rms = float(np.hypot(u[2], v[2]))
    if not rms <= MAX_RMS_PIXELS:
        return None
    if (np.abs(azimuth) > np.pi / 2).mean() > MOST_BEHIND:
        raise InputError(
            f"{scan.name}: the scanner stands amid what it saw; cut the object out of the scan"
        )
    # With y along +z or -z of the frame both angles grow alike: else the grid is a mirror image.
    is_mirrored = bool(u[0] * v[0] < 0)
    side = float(np.sign(u[0]))
    look = np.array([np.cos(ahead), np.sin(ahead), 0.0])
    down = np.array([0.0, 0.0, side])
    camera = Camera(
        model=CameraModel.SPHERICAL,
        width=grid.shape[1],
        height=grid.shape[0],
        fx=abs(u[0]),
        fy=abs(v[0]),
        cx=u[1],
        cy=grid.shape[0] - 1 - v[1] if is_mirrored else v[1],
    )
    rotation = nearest_rotation(np.stack([np.cross(down, look), down, look]))
    pose = Pose(rotation=rotation, translation=np.zeros(3))
    fit = CameraFit(camera=camera, sensor_from_scan=pose, is_mirrored=is_mirrored, rms=rms)
    return fit, grid


def _azimuth_step(points: FloatArray, grid: IndexArray) -> float | None:
    """Median turn, in radians, from a column to the next."""
    is_pair = (grid[:, :-1] >= 0) & (grid[:, 1:] >= 0)
    if not is_pair.any():
        return None
    left, right = points[grid[:, :-1][is_pair]], points[grid[:, 1:][is_pair]]
    turns = np.arctan2(right[:, 1], right[:, 0]) - np.arctan2(left[:, 1], left[:, 0])
    step = float(np.median(_wrapped(turns)))
    return step if abs(step) > 0 else None


def _begun_elsewhere(grid: IndexArray, step: float) -> IndexArray:
    """The grid, begun half a turn later if it goes around and there are points at its seam."""
    width = grid.shape[1]
    missing = round(2 * np.pi / abs(step)) - width
    if (
        not ((grid[:, 0] >= 0).any() and (grid[:, -1] >= 0).any())
        or not -1 <= missing <= width // 100 + 1
    ):
        return grid
    gap = np.full((grid.shape[0], max(missing, 0)), -1, dtype=grid.dtype)
    half = width // 2
    return np.concatenate([grid[:, half:], gap, grid[:, :half]], axis=1)


def _line(angle: FloatArray, cells: IntArray) -> tuple[float, float, float] | None:
    """Slope, offset and residual of the line cells = slope angle + offset, if it has a slope."""
    centred = angle - angle.mean()
    spread = float(centred @ centred)
    if not spread > 0:
        return None
    slope = float(centred @ (cells - cells.mean())) / spread
    offset = float(cells.mean() - slope * angle.mean())
    rms = float(np.sqrt(((slope * angle + offset - cells) ** 2).mean()))
    return (slope, offset, rms) if slope else None


def _unwrapped(angle: FloatArray, expected: FloatArray) -> FloatArray:
    """Angles, up to whole turns, as they are expected up to a common turn."""
    off = angle - expected
    common = np.arctan2(np.sin(off).mean(), np.cos(off).mean())
    return expected + common + _wrapped(off - common)


def _wrapped(angle: FloatArray) -> FloatArray:
    """The angle between -pi and pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
