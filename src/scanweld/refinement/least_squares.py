"""The normal equations of all poses: matches to robustly weighted terms to a Gauss-Newton step."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import damped, jacobian, motion_of, spread_of, tukey_weights
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose

MIN_MATCHES = 20
"""A pair takes part in each direction in which it has at least so many matches."""

Found = tuple[int, int, Matches]
"""Matches of scan i on scan j, in the sensor frame of j."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Term:
    """Matches of scan i on scan j, in the world.

    Attributes:
        i: The scan whose points are pulled.
        j: The scan that pulls.
        points: (N, 3) points of i, world frame.
        directions: (N, 3) unit directions of j, world frame.
        residuals: (N,) signed distances along the directions, in the scans' unit.
        weights: (N,) robust weights, not negative.
    """

    i: int
    j: int
    points: FloatArray
    directions: FloatArray
    residuals: FloatArray
    weights: FloatArray

    def jacobian(self, centre: FloatArray, arm: float) -> FloatArray:
        """Of the residuals (N, 6) by a motion of i: turn about the centre times arm, then shift.

        By a motion of j it is the negative.
        """
        return jacobian(self.points, self.directions, centre, arm)


def weighted_terms(
    surface: list[Found],
    contour: Sequence[Found],
    poses: Mapping[int, Pose],
    contour_weight: float,
    noise: tuple[float, float],
) -> list[Term]:
    """Surface and contour terms, each kind measured by its own spread.

    Args:
        surface: Point-to-plane matches. The list is emptied as the terms are made of it: of 200
            scans, either takes half a gigabyte.
        contour: Matches across outlines.
        poses: ``world_from_sensor``.
        contour_weight: Weight of a contour match beside a surface match of the same precision.
        noise: Least spread of the surface and of the contour residuals, in the scans' unit.
    """
    surface_spread, contour_spread = _spread(surface, noise[0]), _spread(contour, noise[1])
    share = contour_weight * (surface_spread / contour_spread) ** 2 if surface else 1.0
    return [_term(*found, poses, surface_spread, 1.0) for found in _taken_from(surface)] + [
        _term(*found, poses, contour_spread, share) for found in contour
    ]


def _taken_from(found: list[Found]) -> Iterator[Found]:
    found.reverse()
    while found:
        yield found.pop()


def move_poses(
    terms: Sequence[Term], poses: Mapping[int, Pose], arm: float, max_step: float
) -> tuple[dict[int, Pose], float]:
    """One Gauss-Newton step of all poses but the first.

    Args:
        terms: What holds the scans together.
        poses: ``world_from_sensor``.
        arm: The length at which a turn counts like a shift.
        max_step: A scan moves no farther than this.

    Returns:
        The poses, and the largest movement of a scan as a length.
    """
    if not terms:
        return dict(poses), 0.0
    centre = np.mean([term.points.mean(axis=0) for term in terms], axis=0)
    normal, gradient = _normal_equations(terms, list(poses), centre, arm)
    twists = np.zeros((len(poses), 6))
    twists[1:] = -np.linalg.solve(normal[6:, 6:], gradient[6:]).reshape(-1, 6)
    lengths = np.linalg.norm(twists, axis=1, keepdims=True)
    twists *= max_step / np.maximum(lengths, max_step)
    moved = {
        # A pose that is not moved keeps its very bits.
        k: motion_of(twist, centre, arm) @ poses[k] if twist.any() else poses[k]
        for k, twist in zip(poses, twists, strict=True)
    }
    return moved, float(np.linalg.norm(twists, axis=1).max())


def _normal_equations(
    terms: Sequence[Term], order: Sequence[int], centre: FloatArray, arm: float
) -> tuple[FloatArray, FloatArray]:
    place = {k: slice(6 * n, 6 * n + 6) for n, k in enumerate(order)}
    size = 6 * len(order)
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for term in terms:
        a, b = place[term.i], place[term.j]
        by_motion = term.jacobian(centre, arm)
        weighted = by_motion * term.weights[:, None]
        block, slope = weighted.T @ by_motion, weighted.T @ term.residuals
        normal[a, a] += block
        normal[b, b] += block
        normal[a, b] -= block
        normal[b, a] -= block
        gradient[a] += slope
        gradient[b] -= slope
    return damped(normal), gradient


def _spread(found: Sequence[Found], noise: float) -> float:
    return spread_of(np.concatenate([[], *(matches.residuals for _, _, matches in found)]), noise)


def _term(
    i: int, j: int, matches: Matches, poses: Mapping[int, Pose], spread: float, share: float
) -> Term:
    """Matches in the world, with Tukey's biweight."""
    return Term(
        i=i,
        j=j,
        points=poses[j].apply(matches.points),
        directions=poses[j].turn(matches.directions),
        residuals=matches.residuals,
        weights=share * tukey_weights(matches.residuals, spread),
    )
