"""What two sensors say of every pixel of each other's scans, where samples leave poses tied."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind
from scanweld.pairs.field import RASTER_DEPTH, RASTER_KIND, RASTER_NORMAL, ScanField
from scanweld.pairs.visibility import pose_rows

JUMP_PIXELS = 6.0
"""Depths of four neighbouring pixels that differ by more, in footprints, make no surface."""
AGREE_TOLERANCES = 0.5
"""Farthest that a pixel lies from the other scan's surface where it agrees with it."""
MIN_PATCH_PIXELS = 8
"""Pixels that hang together and all say the same, at least, to be told from chance."""
MAJORITY = 0.6
"""Share of the 3 x 3 pixels around one that must say the same: strips along edges are too thin."""
MAX_MARK_AREA = 0.02
"""Of a mark and what it comes to lie on, in squared diameters."""

IS_SURFACE = float(PixelKind.SURFACE)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Seen:
    """All pixels of a scan in what another one saw, at a pose.

    Attributes:
        behind: (H, W) distance behind the other scan's surface; NaN without a say.
        lands: (H, W) index of the pixel that they fall on; -1 without a say.
        max_pixels: So many may a mark and what it comes to lie on have in this scan.
    """

    behind: NDArray[np.float32]
    lands: NDArray[np.int32]
    max_pixels: float


TwoWay = tuple[Seen, Seen]
"""Of the pixels of i in what j saw, and of those of j in what i saw."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Told:
    """What the sensors of several scans say of all pixels of another one.

    Attributes:
        agrees: (H, W) pixels that lie on the surface that any of them saw, and before none.
        violates: (H, W) pixels of patches that lie before the surface that any of them saw.
        max_pixels: So many may a mark and what it comes to lie on have.
    """

    agrees: BoolArray
    violates: BoolArray
    max_pixels: float


def see(i: ScanField, j: ScanField, i_from_j: Pose, diameter: float) -> TwoWay:
    """All pixels of both scans in what the other saw."""
    forward, backward = pose_rows([i_from_j, i_from_j.inverse()])
    of_i = _seen(i.camera, i.raster, j.camera, j.raster, backward)
    of_j = _seen(j.camera, j.raster, i.camera, i.raster, forward)
    return (
        Seen(behind=of_i[0], lands=of_i[1], max_pixels=_max_pixels(i, diameter)),
        Seen(behind=of_j[0], lands=of_j[1], max_pixels=_max_pixels(j, diameter)),
    )


def _max_pixels(scan: ScanField, diameter: float) -> float:
    """How many of a scan's pixels the largest mark and what it lies on may have."""
    footprint = (scan.centre[2] if scan.camera[0] == 0.0 else 1.0) / scan.camera[1]
    return float(MAX_MARK_AREA * (diameter / footprint) ** 2)


def told_of(seen: Sequence[Seen], tolerance: float) -> Told:
    """Sum up what several sensors say of the pixels of one scan."""
    violates = np.any([one.behind < -tolerance for one in seen], axis=0)
    agree = np.any([agrees(one.behind, tolerance) for one in seen], axis=0)
    return Told(
        agrees=agree & ~violates, violates=coherent(violates), max_pixels=seen[0].max_pixels
    )


def agrees(behind: NDArray[np.float32], tolerance: float) -> BoolArray:
    """Which pixels lie on the surface that the other scan saw."""
    return np.abs(behind) < AGREE_TOLERANCES * tolerance


def fallen_on(seen: Seen, mask: BoolArray, shape: tuple[int, ...]) -> BoolArray:
    """Pixels of the other scan, of that shape, that some pixels of this one fall on."""
    hit = np.zeros(shape, dtype=bool)
    hit.ravel()[seen.lands[mask]] = True
    return hit


def coherent(said: BoolArray) -> BoolArray:
    """Those pixels of a mask that hang together in sufficient numbers."""
    if np.count_nonzero(said) < MIN_PATCH_PIXELS:
        return np.zeros_like(said)
    most = ndimage.uniform_filter(said.astype(np.float32), 3, mode="constant") > MAJORITY
    labels = np.zeros(said.shape, dtype=np.int32)
    ndimage.label(most & said, output=labels)
    is_large = np.bincount(labels.ravel()) >= MIN_PATCH_PIXELS
    is_large[0] = False
    return is_large[labels]


@njit(cache=True, nogil=True)
def _seen(
    camera_from: FloatArray,
    raster_from: NDArray[np.float32],
    camera_to: FloatArray,
    raster_to: NDArray[np.float32],
    pose: FloatArray,
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """How far behind (H, W) one scan's pixels lie in another's raster, and where they fall on it.

    The pose row is to_from.
    """
    height, width = raster_from.shape[0], raster_from.shape[1]
    rows, columns = raster_to.shape[0], raster_to.shape[1]
    behind = np.full((height, width), np.nan, dtype=np.float32)
    lands = np.full((height, width), -1, dtype=np.int32)
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
            u, v = camera_to[1] * x, camera_to[2] * y
            if camera_to[0] == 0.0:
                if z <= 0.0:
                    continue
                u /= z
                v /= z
            u += camera_to[3]
            v += camera_to[4]
            if not (0.0 <= u < columns - 1.0 and 0.0 <= v < rows - 1.0):
                continue
            q, p = int(u), int(v)
            low, high, seen = np.inf, -np.inf, 0.0
            is_surface = True
            for dp in range(2):
                for dq in range(2):
                    if raster_to[p + dp, q + dq, RASTER_KIND] != IS_SURFACE:
                        is_surface = False
                    at = float(raster_to[p + dp, q + dq, RASTER_DEPTH])
                    low, high = min(low, at), max(high, at)
                    across = u - q if dq == 1 else 1.0 - (u - q)
                    along = v - p if dp == 1 else 1.0 - (v - p)
                    seen += across * along * at
            footprint = 1.0 / camera_to[1]
            if camera_to[0] == 0.0:
                footprint *= low
            if not is_surface or high - low > JUMP_PIXELS * footprint:
                continue
            near_p, near_q = int(v + 0.5), int(u + 0.5)
            n = RASTER_NORMAL
            nx = float(raster_to[near_p, near_q, n])
            ny = float(raster_to[near_p, near_q, n + 1])
            nz = float(raster_to[near_p, near_q, n + 2])
            # A step along the ray, as a distance from the surface.
            is_pinhole = camera_to[0] == 0.0
            tilt = abs(nx * x + ny * y + nz * z) / z if is_pinhole else abs(nz)
            behind[r, c] = (z - seen) * min(tilt, 1.0)
            lands[r, c] = near_p * columns + near_q
    return behind, lands
