"""The range scan: points with what their sensor knew."""

import hashlib
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, IndexArray, IntArray, frozen
from scanweld.geometry.camera import Camera
from scanweld.geometry.pose import Pose

MOST_BEHIND = 0.01
"""Share of the points, strays, that may lie behind a sensor which is said to have seen them."""


class Viewpoint(StrEnum):
    """How it is known where a scan's sensor stood."""

    GIVEN = "given"
    FITTED = "fitted"
    ESTIMATED = "estimated"
    UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RangeScan:
    """One range image, mesh or point set from one viewpoint, in the coordinates of its file.

    Attributes:
        name: Unique in a run; the file's stem.
        points: (N, 3), finite, scan frame, unit of the file.
        grid: (H, W) index of each cell's point, -1 where nothing was seen; or None.
            Of 32 bits, whatever is given.
        seen_beyond: (H, W) cells in which the sensor saw what lies behind, and was cut off: there
            is nothing before it. In other empty cells nothing came back, which says nothing. None
            where nothing was cut off: an empty cell may be either.
        faces: (M, 3) indices of points, where the file was a mesh; or None.
        normals: (N, 3) or None, as the file gave them.
        colors: (N, 3) uint8 or None.
        confidence: (N,) or None, as the file gave it.
        camera: Intrinsics, or None where unknown. With a grid, its pixels are the grid's cells.
        scan_from_sensor: Where the sensor stood; None where unknown. A scan with an orthographic
            camera, or without a camera, uses of it only the viewing direction (its z axis).
        world_from_scan: Where the file says the scan belongs, in a frame that its scans share; or
            None. Nothing is believed of it, and it is no part of the content.
        viewpoint: How scan_from_sensor is known.
        num_dropped: NaN and infinite points that were left out on reading.
        notes: What was assumed about this scan, in words, for the report.

    Raises:
        ValueError: If shapes or indices do not fit, or a point is not finite.
    """

    name: str
    points: FloatArray
    grid: IndexArray | None = None
    seen_beyond: BoolArray | None = None
    faces: IntArray | None = None
    normals: FloatArray | None = None
    colors: ByteArray | None = None
    confidence: FloatArray | None = None
    camera: Camera | None = None
    scan_from_sensor: Pose | None = None
    world_from_scan: Pose | None = None
    viewpoint: Viewpoint = Viewpoint.UNKNOWN
    num_dropped: int = 0
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        n = len(self.points)
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("points", frozen(self.points, np.float64, (None, 3)))
        if not np.isfinite(self.points).all():
            raise ValueError("a scan's points must be finite")
        if self.grid is not None:
            if np.size(self.grid) and (np.max(self.grid) >= n or np.min(self.grid) < -1):
                raise ValueError("the grid names points that do not exist")
            put("grid", frozen(self.grid, np.int32, (None, None)))
        if self.seen_beyond is not None:
            shape = (-1,) if self.grid is None else self.grid.shape
            put("seen_beyond", frozen(self.seen_beyond, np.bool_, shape))
        if self.faces is not None:
            put("faces", frozen(self.faces, np.int64, (None, 3)))
            if self.faces.size and (self.faces.max() >= n or self.faces.min() < 0):
                raise ValueError("the faces name points that do not exist")
        if self.normals is not None:
            put("normals", frozen(self.normals, np.float64, (n, 3)))
        if self.colors is not None:
            put("colors", frozen(self.colors, np.uint8, (n, 3)))
        if self.confidence is not None:
            put("confidence", frozen(self.confidence, np.float64, (n,)))
        if (self.scan_from_sensor is None) != (self.viewpoint is Viewpoint.UNKNOWN):
            raise ValueError("a scan's viewpoint is unknown exactly where it has no sensor pose")

    def with_sensor(
        self,
        scan_from_sensor: Pose,
        viewpoint: Viewpoint,
        *notes: str,
        camera: Camera | None = None,
    ) -> "RangeScan":
        """The same scan with the sensor found; notes are added to the scan's own."""
        return replace(
            self,
            scan_from_sensor=scan_from_sensor,
            viewpoint=viewpoint,
            camera=self.camera if camera is None else camera,
            notes=self.notes + notes,
        )

    def only(self, kept: BoolArray) -> "RangeScan":
        """The scan with some of its points (N,) only; faces that lose a corner are dropped."""
        number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
        faces = None if self.faces is None else number[self.faces]
        return replace(
            self,
            points=self.points[kept],
            grid=None if self.grid is None else number[self.grid],
            faces=None if faces is None else faces[(faces >= 0).all(axis=1)],
            normals=None if self.normals is None else self.normals[kept],
            colors=None if self.colors is None else self.colors[kept],
            confidence=None if self.confidence is None else self.confidence[kept],
        )

    @property
    def sensor_pose(self) -> Pose:
        """``scan_from_sensor`` of a scan whose sensor is located.

        Raises:
            ValueError: If it is not.
        """
        if self.scan_from_sensor is None:
            raise ValueError(f"{self.name}: it is unknown where the sensor stood")
        return self.scan_from_sensor

    def content_hash(self) -> str:
        """A hash of everything measured, without the name: the same content gives the same hash."""
        digest = hashlib.sha256()
        grid = None if self.grid is None else self.grid.astype(np.int64)
        parts = (self.points, grid, self.faces, self.normals, self.colors, self.confidence)
        for part in parts:
            digest.update(b"-" if part is None else repr(part.shape).encode() + part.tobytes())
        if self.seen_beyond is not None:
            digest.update(np.packbits(self.seen_beyond).tobytes())
        digest.update(repr(self.camera).encode())
        if self.scan_from_sensor is not None:
            digest.update(self.scan_from_sensor.matrix().tobytes())
        return digest.hexdigest()


def principal_diameter(points: FloatArray) -> float:
    """Diagonal of the points' box along their principal axes, strays removed (motion-invariant).

    Strays are points outside the 0.1 and 99.9 percentiles, by more than 5 % of that range.
    """
    centred = points - np.median(points, axis=0)
    _, axes = np.linalg.eigh(np.cov(centred.T))
    along = centred @ axes
    low, high = np.percentile(along, [0.1, 99.9], axis=0)
    slack = 0.05 * (high - low)
    kept: BoolArray = ((along >= low - slack) & (along <= high + slack)).all(axis=1)
    inside = along[kept]
    return float(np.linalg.norm(inside.max(axis=0) - inside.min(axis=0)))
