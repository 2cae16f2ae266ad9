"""What two sensors say of every pixel of each other's scans, where samples leave poses tied."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.field import (
    RASTER_DEPTH,
    RASTER_KIND,
    RASTER_NORMAL,
    RASTER_OUTSIDE,
    ScanField,
)
from scanweld.evidence.visibility import pose_rows
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind

MAX_FEATURE_AREA = 0.02
"""Of a mark and what it comes to lie on, in squared diameters."""
FREE_MARGIN_PIXELS = 1
"""All pixels so near are free where a sensor looks past the object: outlines are a pixel off."""
MIN_FACING = 0.1
"""Cosine of incidence below which a sensor may miss a surface instead of looking past it."""

IS_SURFACE, IS_FREE = float(PixelKind.SURFACE), float(PixelKind.FREE)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Seen:
    """All pixels of a scan in what another one saw, at a pose.

    Attributes:
        behind: (H, W) distance behind the other scan's surface; NaN without a say.
        lands: (H, W) index of the pixel that they fall on; -1 without a say.
        in_free_space: (H, W) pixels where the other sensor looked past the object.
        max_pixels: So many may a mark and what it comes to lie on have in this scan.
    """

    behind: NDArray[np.float32]
    lands: NDArray[np.int32]
    in_free_space: BoolArray
    max_pixels: float


TwoWay = tuple[Seen, Seen]
"""Of the pixels of i in what j saw, and of those of j in what i saw."""


def see(i: ScanField, j: ScanField, i_from_j: Pose, diameter: float) -> TwoWay:
    """All pixels of both scans in what the other saw."""
    forward, backward = pose_rows([i_from_j, i_from_j.inverse()])
    of_i = _seen(i.camera, i.raster, j.camera, j.raster, backward, j.jump_pixels)
    of_j = _seen(j.camera, j.raster, i.camera, i.raster, forward, i.jump_pixels)
    return (
        Seen(
            behind=of_i[0],
            lands=of_i[1],
            in_free_space=of_i[2],
            max_pixels=_max_pixels(i, diameter),
        ),
        Seen(
            behind=of_j[0],
            lands=of_j[1],
            in_free_space=of_j[2],
            max_pixels=_max_pixels(j, diameter),
        ),
    )


def _max_pixels(scan: ScanField, diameter: float) -> float:
    """How many of a scan's pixels the largest mark and what it lies on may have."""
    footprint = (scan.centre[2] if scan.camera[0] == 0.0 else 1.0) / scan.camera[1]
    return float(MAX_FEATURE_AREA * (diameter / footprint) ** 2)


def fallen_on(seen: Seen, mask: BoolArray, shape: tuple[int, ...]) -> BoolArray:
    """Pixels of the other scan, of that shape, that some pixels of this one fall on."""
    hit = np.zeros(shape, dtype=bool)
    hit.ravel()[seen.lands[mask]] = True
    return hit


@njit(cache=True, nogil=True)
def _seen(
    camera_from: FloatArray,
    raster_from: NDArray[np.float32],
    camera_to: FloatArray,
    raster_to: NDArray[np.float32],
    pose: FloatArray,
    jump_pixels: float,
) -> tuple[NDArray[np.float32], NDArray[np.int32], BoolArray]:
    """What Seen says of the pixels (H, W) of one scan in another's raster; the pose is to_from."""
    height, width = raster_from.shape[0], raster_from.shape[1]
    rows, columns = raster_to.shape[0], raster_to.shape[1]
    behind = np.full((height, width), np.nan, dtype=np.float32)
    lands = np.full((height, width), -1, dtype=np.int32)
    in_free_space = np.zeros((height, width), dtype=np.bool_)
    is_pinhole = camera_to[0] == 0.0
    for r in range(height):
        for c in range(width):
            if raster_from[r, c, RASTER_KIND] != IS_SURFACE:
                continue
            depth = float(raster_from[r, c, RASTER_DEPTH])
            a, b = (c - camera_from[3]) / camera_from[1], (r - camera_from[4]) / camera_from[2]
            if camera_from[0] == 0.0:
                a *= depth
                b *= depth
            x = pose[0] * a + pose[1] * b + pose[2] * depth + pose[9]
            y = pose[3] * a + pose[4] * b + pose[5] * depth + pose[10]
            z = pose[6] * a + pose[7] * b + pose[8] * depth + pose[11]
            if is_pinhole and z <= 0.0:
                continue
            away = z if is_pinhole else 1.0
            u, v = camera_to[1] * x / away + camera_to[3], camera_to[2] * y / away + camera_to[4]
            if not (0.0 <= u < columns - 1.0 and 0.0 <= v < rows - 1.0):
                continue
            if _is_free_around(raster_to, int(v), int(u)):
                in_free_space[r, c] = (
                    _facing(raster_from, r, c, pose, (x, y, z), is_pinhole) > MIN_FACING
                )
                continue
            surface = _surface_at(raster_to, u, v, 1.0 / camera_to[1], jump_pixels, is_pinhole)
            if np.isnan(surface):
                continue
            p, q = int(v + 0.5), int(u + 0.5)
            nx = float(raster_to[p, q, RASTER_NORMAL])
            ny = float(raster_to[p, q, RASTER_NORMAL + 1])
            nz = float(raster_to[p, q, RASTER_NORMAL + 2])
            # A step along the ray, as a distance from the surface.
            tilt = abs(nx * x + ny * y + nz * z) / z if is_pinhole else abs(nz)
            behind[r, c] = (z - surface) * min(tilt, 1.0)
            lands[r, c] = p * columns + q
    return behind, lands, in_free_space


@njit(cache=True, nogil=True)
def _surface_at(
    raster: NDArray[np.float32],
    u: float,
    v: float,
    pixel: float,
    jump_pixels: float,
    is_pinhole: bool,
) -> float:
    """Depth between four pixels, each so wide at a depth of 1; NaN if they make no surface.

    They make none if their depths differ by more than a depth jump, in footprints.
    """
    q, p = int(u), int(v)
    low, high, depth = np.inf, -np.inf, 0.0
    for dp in range(2):
        for dq in range(2):
            if raster[p + dp, q + dq, RASTER_KIND] != IS_SURFACE:
                return np.nan
            at = float(raster[p + dp, q + dq, RASTER_DEPTH])
            low, high = min(low, at), max(high, at)
            across = u - q if dq == 1 else 1.0 - (u - q)
            along = v - p if dp == 1 else 1.0 - (v - p)
            depth += across * along * at
    footprint = pixel * low if is_pinhole else pixel
    return depth if high - low <= jump_pixels * footprint else np.nan


@njit(cache=True, nogil=True)
def _is_free_around(raster: NDArray[np.float32], row: int, column: int) -> bool:
    """Whether all pixels are free near the four of which the given one is the first."""
    for p in range(row - FREE_MARGIN_PIXELS, row + FREE_MARGIN_PIXELS + 2):
        for q in range(column - FREE_MARGIN_PIXELS, column + FREE_MARGIN_PIXELS + 2):
            if not (0 <= p < raster.shape[0] and 0 <= q < raster.shape[1]):
                return False
            if raster[p, q, RASTER_KIND] != IS_FREE or raster[p, q, RASTER_OUTSIDE] <= 0.0:
                return False
    return True


@njit(cache=True, nogil=True)
def _facing(
    raster: NDArray[np.float32],
    row: int,
    column: int,
    pose: FloatArray,
    at: tuple[float, float, float],
    is_pinhole: bool,
) -> float:
    """Cosine of a pixel's incidence for another sensor, where it lies there; to_from is the pose.

    Negative where that sensor sees the back.
    """
    n = raster[row, column, RASTER_NORMAL : RASTER_NORMAL + 3]
    nx = pose[0] * n[0] + pose[1] * n[1] + pose[2] * n[2]
    ny = pose[3] * n[0] + pose[4] * n[1] + pose[5] * n[2]
    nz = pose[6] * n[0] + pose[7] * n[1] + pose[8] * n[2]
    if not is_pinhole:
        return -nz
    x, y, z = at
    return -(nx * x + ny * y + nz * z) / np.sqrt(x * x + y * y + z * z)
