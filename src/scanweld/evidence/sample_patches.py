"""Violating samples that hang together: noise scatters them, a wrong pose makes patches.

At a right pose what lies before the other surface, or in its free space, is a grain here and there.
At a wrong one whole parts of the object do, and however much agrees elsewhere, such a part does not
become smaller. So a pose is judged by its largest patch, not by the sum of all violations.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.field import RASTER_DEPTH, RASTER_KIND, RASTER_NORMAL, ScanField
from scanweld.evidence.visibility import FREE, FRONT, IS_SURFACE, ask_forward, pose_rows
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose


def violating_patches(
    i: ScanField, j: ScanField, i_from_j: Sequence[Pose], tolerance: float
) -> FloatArray:
    """Largest patch before a surface, and largest patch in free space, at each pose: (P, 2).

    They are shares of the samples of a scan; the mean of both directions is taken.

    Args:
        i: First scan.
        j: Second scan.
        i_from_j: The poses, between the sensor frames.
        tolerance: Of the distance from the surface, in the scans' unit.
    """
    forward = _shares(j, i, pose_rows(i_from_j), tolerance)
    backward = _shares(i, j, pose_rows([pose.inverse() for pose in i_from_j]), tolerance)
    return 0.5 * (forward + backward)


def with_patches(evidence: Evidence, patches: FloatArray) -> Evidence:
    """Evidence with the two patches (2,) of its pose."""
    front, free = patches.tolist()
    return replace(evidence, front_patch=front, free_patch=free)


def _shares(here: ScanField, there: ScanField, rows: FloatArray, tolerance: float) -> FloatArray:
    """The patches (P, 2) of one scan's samples for the other's sensor; rows are there_from_here."""
    sizes = _largest_patches(
        there.camera, there.raster, here.points, here.normals, here.neighbours, rows, tolerance
    )
    return sizes / max(len(here.points), 1)


@njit(cache=True, nogil=True)
def _largest_patches(
    camera: FloatArray,
    raster: NDArray[np.float32],
    points: FloatArray,
    normals: FloatArray,
    neighbours: NDArray[np.int32],
    poses: FloatArray,
    tolerance: float,
) -> NDArray[np.int64]:
    """Sizes (P, 2) at each pose row (P, 12)."""
    sizes = np.zeros((len(poses), 2), dtype=np.int64)
    for p in range(len(poses)):
        _largest(camera, raster, points, normals, neighbours, poses[p], tolerance, sizes[p])
    return sizes


@njit(cache=True, nogil=True)
def _largest(
    camera: FloatArray,
    raster: NDArray[np.float32],
    points: FloatArray,
    normals: FloatArray,
    neighbours: NDArray[np.int32],
    pose: FloatArray,
    tolerance: float,
    largest: NDArray[np.int64],
) -> None:
    """Count samples in the largest patch (2,) before the surface that a sensor saw, and past it.

    The pose row leads from the samples' frame to the sensor's; neighbours are (N, K).
    """
    count = points.shape[0]
    said = np.zeros(count, dtype=np.int8)
    for s in range(count):
        kind = ask_forward(camera, raster, points[s], normals[s], pose, tolerance)
        if kind == FREE:
            said[s] = 2
        elif kind == FRONT and _is_before(camera, raster, points[s], pose, tolerance):
            said[s] = 1
    root = np.arange(count)
    for s in range(count):
        if said[s] == 0:
            continue
        for k in range(neighbours.shape[1]):
            n = neighbours[s, k]
            if said[n] == said[s]:
                a, b = s, n
                while root[a] != a:
                    root[a] = root[root[a]]
                    a = root[a]
                while root[b] != b:
                    root[b] = root[root[b]]
                    b = root[b]
                root[max(a, b)] = min(a, b)
    sizes = np.zeros(count, dtype=np.int64)
    for s in range(count):
        if said[s] != 0:
            a = s
            while root[a] != a:
                a = root[a]
            sizes[a] += 1
            kind = said[s] - 1
            largest[kind] = max(largest[kind], sizes[a])


@njit(cache=True, nogil=True)
def _is_before(
    camera: FloatArray,
    raster: NDArray[np.float32],
    point: FloatArray,
    pose: FloatArray,
    tolerance: float,
) -> bool:
    """Whether a point lies before a surface by more than the tolerance, measured across it.

    Along the ray a grazing surface is far from what lies just beside it.
    """
    x = pose[0] * point[0] + pose[1] * point[1] + pose[2] * point[2] + pose[9]
    y = pose[3] * point[0] + pose[4] * point[1] + pose[5] * point[2] + pose[10]
    z = pose[6] * point[0] + pose[7] * point[1] + pose[8] * point[2] + pose[11]
    u, v, length = camera[1] * x, camera[2] * y, 1.0
    if camera[0] == 0.0:
        u /= z
        v /= z
        length = np.sqrt(x * x + y * y + z * z)
    column = int(min(max(u + camera[3], 0.0), raster.shape[1] - 1.0) + 0.5)
    row = int(min(max(v + camera[4], 0.0), raster.shape[0] - 1.0) + 0.5)
    if raster[row, column, RASTER_KIND] != IS_SURFACE:
        return False
    n = RASTER_NORMAL
    across = raster[row, column, n + 2] * z
    if camera[0] == 0.0:
        across += raster[row, column, n] * x + raster[row, column, n + 1] * y
    else:
        length = z
    cosine = abs(across) / length
    return (raster[row, column, RASTER_DEPTH] - z) * cosine > tolerance
