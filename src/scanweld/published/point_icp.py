"""ICP and trimmed ICP, point to point: the classic (Besl & McKay 1992; Chetverikov et al. 2002)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.point_fit import Trim, num_trusted, rigid_fit
from scanweld.geometry.pose import Pose

MAX_ROUNDS = 100
"""Rounds of matching and fitting, at most."""
CONVERGED_STEP = 1e-5
"""The iteration has come to rest when a round moves no point by more, in sizes of the source."""
MIN_POINTS = 3
"""Fewer points than this, or matched keypoints, hold no motion,"""
MIN_BREADTH = 1e-4
"""nor do points on a line, to within this share of their extent."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PointAlignment:
    """Points aligned to others.

    Attributes:
        target_from_source: The motion.
        rms: Of the distances of the matches kept, at that motion, in the points' unit.
        num_matches: Matches kept.
        converged: Whether the iteration came to rest.
    """

    target_from_source: Pose
    rms: float
    num_matches: int
    converged: bool


def point_icp(
    source_points: FloatArray,
    target_points: FloatArray,
    start: Pose,
    trim: Trim = None,
    *,
    max_rounds: int = MAX_ROUNDS,
) -> PointAlignment:
    """Match each source point to its nearest target point, fit, and again until nothing moves.

    Where the matches come to lie in a point or on a line, the last motion that was held stays.

    Args:
        source_points: (N, 3), at least three.
        target_points: (M, 3), at least three.
        start: target_from_source to start from.
        trim: Share of the closest matches that each fit goes by, "auto", or None for all.
        max_rounds: Rounds, at most.

    Raises:
        ValueError: If there are fewer than three points on either side.
    """
    if min(len(source_points), len(target_points)) < MIN_POINTS:
        raise ValueError("ICP needs at least three points on either side")
    tree = KDTree(target_points)
    size = float(np.linalg.norm(np.ptp(source_points, axis=0)))
    pose, converged = start, False
    chosen, nearest, squares = _matches(tree, pose.apply(source_points), trim)
    for _ in range(max_rounds):
        if not (holds_motion(source_points[chosen]) and holds_motion(target_points[nearest])):
            break
        moved = rigid_fit(source_points[chosen], target_points[nearest])
        step = np.abs(moved.apply(source_points) - pose.apply(source_points)).max()
        pose = moved
        chosen, nearest, squares = _matches(tree, pose.apply(source_points), trim)
        if step <= CONVERGED_STEP * size:
            converged = True
            break
    return PointAlignment(
        target_from_source=pose,
        rms=float(np.sqrt(squares.mean())) if len(squares) else float("nan"),
        num_matches=len(squares),
        converged=converged,
    )


def holds_motion(points: FloatArray) -> bool:
    """Whether points (N, 3) fix a rigid motion: at least three, not on a line."""
    if len(points) < MIN_POINTS:
        return False
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] > MIN_BREADTH * spread[0])


def _matches(tree: KDTree, points: FloatArray, trim: Trim) -> tuple[IntArray, IntArray, FloatArray]:
    """The closest matches: indices of source and target points, squared distances ascending."""
    found = tree.query(points)
    distances, nearest = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
    order = np.argsort(distances, kind="stable")
    squares = distances[order] ** 2
    num = num_trusted(squares, trim)
    return order[:num], nearest[order[:num]], squares[:num]
