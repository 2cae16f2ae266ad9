"""Visibility evidence: what each scan's sensor says of the other scan's samples."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.field import (
    RASTER_DEPTH,
    RASTER_KIND,
    RASTER_NORMAL,
    RASTER_OUTSIDE,
    ScanField,
)
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind

AGREE, FRONT, CONTRADICT, FREE, GRAZING, OCCLUDED, UNKNOWN, NEUTRAL = range(8)
IS_SURFACE, IS_FREE = float(PixelKind.SURFACE), float(PixelKind.FREE)
IS_UNKNOWN = float(PixelKind.UNKNOWN)

AGREE_COSINE = 0.75
"""Cosine of the two normals above which they agree,"""
CONTRADICT_COSINE = 0.3
"""and below which they contradict each other; between the two they say nothing."""
MIN_FACING = 0.3
"""Cosine of incidence above which a sensor would have seen a surface that it looks past. Below, and
from behind, returns are lost and scans are trimmed: at right poses what lies in free space has a
median cosine of 0.0 to 0.3, at wrong ones of 0.4 to 0.7."""


def two_way_evidence(
    i: ScanField, j: ScanField, i_from_j: Pose, tolerance: float, max_samples: int = 10**9
) -> tuple[Evidence, Evidence]:
    """Evidence on a relative pose in both directions.

    Args:
        i: First scan.
        j: Second scan.
        i_from_j: The pose, between the sensor frames.
        tolerance: Depth tolerance, in the scans' unit.
        max_samples: Samples of each scan that are asked about, at most.

    Returns:
        What sensor j says of i's samples, and what sensor i says of j's.
    """
    (both,) = evidence_at_poses(i, j, [i_from_j], tolerance, max_samples)
    return both


def evidence_at_poses(
    i: ScanField,
    j: ScanField,
    i_from_j: Sequence[Pose],
    tolerance: float,
    max_samples: int = 10**9,
) -> list[tuple[Evidence, Evidence]]:
    """The same at several poses, in one call of the kernel."""
    shares = evidence_shares(i, j, pose_rows(i_from_j), tolerance, max_samples)
    return [(evidence_of(of_i), evidence_of(of_j)) for of_i, of_j in shares.tolist()]


def evidence_shares(
    i: ScanField, j: ScanField, rows: FloatArray, tolerance: float, max_samples: int = 10**9
) -> FloatArray:
    """Shares (P, 2, 8) of each kind, of i's samples and of j's, at pose rows (P, 12)."""
    counts = count_evidence(*kernel_view(i), *kernel_view(j), rows, max_samples, tolerance)
    return counts / np.maximum(counts.sum(axis=2, keepdims=True), 1)


def mean_evidence(a: Evidence, b: Evidence) -> Evidence:
    """The mean of both directions."""
    names = ("agree", "front", "contradict", "free", "grazing", "occluded", "unknown")
    return Evidence(**{name: 0.5 * (getattr(a, name) + getattr(b, name)) for name in names})


def pose_rows(poses: Sequence[Pose]) -> FloatArray:
    """Poses as rows (N, 12) of a kernel: the rotation row by row, then the translation."""
    rows = np.empty((len(poses), 12))
    for row, pose in zip(rows, poses, strict=True):
        row[:9], row[9:] = pose.rotation.ravel(), pose.translation
    return rows


def kernel_view(
    field: ScanField,
) -> tuple[FloatArray, NDArray[np.float32], FloatArray, FloatArray]:
    """The arrays of a scan that the evidence kernels take."""
    return field.camera, field.raster, field.points, field.normals


def evidence_of(shares: Sequence[float], patches: Sequence[float] = (0.0, 0.0, 0.0)) -> Evidence:
    """Shares (8,) of the kinds, and the three patches, as a record."""
    front_patch, free_patch, inside_patch = patches
    return Evidence(
        agree=shares[AGREE],
        front=shares[FRONT],
        contradict=shares[CONTRADICT],
        free=shares[FREE],
        grazing=shares[GRAZING],
        occluded=shares[OCCLUDED],
        unknown=shares[UNKNOWN],
        front_patch=front_patch,
        free_patch=free_patch,
        inside_patch=inside_patch,
    )


@njit(cache=True, nogil=True, inline="never")
def ask(
    camera: FloatArray,
    raster: NDArray[np.float32],
    x: float,
    y: float,
    z: float,
    nx: float,
    ny: float,
    nz: float,
    tolerance: float,
) -> int:
    """What a sensor says of one oriented point in its frame: one of the kinds above.

    Args:
        camera: (5,) parameters of a pinhole or orthographic camera.
        raster: (H, W, 6) what it saw, see ``ScanField``.
        x: The point in the sensor frame,
        y: likewise,
        z: likewise.
        nx: Its unit normal,
        ny: likewise,
        nz: likewise.
        tolerance: Of depth, in the scans' unit.
    """
    height, width = raster.shape[0], raster.shape[1]
    u, v = camera[1] * x, camera[2] * y
    if camera[0] == 0.0:
        if z <= 0.0:
            return UNKNOWN
        u /= z
        v /= z
    u += camera[3]
    v += camera[4]
    # Beyond the image its border speaks: it is free, unless the object left the field of view.
    clamped_u, clamped_v = min(max(u, 0.0), width - 1.0), min(max(v, 0.0), height - 1.0)
    column, row = int(clamped_u + 0.5), int(clamped_v + 0.5)
    kind = raster[row, column, RASTER_KIND]
    if kind == IS_UNKNOWN:
        return UNKNOWN
    if kind == IS_FREE:
        beyond = abs(u - clamped_u) / camera[1] + abs(v - clamped_v) / camera[2]
        if camera[0] == 0.0:
            beyond *= z
        if raster[row, column, RASTER_OUTSIDE] + beyond <= tolerance:
            return UNKNOWN
        across, length = nz, 1.0
        if camera[0] == 0.0:
            across, length = nx * x + ny * y + nz * z, np.sqrt(x * x + y * y + z * z)
        return FREE if -across > MIN_FACING * length else GRAZING
    step = z - raster[row, column, RASTER_DEPTH]
    if step > tolerance:
        return OCCLUDED
    if step < -tolerance:
        return FRONT
    n = RASTER_NORMAL
    cosine = nx * raster[row, column, n] + ny * raster[row, column, n + 1]
    cosine += nz * raster[row, column, n + 2]
    if cosine > AGREE_COSINE:
        return AGREE
    return CONTRADICT if cosine < CONTRADICT_COSINE else NEUTRAL


@njit(cache=True, nogil=True)
def ask_forward(
    camera: FloatArray,
    raster: NDArray[np.float32],
    point: FloatArray,
    normal: FloatArray,
    pose: FloatArray,
    tolerance: float,
) -> int:
    """What sensor i says of a sample of j, the pose row being i_from_j."""
    return ask(
        camera,
        raster,
        pose[0] * point[0] + pose[1] * point[1] + pose[2] * point[2] + pose[9],
        pose[3] * point[0] + pose[4] * point[1] + pose[5] * point[2] + pose[10],
        pose[6] * point[0] + pose[7] * point[1] + pose[8] * point[2] + pose[11],
        pose[0] * normal[0] + pose[1] * normal[1] + pose[2] * normal[2],
        pose[3] * normal[0] + pose[4] * normal[1] + pose[5] * normal[2],
        pose[6] * normal[0] + pose[7] * normal[1] + pose[8] * normal[2],
        tolerance,
    )


@njit(cache=True, nogil=True)
def ask_backward(
    camera: FloatArray,
    raster: NDArray[np.float32],
    point: FloatArray,
    normal: FloatArray,
    pose: FloatArray,
    tolerance: float,
) -> int:
    """What sensor j says of a sample of i, the pose row being i_from_j."""
    x, y, z = point[0] - pose[9], point[1] - pose[10], point[2] - pose[11]
    return ask(
        camera,
        raster,
        pose[0] * x + pose[3] * y + pose[6] * z,
        pose[1] * x + pose[4] * y + pose[7] * z,
        pose[2] * x + pose[5] * y + pose[8] * z,
        pose[0] * normal[0] + pose[3] * normal[1] + pose[6] * normal[2],
        pose[1] * normal[0] + pose[4] * normal[1] + pose[7] * normal[2],
        pose[2] * normal[0] + pose[5] * normal[1] + pose[8] * normal[2],
        tolerance,
    )


@njit(cache=True, nogil=True)
def count_evidence(
    camera_i: FloatArray,
    raster_i: NDArray[np.float32],
    points_i: FloatArray,
    normals_i: FloatArray,
    camera_j: FloatArray,
    raster_j: NDArray[np.float32],
    points_j: FloatArray,
    normals_j: FloatArray,
    poses: FloatArray,
    max_samples: int,
    tolerance: float,
) -> NDArray[np.int64]:
    """Counts (P, 2, 8) of each kind: of i's samples seen by j, of j's samples seen by i.

    The first arguments are the arrays of both scans, as ``kernel_view`` gives them.

    Args:
        camera_i: (5,).
        raster_i: (H, W, 6).
        points_i: (N, 3).
        normals_i: (N, 3).
        camera_j: (5,).
        raster_j: (H, W, 6).
        points_j: (N, 3).
        normals_j: (N, 3).
        poses: (P, 12) rows of i_from_j.
        max_samples: Samples of each scan that are asked about, at most.
        tolerance: Of depth, in the scans' unit.
    """
    counts = np.zeros((poses.shape[0], 2, 8), dtype=np.int64)
    for p in range(poses.shape[0]):
        pose = poses[p]
        for s in range(min(max_samples, points_i.shape[0])):
            said = ask_backward(camera_j, raster_j, points_i[s], normals_i[s], pose, tolerance)
            counts[p, 0, said] += 1
        for s in range(min(max_samples, points_j.shape[0])):
            said = ask_forward(camera_i, raster_i, points_j[s], normals_j[s], pose, tolerance)
            counts[p, 1, said] += 1
    return counts
