"""Camera models: how a sensor's pixels look out into space."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from scanweld.geometry.arrays import FloatArray


class CameraModel(IntEnum):
    """How pixel (u, v) and depth make a point (x right, y down, z away from the sensor).

    PINHOLE: u = fx x/z + cx, v = fy y/z + cy, depth = z.
    ORTHOGRAPHIC: u = fx x + cx, v = fy y + cy, depth = z; fx, fy in pixels per unit length.
    SPHERICAL: u = fx atan2(x, z) + cx, v = fy atan2(y, hypot(x, z)) + cy, depth = distance from
    the sensor; fx, fy in pixels per radian.
    """

    PINHOLE = 0
    ORTHOGRAPHIC = 1
    SPHERICAL = 2


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """Intrinsics of a sensor. Pixel centres lie at integers, u counts columns, v rows.

    Attributes:
        model: What the other numbers mean.
        width: Columns.
        height: Rows.
        fx: Focal length along u, see the model for its unit.
        fy: Likewise along v.
        cx: Where the axis meets the image, in columns,
        cy: and in rows.

    Raises:
        ValueError: If there are no pixels, or a number is out of its range.
    """

    model: CameraModel
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError("a camera needs at least one pixel")
        if not (self.fx > 0 and self.fy > 0 and np.isfinite([self.cx, self.cy]).all()):
            raise ValueError("a camera needs positive focal lengths and a finite centre")

    @property
    def parameters(self) -> FloatArray:
        """(5,): model, fx, fy, cx, cy; what compiled kernels take."""
        return np.array([float(self.model), self.fx, self.fy, self.cx, self.cy])

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) as (u, v) and depths (N,) of points (N, 3) in the sensor frame.

        Points beside or behind a pinhole (z <= 0) get NaN pixels.
        """
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        if self.model is CameraModel.ORTHOGRAPHIC:
            a, b, depth = x, y, z
        elif self.model is CameraModel.PINHOLE:
            safe = np.where(z > 0, z, np.nan)
            a, b, depth = x / safe, y / safe, z
        else:
            a, b = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
            depth = np.linalg.norm(points, axis=-1)
        return np.stack([self.fx * a + self.cx, self.fy * b + self.cy], axis=-1), depth

    def unproject(self, pixels: FloatArray, depth: FloatArray) -> FloatArray:
        """Points (N, 3) in the sensor frame of pixels (N, 2) at depths (N,)."""
        a = (pixels[..., 0] - self.cx) / self.fx
        b = (pixels[..., 1] - self.cy) / self.fy
        if self.model is CameraModel.ORTHOGRAPHIC:
            return np.stack([a, b, depth], axis=-1)
        if self.model is CameraModel.PINHOLE:
            return np.stack([a * depth, b * depth, depth], axis=-1)
        return np.stack(
            [depth * np.cos(b) * np.sin(a), depth * np.sin(b), depth * np.cos(b) * np.cos(a)],
            axis=-1,
        )

    def unproject_image(self, depth: FloatArray) -> FloatArray:
        """Points (H, W, 3) of a depth image (H, W); NaN depths give NaN points."""
        rows, columns = np.mgrid[: self.height, : self.width].astype(np.float64)
        return self.unproject(np.stack([columns, rows], axis=-1), depth)

    def view_directions(self, points: FloatArray) -> FloatArray:
        """Unit directions (N, 3), sensor frame, of the rays from the sensor to points (N, 3)."""
        if self.model is CameraModel.ORTHOGRAPHIC:
            return np.broadcast_to(np.array([0.0, 0.0, 1.0]), points.shape)
        return points / np.linalg.norm(points, axis=-1, keepdims=True)

    def footprint(self, depth: float) -> float:
        """Size of a pixel on a surface that faces the sensor at a depth, in the scans' unit."""
        size = 2.0 / (self.fx + self.fy)
        return size if self.model is CameraModel.ORTHOGRAPHIC else size * depth
