"""Least squares over the poses of several views: pulls of matches to Levenberg-Marquardt steps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import damped, jacobian, motion_of
from scanweld.geometry.pose import Pose

MAX_STEPS = 30
"""Steps that are accepted, at most."""
SMALL_DECREASE = 1e-6
"""Share of the cost: the search ends when a step gains less."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Damping:
    """Levenberg's damping, relative to the mean of the normal matrix's diagonal.

    Attributes:
        first: Of the first step.
        factor: By which it falls after a step that was accepted and grows after one that was not.
        least: It falls no further.
        most: Beyond, no step helps any more.
    """

    first: float = 1e-4
    factor: float = 10.0
    least: float = 1e-9
    most: float = 1e6


RULE = Damping()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pulls:
    """Residuals of two views, each changed by the motion of a point along a direction.

    Attributes:
        i: The view whose points they are.
        j: The view that observes them.
        points: (N, 3) points of i, world frame.
        directions: (N, 3) gradient of the residuals by the place of the points, world frame.
        residuals: (N,).
        weights: (N,) not negative, or None for all the same.
    """

    i: int
    j: int
    points: FloatArray
    directions: FloatArray
    residuals: FloatArray
    weights: FloatArray | None = None


PullsAt = Callable[[Mapping[int, Pose]], list[Pulls]]
"""Pulls of the same matches at poses ``world_from_sensor``."""


def cost_of(pulls: Sequence[Pulls]) -> float:
    """Sum of the squared residuals."""
    return sum(float(each.residuals @ each.residuals) for each in pulls)


def levenberg_marquardt(
    pulls_at: PullsAt, poses: Mapping[int, Pose], held: frozenset[int], arm: float
) -> tuple[dict[int, Pose], list[float]]:
    """Move the views to the least sum of squares; no step is accepted that does not lower it.

    Args:
        pulls_at: The residuals at any poses.
        poses: ``world_from_sensor`` at the start.
        held: Views that stay where they are.
        arm: The length at which a turn counts like a shift.

    Returns:
        The poses, and the cost at the start and after each accepted step.
    """
    current, pulls = dict(poses), pulls_at(poses)
    costs, damping = [cost_of(pulls)], RULE.first
    while len(costs) <= MAX_STEPS:
        centre = np.concatenate([each.points for each in pulls]).mean(axis=0)
        free, normal, gradient = _normal_equations(pulls, current, held, centre, arm)
        scale = float(np.trace(normal)) / max(len(normal), 1)
        while damping <= RULE.most and scale > 0:
            twist = -np.linalg.solve(normal + damping * scale * np.eye(len(normal)), gradient)
            trial = _moved(current, free, twist.astype(np.float64), centre, arm)
            trial_pulls = pulls_at(trial)
            cost = cost_of(trial_pulls)
            if cost < costs[-1]:
                break
            damping *= RULE.factor
        else:
            break
        current, pulls, damping = trial, trial_pulls, max(damping / RULE.factor, RULE.least)
        costs.append(cost)
        if costs[-2] - cost <= SMALL_DECREASE * costs[-2]:
            break
    return current, costs


def gauss_newton_step(
    pulls: Sequence[Pulls], poses: Mapping[int, Pose], held: frozenset[int], arm: float
) -> dict[int, Pose]:
    """One weighted Gauss-Newton step; what no match holds stays where it is."""
    centre = np.concatenate([each.points for each in pulls]).mean(axis=0)
    free, normal, gradient = _normal_equations(pulls, poses, held, centre, arm)
    if not free:
        return dict(poses)
    twist = -np.linalg.solve(damped(normal), gradient).astype(np.float64)
    return _moved(poses, free, twist, centre, arm)


def _normal_equations(
    pulls: Sequence[Pulls],
    poses: Mapping[int, Pose],
    held: frozenset[int],
    centre: FloatArray,
    arm: float,
) -> tuple[list[int], FloatArray, FloatArray]:
    """The views that are free to move, the normal matrix of their twists and the gradient."""
    order = list(poses)
    size = 6 * len(order)
    place = {k: slice(6 * n, 6 * n + 6) for n, k in enumerate(order)}
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for each in pulls:
        a, b = place[each.i], place[each.j]
        by_motion = jacobian(each.points, each.directions, centre, arm)
        weighted = by_motion if each.weights is None else by_motion * each.weights[:, None]
        block, slope = weighted.T @ by_motion, weighted.T @ each.residuals
        # What matters is how i moves against j: a motion of j is that of i the other way.
        normal[a, a] += block
        normal[b, b] += block
        normal[a, b] -= block
        normal[b, a] -= block
        gradient[a] += slope
        gradient[b] -= slope
    free = [k for k in order if k not in held]
    rows = np.concatenate([np.arange(size)[place[k]] for k in free] or [np.zeros(0, np.int64)])
    return free, normal[np.ix_(rows, rows)], gradient[rows]


def _moved(
    poses: Mapping[int, Pose],
    free: Sequence[int],
    twists: FloatArray,
    centre: FloatArray,
    arm: float,
) -> dict[int, Pose]:
    """All poses, the free ones moved by their twists; the others keep their very bits."""
    moved = dict(poses)
    for k, twist in zip(free, twists.reshape(-1, 6), strict=True):
        moved[k] = motion_of(twist, centre, arm) @ poses[k]
    return moved
