"""Symmetric, damped point-to-plane ICP on many poses of a pair at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.field import ScanField
from scanweld.evidence.step import move, solve_damped
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.matches import MIN_AGREEMENT

MIN_MATCHES = 12
"""A pose with fewer matches than this stays where it is."""


@dataclass(frozen=True, kw_only=True, slots=True)
class IcpSchedule:
    """How often to match, and how far.

    Attributes:
        num_rounds: Rounds of matching and solving.
        first_radius: Farthest match in the first round, in the scans' unit,
        last_radius: and in the last; between them it shrinks geometrically.
        num_samples: Samples of each scan that take part.
    """

    num_rounds: int
    first_radius: float
    last_radius: float
    num_samples: int

    def radii(self) -> FloatArray:
        """(R,) farthest match of each round."""
        return np.geomspace(self.first_radius, self.last_radius, self.num_rounds)


def icp(
    i: ScanField, j: ScanField, poses: FloatArray, schedule: IcpSchedule, diameter: float
) -> FloatArray:
    """Refine pose rows (N, 12) of i_from_j; each direction's samples seek the other's surface.

    Matches on rims, farther than the radius or with normals that disagree take no part. A pose
    that loses its matches stays where it is.

    Args:
        i: First scan.
        j: Second scan.
        poses: (N, 12) rows of i_from_j.
        schedule: Rounds, radii and samples.
        diameter: Diameter of the run.
    """
    refined = np.array(poses)
    middle = np.concatenate([i.centre, j.centre])
    _refine_all(
        *_source(i), *_target(i), *_source(j), *_target(j),
        refined, schedule.radii(), schedule.num_samples, middle, 3.0 / diameter,
    )  # fmt: skip
    return refined


def _source(field: ScanField) -> tuple[FloatArray, FloatArray]:
    return field.points, field.normals


def _target(field: ScanField) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    return field.surface, field.closest, field.origin


@njit(cache=True, nogil=True)
def _refine_all(
    points_i: FloatArray,
    normals_i: FloatArray,
    surface_i: FloatArray,
    closest_i: NDArray[np.int32],
    origin_i: FloatArray,
    points_j: FloatArray,
    normals_j: FloatArray,
    surface_j: FloatArray,
    closest_j: NDArray[np.int32],
    origin_j: FloatArray,
    poses: FloatArray,
    radii: FloatArray,
    num_samples: int,
    middle: FloatArray,
    turn_scale: float,
) -> None:
    """Refine the pose rows (N, 12) in place, turning about the middle of both scans."""
    h, g, centre = np.zeros((6, 6)), np.zeros(6), np.zeros(3)
    for p in range(poses.shape[0]):
        pose = poses[p]
        for radius in radii:
            for r in range(3):
                moved = pose[9 + r]
                for k in range(3):
                    moved += pose[3 * r + k] * middle[3 + k]
                centre[r] = 0.5 * (middle[r] + moved)
            count = _accumulate_both(
                points_i, normals_i, surface_i, closest_i, origin_i,
                points_j, normals_j, surface_j, closest_j, origin_j,
                pose, radius, num_samples, centre, turn_scale, h, g,
            )  # fmt: skip
            if count < MIN_MATCHES or not solve_damped(h, g):
                break
            move(pose, g, centre, turn_scale)


@njit(cache=True, nogil=True)
def _accumulate_both(
    points_i: FloatArray,
    normals_i: FloatArray,
    surface_i: FloatArray,
    closest_i: NDArray[np.int32],
    origin_i: FloatArray,
    points_j: FloatArray,
    normals_j: FloatArray,
    surface_j: FloatArray,
    closest_j: NDArray[np.int32],
    origin_j: FloatArray,
    pose: FloatArray,
    radius: float,
    num_samples: int,
    centre: FloatArray,
    turn_scale: float,
    h: FloatArray,
    g: FloatArray,
) -> int:
    """Normal equations h x = -g of both directions, and the number of matches."""
    h[:] = 0.0
    g[:] = 0.0
    back = np.empty(12)
    for r in range(3):
        back[9 + r] = 0.0
        for k in range(3):
            back[3 * r + k] = pose[3 * k + r]
            back[9 + r] -= pose[3 * k + r] * pose[9 + k]
    same = np.array([1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0, 0, 0, 0])
    count = _accumulate(points_j, normals_j, pose, same, surface_i, closest_i, origin_i, 1.0,
                        radius, num_samples, centre, turn_scale, h, g)  # fmt: skip
    count += _accumulate(points_i, normals_i, back, pose, surface_j, closest_j, origin_j, -1.0,
                        radius, num_samples, centre, turn_scale, h, g)  # fmt: skip
    return count


@njit(cache=True, nogil=True)
def _accumulate(
    points: FloatArray,
    normals: FloatArray,
    target_from_source: FloatArray,
    i_from_target: FloatArray,
    surface: FloatArray,
    closest: NDArray[np.int32],
    origin: FloatArray,
    sign: float,
    radius: float,
    num_samples: int,
    centre: FloatArray,
    turn_scale: float,
    h: FloatArray,
    g: FloatArray,
) -> int:
    """Point-to-plane terms of one direction, and how many matches they are of.

    The sign is -1 where the plane moves, not the point.
    """
    a, b, edge = target_from_source, i_from_target, origin[3]
    q, m, n, jac = np.empty(3), np.empty(3), np.empty(3), np.empty(6)
    count = 0
    for s in range(min(num_samples, points.shape[0])):
        p, o = points[s], normals[s]
        for r in range(3):
            q[r] = a[3 * r] * p[0] + a[3 * r + 1] * p[1] + a[3 * r + 2] * p[2] + a[9 + r]
        x = int(np.floor((q[0] - origin[0]) / edge + 0.5))
        y = int(np.floor((q[1] - origin[1]) / edge + 0.5))
        z = int(np.floor((q[2] - origin[2]) / edge + 0.5))
        if x < 0 or y < 0 or z < 0:
            continue
        if x >= closest.shape[0] or y >= closest.shape[1] or z >= closest.shape[2]:
            continue
        hit = surface[closest[x, y, z]]
        dx, dy, dz = q[0] - hit[0], q[1] - hit[1], q[2] - hit[2]
        if hit[6] == 0.0 or dx * dx + dy * dy + dz * dz > radius * radius:
            continue
        agreement = 0.0
        for r in range(3):
            agreement += hit[3 + r] * (a[3 * r] * o[0] + a[3 * r + 1] * o[1] + a[3 * r + 2] * o[2])
        if agreement < MIN_AGREEMENT:
            continue
        residual = dx * hit[3] + dy * hit[4] + dz * hit[5]
        for r in range(3):
            m[r] = b[3 * r] * q[0] + b[3 * r + 1] * q[1] + b[3 * r + 2] * q[2] + b[9 + r]
            n[r] = b[3 * r] * hit[3] + b[3 * r + 1] * hit[4] + b[3 * r + 2] * hit[5]
        u, v, w = m[0] - centre[0], m[1] - centre[1], m[2] - centre[2]
        jac[0] = sign * turn_scale * (v * n[2] - w * n[1])
        jac[1] = sign * turn_scale * (w * n[0] - u * n[2])
        jac[2] = sign * turn_scale * (u * n[1] - v * n[0])
        for r in range(3):
            jac[3 + r] = sign * n[r]
        for r in range(6):
            g[r] += jac[r] * residual
            for k in range(6):
                h[r, k] += jac[r] * jac[k]
        count += 1
    return count
