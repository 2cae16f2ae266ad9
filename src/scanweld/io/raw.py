"""What every reader hands over, and how it becomes a scan or a mesh."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io.coarseness import refuse_coarse
from scanweld.io.no_points import grid_in_order, seen_points

logger = logging.getLogger(__name__)

POSE_NOTE = "the file has a pose for the scan, which is tried besides others but not believed"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RawScan:
    """A file's content as it stands there: points may be NaN, and indices out of range.

    Attributes as in ``RangeScan``; intensity (N,) uint8 is grey, used where there are no colours.
    Support, stdev and filled (N,) are of a mesh, see ``TriangleMesh``.
    Readers hand their arrays over: nobody writes to them any more, so that scans may share them.
    """

    points: FloatArray
    grid: IntArray | None = None
    faces: IntArray | None = None
    normals: FloatArray | None = None
    colors: ByteArray | None = None
    intensity: ByteArray | None = None
    confidence: FloatArray | None = None
    support: FloatArray | None = None
    stdev: FloatArray | None = None
    filled: FloatArray | None = None
    camera: Camera | None = None
    scan_from_sensor: Pose | None = None
    world_from_scan: Pose | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False


def to_scan(path: Path, name: str, raw: RawScan) -> RangeScan:
    """The scan of a file: points that are none dropped, grid and faces re-indexed.

    They stand for pixels that saw nothing, see ``seen_points``; where it is certain how many pixels
    make a row, the scan gets its grid. Points that lie in no cell of a grid are kept, and the
    scan's notes count them. Normals and confidences that are not finite become zero: nothing is
    known there.

    Raises:
        ReadError: If an index names no point, no point is left, or coordinates come in too large
            steps.
    """
    _check_indices(path, raw)
    seen, notes = seen_points(raw.points, raw.faces)
    dropped = int((~seen).sum())
    if dropped == len(seen):
        told = f" ({notes[0].partition(':')[0]})" if notes else ""
        raise ReadError(f"{path}: holds no points, or none that was seen{told}; leave it out")
    points = raw.points[seen] if dropped else raw.points
    refuse_coarse(path, points, are_vertices=raw.faces is not None and len(raw.faces) > 0)
    notes = raw.notes + notes
    grid = raw.grid
    if dropped and grid is None and raw.faces is None and raw.camera is None:
        grid = grid_in_order(raw.points, seen)
        notes += () if grid is None else ("the points stand in rows, which were read as a grid",)
    faces = raw.faces if raw.faces is not None and len(raw.faces) else None
    if dropped:
        new_index = np.where(seen, np.cumsum(seen) - 1, -1)
        grid = None if grid is None else np.where(grid >= 0, new_index[grid], -1)
        faces = None if faces is None else _whole(new_index[faces])
    colors = raw.colors
    if colors is None and raw.intensity is not None:
        colors = np.repeat(raw.intensity[:, None], 3, axis=1)
        notes += ("intensity read as grey",)
    if grid is not None and (loose := _num_loose(grid, int(seen.sum()))):
        notes += (f"{loose} points lie in no cell of the grid",)
    if raw.world_from_scan is not None and not _is_identity(raw.world_from_scan):
        notes += (POSE_NOTE,)
    if dropped:
        logger.info("%s: %d points dropped", path, dropped)
    return RangeScan(
        name=name,
        points=points,
        grid=grid,
        faces=faces,
        normals=None if raw.normals is None else _zero_unless_finite(raw.normals[seen]),
        colors=None if colors is None else colors[seen],
        confidence=None if raw.confidence is None else _zero_unless_finite(raw.confidence[seen]),
        camera=raw.camera,
        scan_from_sensor=raw.scan_from_sensor,
        world_from_scan=raw.world_from_scan,
        viewpoint=Viewpoint.UNKNOWN if raw.scan_from_sensor is None else Viewpoint.GIVEN,
        num_dropped=dropped,
        notes=notes,
    )


def to_mesh(path: Path, raw: RawScan) -> TriangleMesh:
    """The mesh of a file; vertices that are not finite are dropped with their faces.

    Raises:
        ReadError: If an index names no vertex, or no face is left.
    """
    _check_indices(path, raw)
    finite = np.asarray(np.isfinite(raw.points).all(axis=1))
    new_index = np.where(finite, np.cumsum(finite) - 1, -1)
    faces = np.zeros((0, 3), np.int64) if raw.faces is None else _whole(new_index[raw.faces])
    if not len(faces):
        raise ReadError(f"{path}: has no faces, so it is no mesh; give a file with triangles")
    support = None if raw.support is None else np.nan_to_num(raw.support[finite])
    return TriangleMesh(
        vertices=raw.points[finite],
        faces=faces,
        normals=None if raw.normals is None else _zero_unless_finite(raw.normals[finite]),
        colors=None if raw.colors is None else raw.colors[finite],
        support=None if support is None else support.astype(np.int64),
        stdev=None if raw.stdev is None else raw.stdev[finite],
        filled=None if raw.filled is None else raw.filled[finite] > 0,
    )


def full_grid(rows: int, columns: int) -> IntArray:
    """The grid (rows, columns) of points that stand in its order; those that are NaN leave it."""
    return np.arange(rows * columns, dtype=np.int64).reshape(rows, columns)


def side_by_side(columns: Sequence[NDArray]) -> FloatArray:
    """Columns (N,) of any types as one table (N, k)."""
    values = np.empty((len(columns[0]), len(columns)))
    for k, column in enumerate(columns):
        values[:, k] = column
    return values


def fan_triangles(counts: IntArray, corners: IntArray) -> IntArray:
    """Triangles (M, 3) of polygons: fans about each one's first corner.

    Args:
        counts: (P,) corners of each polygon; those with fewer than three are left out.
        corners: (sum of counts,) vertex indices, polygon after polygon.
    """
    first = np.cumsum(counts) - counts
    sizes = np.maximum(counts - 2, 0)
    begin = np.repeat(first, sizes)
    step = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.stack([corners[begin], corners[begin + step + 1], corners[begin + step + 2]], axis=1)


def to_bytes(values: NDArray, type_code: str = "") -> ByteArray | None:
    """Colours or intensities as 0 to 255; None where their scale cannot be told.

    Args:
        values: Of any shape.
        type_code: NumPy code of the type in which they were stored: floating point up to 1 means
            parts of one, integers of two bytes and more go to 65535 if they pass 255. Where it is
            not known (text), fractions mean floating point.
    """
    has_fractions = bool((values != np.rint(values)).any())
    is_float = type_code.startswith("f") if type_code else has_fractions
    scaled = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    top = float(scaled.max(initial=0.0))
    if is_float and top <= 1.0:
        scaled = scaled * 255.0
    elif type_code in ("i2", "u2", "i4", "u4") and top > 255.0:
        scaled = scaled / 257.0
    if scaled.max(initial=0.0) > 255.5 or scaled.min(initial=0.0) < 0.0:
        return None
    return np.rint(np.minimum(scaled, 255.0)).astype(np.uint8)


def noted_bytes(
    what: str, values: NDArray | None, type_code: str = ""
) -> tuple[ByteArray | None, tuple[str, ...]]:
    """What ``to_bytes`` makes of colours or intensities, and a note where it leaves them out."""
    found = None if values is None else to_bytes(values, type_code)
    if values is None or found is not None:
        return found, ()
    return None, (f"{what} ignored: on no known scale (0 to 1, 0 to 255)",)


def _check_indices(path: Path, raw: RawScan) -> None:
    """Make sure that all indices name points."""
    for what, indices, lowest in (("range grid cells", raw.grid, -1), ("faces", raw.faces, 0)):
        if indices is None or not indices.size:
            continue
        for index in (int(indices.min()), int(indices.max())):
            if not lowest <= index < len(raw.points):
                raise ReadError(
                    f"{path}: its {what} name point {index}, but points go from 0 to "
                    f"{len(raw.points) - 1}; export it anew"
                )


def _is_identity(pose: Pose) -> bool:
    return bool(np.array_equal(pose.matrix(), np.eye(4)))


def _whole(faces: IntArray) -> IntArray:
    """The faces all of whose corners are left."""
    return faces[(faces >= 0).all(axis=1)]


def _num_loose(grid: IntArray, num_points: int) -> int:
    in_grid = np.zeros(num_points, dtype=bool)
    in_grid[grid[grid >= 0]] = True
    return int(num_points - in_grid.sum())


def _zero_unless_finite(values: FloatArray) -> FloatArray:
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
