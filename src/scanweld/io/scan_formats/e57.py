"""E57 of ASTM: scans with grid, pose, normals and colours.

Specification: ASTM E2807, with the extension for normals. Points and grids are read by the library
libE57 (through pye57) in each scan's own frame; what its flags call invalid is nothing.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.pose import Pose
from scanweld.io.matrices import rotation_of_quaternion
from scanweld.io.raw import RawScan, side_by_side, to_bytes
from scanweld.io.scan_formats.records import Keeps, Part, ScanFormat, needed
from scanweld.io.viewed_from import viewpoint_told

_POINTS = ("cartesianX", "cartesianY", "cartesianZ")
_ANGLES = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_NORMALS = ("nor:normalX", "nor:normalY", "nor:normalZ")
_COLORS = ("colorRed", "colorGreen", "colorBlue")
_OTHERS = ("intensity", "rowIndex", "columnIndex", "cartesianInvalidState", "sphericalInvalidState")
_MOST_POINTS_A_BYTE = 8
"""Points are packed into bits; a file that claims to hold more is broken."""
_MOST_CELLS_A_POINT = 100
"""A grid that is emptier than this does not hold the points' rows and columns."""

Columns = Mapping[str, FloatArray]
Answer = TypeVar("Answer")


def read_e57(path: Path, data: bytes) -> list[Part]:
    """The scans of an E57 file.

    Args:
        path: The file, which the library opens itself.
        data: Not used.

    Raises:
        ReadError: If pye57 is not installed, or the file is broken.
    """
    pye57 = needed(path, "pye57", "e57")
    file = _asked(path, lambda: pye57.E57(str(path)))
    try:
        headers = _asked(path, lambda: [file.get_header(k) for k in range(file.scan_count)])
        names = [_asked(path, partial(_name, header)) for header in headers]
    finally:
        file.close()
    is_told = len(set(names)) == len(names) and all(names)
    return [
        Part(name=name if is_told else "", read=partial(_read_part, path, k))
        for k, name in enumerate(names)
    ]


def _asked(path: Path, question: Callable[[], Answer]) -> Answer:
    """What the library answers, whose exceptions are of many kinds."""
    try:
        return question()
    except ReadError:
        raise
    except Exception as error:
        told = " ".join(str(error).partition("*")[0].split())[:100]
        raise ReadError(
            f"{path}: not an E57 file, or a broken one ({told}); copy it again or export it anew"
        ) from error


def _name(header: Any) -> str:
    return " ".join(str(header["name"].value()).split()) if "name" in header.scan_fields else ""


def _read_part(path: Path, index: int) -> RawScan:
    pye57 = needed(path, "pye57", "e57")
    file = _asked(path, lambda: pye57.E57(str(path)))
    try:
        return _asked(path, lambda: _scan(path, file, file.get_header(index)))
    finally:
        file.close()


def _scan(path: Path, file: Any, header: Any) -> RawScan:
    columns = _columns(path, file, header)
    points = _points(path, columns)
    pose = _pose(header)
    grid, notes = _grid(columns)
    sensor = None
    if grid is None:
        # A scanner stands at the origin of its frame, if this is its frame.
        is_moved = pose is not None or _ANGLES[0] in columns
        sensor, told = viewpoint_told(points, np.zeros(3), not is_moved, "frame's origin")
        notes += told
    normals = [columns[name] for name in _NORMALS if name in columns]
    return RawScan(
        points=points,
        grid=grid,
        normals=side_by_side(normals) if len(normals) == 3 else None,
        colors=_colors(header, columns),
        intensity=_intensity(header, columns),
        scan_from_sensor=sensor,
        world_from_scan=pose,
        notes=notes,
    )


def _columns(path: Path, file: Any, header: Any) -> Columns:
    """What is known of the points (N,), by the names of the fields."""
    libe57 = needed(path, "pye57.libe57", "e57")
    count = int(header.point_count)
    if count > _MOST_POINTS_A_BYTE * path.stat().st_size:
        raise ReadError(f"{path}: says {count} points, more than it can hold; copy it again")
    if not count:
        raise ReadError(f"{path}: holds no points; leave it out")
    wanted = [
        name
        for name in (*_POINTS, *_ANGLES, *_NORMALS, *_COLORS, *_OTHERS)
        if name in header.point_fields
    ]
    if set(_POINTS) <= set(wanted):
        wanted = [name for name in wanted if name not in _ANGLES]
    columns = {name: np.zeros(count) for name in wanted}
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in columns.items():
        buffers.append(libe57.SourceDestBuffer(file.image_file, name, column, count, True, True))
    found = header.points.reader(buffers).read()
    if found != count:
        raise ReadError(f"{path}: holds {found} points but says {count}; copy it again")
    return columns


def _points(path: Path, columns: Columns) -> FloatArray:
    """The points (N, 3) in the scan's frame, NaN where its scanner saw nothing."""
    if all(name in columns for name in _POINTS):
        points, state = side_by_side([columns[name] for name in _POINTS]), "cartesian"
    elif all(name in columns for name in _ANGLES):
        distance, azimuth, elevation = (columns[name] for name in _ANGLES)
        flat = distance * np.cos(elevation)
        parts = [flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation)]
        points, state = side_by_side(parts), "spherical"
    else:
        raise ReadError(f"{path}: its points have neither x, y, z nor angles; export it anew")
    invalid = columns.get(f"{state}InvalidState")
    if invalid is not None:
        points[invalid != 0] = np.nan
    return points


def _pose(header: Any) -> Pose | None:
    """world_from_scan, where the file has one; its parts that are left out change nothing."""
    if not header.has_pose():
        return None
    pose = header["pose"]
    turn, shift = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
    if pose.isDefined("rotation"):
        turn = np.array([number_of(pose["rotation"][axis]) for axis in "xyzw"])
    if pose.isDefined("translation"):
        shift = np.array([number_of(pose["translation"][axis]) for axis in "xyz"])
    return Pose(rotation=rotation_of_quaternion(turn), translation=shift)


def _grid(columns: Columns) -> tuple[IntArray | None, tuple[str, ...]]:
    """The grid (rows, columns) of the points, and notes on it."""
    if "rowIndex" not in columns or "columnIndex" not in columns:
        return None, ()
    rows, cols = (columns[name] - columns[name].min() for name in ("rowIndex", "columnIndex"))
    height, width = int(rows.max()) + 1, int(cols.max()) + 1
    if min(height, width) < 2:
        return None, ()
    if height * width > _MOST_CELLS_A_POINT * len(rows) or (rows % 1).any() or (cols % 1).any():
        return None, ("its rows and columns are no grid, so they were left out",)
    cells = (rows * width + cols).astype(np.int64)
    grid = np.full(height * width, -1, dtype=np.int64)
    grid[cells[::-1]] = np.arange(len(cells))[::-1]
    grid = grid.reshape(height, width)
    extra = len(cells) - int((grid >= 0).sum())
    return grid, (f"{extra} further returns of the same rays are in no cell",) if extra else ()


def _colors(header: Any, columns: Columns) -> ByteArray | None:
    found = [columns[name] for name in _COLORS if name in columns]
    if len(found) != 3:
        return None
    top = _limit(header, "colorLimits", "colorRedMaximum")
    return _scaled(side_by_side(found), 0.0, top)


def _intensity(header: Any, columns: Columns) -> ByteArray | None:
    if "intensity" not in columns:
        return None
    limits = [
        _limit(header, "intensityLimits", f"intensity{end}") for end in ("Minimum", "Maximum")
    ]
    return _scaled(columns["intensity"], limits[0] or 0.0, limits[1])


def _limit(header: Any, limits: str, name: str) -> float | None:
    if limits not in header.scan_fields or not header[limits].isDefined(name):
        return None
    return number_of(header[limits][name])


def number_of(node: Any) -> float:
    """The number of a node, whole, scaled or floating point; limits are what they limit."""
    return float(node.scaledValue() if hasattr(node, "scaledValue") else node.value())


def _scaled(values: FloatArray, low: float, top: float | None) -> ByteArray | None:
    """Values between limits as 0 to 255; without limits, by what they look like."""
    if top is None or not top > low:
        return to_bytes(values, "u2" if values.max(initial=0) > 1 else "f8")
    return to_bytes(np.clip((values - low) / (top - low), 0.0, 1.0), "f8")


FORMAT = ScanFormat(
    suffixes=(".e57",),
    read=read_e57,
    keeps=(Keeps.SCANS, Keeps.GRID, Keeps.SENSOR, Keeps.POSE, Keeps.NORMALS, Keeps.COLORS),
    extra="e57",
    opens_path=True,
    begins=(b"ASTM-E57",),
)
