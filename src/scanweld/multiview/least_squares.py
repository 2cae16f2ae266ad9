"""The normal equations of all poses: matches to robustly weighted terms to a Gauss-Newton step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose, rotation_exp

TUKEY = 4.685
"""Residuals above this many robust standard deviations have no weight."""
DAMPING = 1e-6
"""Added to the diagonal, relative to its mean: what no match holds stays where it is."""

Found = tuple[int, int, Matches]
"""Matches of scan i on scan j, in the sensor frame of j."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Term:
    """Matches of scan i on scan j, in the world.

    Attributes:
        i: The scan whose points are pulled.
        j: The scan that pulls.
        points: (N, 3).
        directions: (N, 3).
        residuals: (N,).
        weights: (N,).
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
        turns = np.cross(self.points - centre, self.directions) / arm
        return np.concatenate([turns, self.directions], axis=1)


def weighted_terms(
    surface: Sequence[Found],
    contour: Sequence[Found],
    poses: Mapping[int, Pose],
    contour_weight: float,
    noise: tuple[float, float],
) -> list[Term]:
    """Surface and contour terms, each kind measured by its own spread.

    Args:
        surface: Point-to-plane matches.
        contour: Matches across outlines.
        poses: ``world_from_sensor``.
        contour_weight: Weight of a contour match beside a surface match of the same precision.
        noise: Least spread of the surface and of the contour residuals, in the scans' unit.
    """
    surface_spread, contour_spread = _spread(surface, noise[0]), _spread(contour, noise[1])
    share = contour_weight * (surface_spread / contour_spread) ** 2 if surface else 1.0
    return [_term(*found, poses, surface_spread, 1.0) for found in surface] + [
        _term(*found, poses, contour_spread, share) for found in contour
    ]


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
        k: _moved(poses[k], twist, centre, arm) for k, twist in zip(poses, twists, strict=True)
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
        jacobian = term.jacobian(centre, arm)
        weighted = jacobian * term.weights[:, None]
        block, slope = weighted.T @ jacobian, weighted.T @ term.residuals
        normal[a, a] += block
        normal[b, b] += block
        normal[a, b] -= block
        normal[b, a] -= block
        gradient[a] += slope
        gradient[b] -= slope
    normal[np.diag_indices(size)] += DAMPING * np.trace(normal) / size
    return normal, gradient


def _spread(found: Sequence[Found], noise: float) -> float:
    """Robust standard deviation of all residuals, by their median."""
    if not found:
        return noise
    residuals = np.concatenate([matches.residuals for _, _, matches in found])
    return max(1.4826 * float(np.median(np.abs(residuals))), noise)


def _term(
    i: int, j: int, matches: Matches, poses: Mapping[int, Pose], spread: float, share: float
) -> Term:
    """Matches in the world, with Tukey's biweight."""
    ratio = np.minimum(np.abs(matches.residuals) / (TUKEY * spread), 1.0)
    return Term(
        i=i,
        j=j,
        points=poses[j].apply(matches.points),
        directions=poses[j].turn(matches.directions),
        residuals=matches.residuals,
        weights=share * (1.0 - ratio**2) ** 2,
    )


def _moved(pose: Pose, twist: FloatArray, centre: FloatArray, arm: float) -> Pose:
    if not twist.any():
        return pose
    rotation = rotation_exp(twist[:3] / arm)
    return Pose(rotation=rotation, translation=centre + twist[3:] - rotation @ centre) @ pose
