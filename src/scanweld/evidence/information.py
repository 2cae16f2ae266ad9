"""How firmly a pair's matches hold its pose: point-to-plane information that noise cannot feign.

The information of a match with normal n is J J^T, J = (x cross n, n). Where surfaces slide on each
other, J is orthogonal to the slide, but for the noise of n, which squared looks like information.
Each match has two normals, one of each scan, with errors of their own: of the product J_a J_b^T
of both, only what they have in common is left.
"""

from collections.abc import Sequence

import numpy as np

from scanweld.evidence.field import ScanField
from scanweld.evidence.icp import MIN_MATCHES
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import TURN_SCALE
from scanweld.geometry.matches import MIN_AGREEMENT
from scanweld.geometry.pose import Pose

NUM_DEVIATIONS = 4.0
"""Standard deviations by which information must exceed what noise leaves of itself. They are those
of independent matches; normals are smoothed, so that neighbours have errors in common."""


TwoWayMatches = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Points (N, 3) matched between two scans, both unit normals (N, 3), and the distances (N,) by
which the second scan lies before the first, as that one's sensor sees it."""


def information_of(
    i: ScanField, j: ScanField, i_from_j: Pose, radius: float, diameter: float
) -> tuple[FloatArray, float, int]:
    """Information (6, 6) per match that both scans vouch for, residual rms and number of matches.

    It is C - 4 N / sqrt(m), with C the mean of (J_a J_b^T + J_b J_a^T) / 2 over the m matches, and
    N that of (J_a - J_b) (J_a - J_b)^T / 2, which noise gives. An eigenvalue may be negative.
    Rotation comes before translation, about the middle of the matches, in the axes of i; rotations
    are multiplied by 3 / diameter, so that all entries compare.

    Args:
        i: First scan.
        j: Second scan.
        i_from_j: The pose between the sensor frames.
        radius: Farthest match, in the scans' unit.
        diameter: Diameter of the run.
    """
    return information_from([two_way_matches(i, j, i_from_j, radius)], diameter)


def information_from(
    matches: Sequence[TwoWayMatches], diameter: float
) -> tuple[FloatArray, float, int]:
    """The same of any matches in one frame, such as those of one scan on several others."""
    points, one, other, residuals = (
        np.concatenate(column) for column in zip(*matches, strict=True)
    )
    count = len(points)
    if count < MIN_MATCHES:
        return np.zeros((6, 6)), float("nan"), count
    away = (points - points.mean(axis=0)) * (TURN_SCALE / diameter)
    a, b = (np.column_stack([np.cross(away, normals), normals]) for normals in (one, other))
    common = (a.T @ b + b.T @ a) / (2 * count)
    noise = (a - b).T @ (a - b) / (2 * count)
    information = common - NUM_DEVIATIONS / np.sqrt(count) * noise
    return information, float(np.sqrt(np.mean(residuals**2))), count


def observability_of(information: FloatArray) -> float:
    """Smallest over largest eigenvalue of an information (6, 6); 0 where that is not positive."""
    eigenvalues = np.linalg.eigvalsh(information)
    return float(max(eigenvalues[0], 0.0) / eigenvalues[-1]) if eigenvalues[-1] > 0 else 0.0


def two_way_matches(i: ScanField, j: ScanField, i_from_j: Pose, radius: float) -> TwoWayMatches:
    """Matches of the samples of each scan on the other, in the frame of i."""
    points, one, other, residuals = _matches(i, j, i_from_j.inverse(), radius)
    backward = i_from_j.apply(points), i_from_j.turn(one), i_from_j.turn(other), -residuals
    both = zip(_matches(j, i, i_from_j, radius), backward, strict=True)
    points, one, other, residuals = (np.concatenate(column) for column in both)
    return points, one, other, residuals


def _matches(
    source: ScanField, target: ScanField, target_from_source: Pose, radius: float
) -> TwoWayMatches:
    """Samples of the source on the target, both normals (N, 3) and the distance, target frame."""
    points = target_from_source.apply(source.points)
    normals = target_from_source.turn(source.normals)
    cell = np.floor((points - target.origin[:3]) / target.origin[3] + 0.5).astype(np.int64)
    inside = ((cell >= 0) & (cell < target.closest.shape)).all(axis=1)
    points, normals, cell = points[inside], normals[inside], cell[inside]
    hit = target.surface[target.closest[tuple(cell.T)]]
    away = points - hit[:, :3]
    kept = (hit[:, 6] != 0) & ((away**2).sum(axis=1) <= radius**2)
    kept &= (normals * hit[:, 3:6]).sum(axis=1) >= MIN_AGREEMENT
    residuals = (away * hit[:, 3:6]).sum(axis=1)
    return points[kept], normals[kept], hit[kept, 3:6], residuals[kept]
