"""Violating samples that hang together: noise scatters them, a wrong pose makes patches.

At a right pose what lies before the other surface, or in its free space, is a grain here and there.
At a wrong one whole parts of the object do, and however much agrees elsewhere, such a part does not
become smaller. So a pose is judged by its largest patch, not by the sum of all violations.

A third kind says less of the pose than of the surface. What faces away from a sensor lies behind
what that saw, by as much as the object is thick there. Where it does not, one surface shows both of
its sides: a false inside, of a rendered or an inferred surface, or a wrong pose.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.field import RASTER_DEPTH, RASTER_KIND, RASTER_NORMAL, ScanField
from scanweld.evidence.visibility import (
    CONTRADICT,
    FREE,
    FRONT,
    IS_SURFACE,
    ask_forward,
    pose_rows,
)
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose


def violating_patches(
    i: ScanField,
    j: ScanField,
    i_from_j: Sequence[Pose],
    tolerance: float,
    thickness: float = 0.0,
) -> FloatArray:
    """Largest patch before a surface, in free space, and on the inside of a surface: (P, 3).

    They are shares of the samples of a scan at each pose; the mean of both directions is taken.

    Args:
        i: First scan.
        j: Second scan.
        i_from_j: The poses, between the sensor frames.
        tolerance: Of the distance from the surface, in the scans' unit.
        thickness: What faces away from a sensor lies farther behind the surface that it saw.
    """
    back = [pose.inverse() for pose in i_from_j]
    forward = _shares(j, i, pose_rows(i_from_j), tolerance, thickness)
    backward = _shares(i, j, pose_rows(back), tolerance, thickness)
    return 0.5 * (forward + backward)


def with_patches(evidence: Evidence, patches: FloatArray) -> Evidence:
    """Evidence with the patches (3,) of its pose."""
    front, free, inside = patches.tolist()
    return replace(evidence, front_patch=front, free_patch=free, inside_patch=inside)


def _shares(
    here: ScanField, there: ScanField, rows: FloatArray, tolerance: float, thickness: float
) -> FloatArray:
    """The patches (P, 3) of one scan's samples for the other's sensor; rows are there_from_here."""
    sizes = _largest_patches(
        *(there.camera, there.raster, here.points, here.normals, here.neighbours, rows),
        *(tolerance, thickness),
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
    thickness: float,
) -> NDArray[np.int64]:
    """Sizes (P, 3) at each pose row (P, 12)."""
    sizes = np.zeros((len(poses), 3), dtype=np.int64)
    for p in range(len(poses)):
        said = _violations(camera, raster, points, normals, poses[p], tolerance, thickness)
        _largest(said, neighbours, sizes[p])
    return sizes


@njit(cache=True, nogil=True)
def _violations(
    camera: FloatArray,
    raster: NDArray[np.float32],
    points: FloatArray,
    normals: FloatArray,
    pose: FloatArray,
    tolerance: float,
    thickness: float,
) -> NDArray[np.int8]:
    """One more than the column of the kind of violation of each sample, 0 where there is none.

    The pose row leads from the samples' frame to the sensor's.
    """
    said = np.zeros(points.shape[0], dtype=np.int8)
    for s in range(points.shape[0]):
        kind = ask_forward(camera, raster, points[s], normals[s], pose, tolerance)
        if kind == FREE:
            said[s] = 2
        elif kind == FRONT and _before(camera, raster, points[s], pose) > tolerance:
            said[s] = 1
        elif kind == CONTRADICT and _before(camera, raster, points[s], pose) > -thickness:
            said[s] = 3
    return said


@njit(cache=True, nogil=True)
def _largest(
    said: NDArray[np.int8], neighbours: NDArray[np.int32], largest: NDArray[np.int64]
) -> None:
    """Count samples in the largest patch (3,) of each kind; neighbours are (N, K)."""
    count = len(said)
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
def _before(
    camera: FloatArray, raster: NDArray[np.float32], point: FloatArray, pose: FloatArray
) -> float:
    """How far a point lies before a surface, measured across it; minus infinity beside surfaces.

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
        return -np.inf
    n = RASTER_NORMAL
    across = raster[row, column, n + 2] * z
    if camera[0] == 0.0:
        across += raster[row, column, n] * x + raster[row, column, n + 1] * y
    else:
        length = z
    cosine = abs(across) / length
    return (raster[row, column, RASTER_DEPTH] - z) * cosine
