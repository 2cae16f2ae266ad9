"""Joint refinement: one robust least squares over the poses of all scans at once."""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from scanweld.config import RefineConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.prepared import PreparedScan
from scanweld.multiview.surface_terms import SurfaceSource, surface_matches, surface_source

logger = logging.getLogger(__name__)

NUM_POINTS = 4000
"""Surface points of a scan that take part."""
MIN_MATCHES = 20
"""A direction of a pair with fewer matches than this has no say."""
TUKEY = 4.685
"""Residuals above this many robust standard deviations have no weight."""
SURFACE_NOISE_DIAMETERS = 1e-7
"""Least spread of surface residuals: exact data have none."""
NUM_CONTOUR_ROUNDS = 4
"""Contours are matched in the last rounds: they are sharp where poses are nearly right, and dear."""
OUTLINE_NOISE_PIXELS = 0.3
"""Least spread of contour residuals: an outline is known to the pixel, no better."""
DAMPING = 1e-7
"""Added to the diagonal, relative to its mean: what no match holds stays where it is."""

ContourMatcher = Callable[[int, int, Pose], Matches]
"""Contour matches of scans i and j, by index, at the pose ``j_from_i``: in the frame of j."""
_Found = tuple[int, int, Matches]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairResidual:
    """How two scans lie on each other after the refinement.

    Attributes:
        num_matches: Surface matches, both directions.
        rms: Of the robustly weighted point-to-plane residuals, in the scans' unit.
        information: (6, 6) of a small motion of one scan against the other: rotation (radians)
            about the centroid of the matches, then translation, along the world's axes.
    """

    num_matches: int
    rms: float
    information: FloatArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Refinement:
    """Refined poses, and how the pairs that overlap lie there.

    Attributes:
        poses: ``world_from_sensor`` of every scan that had one; the first scan's is unchanged.
        pairs: Residuals of all pairs (i, j), i < j, that have surface matches.
        rms: Over all matches, in the scans' unit; 0 where nothing overlaps.
        step: Largest movement of a scan in the last round, as a share of the diameter.
    """

    poses: dict[int, Pose]
    pairs: dict[tuple[int, int], PairResidual]
    rms: float
    step: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Term:
    """Matches of scan i on scan j, in the world, with their weights."""

    i: int
    j: int
    points: FloatArray
    directions: FloatArray
    residuals: FloatArray
    weights: FloatArray


def refine_poses(
    scans: Sequence[PreparedScan],
    world_from_sensor: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    config: RefineConfig,
    contour_matches: ContourMatcher | None = None,
) -> Refinement:
    """Refine all poses together by surface and contour matches.

    Surfaces are matched between all scans that overlap at the current poses, point to plane and
    in both directions, within a radius that shrinks from round to round; contours between the
    given pairs. The first scan stays where it is.

    Args:
        scans: All scans.
        world_from_sensor: Start poses of those to refine, by index in ``scans``.
        pairs: Adjacent views; where contours are matched.
        config: Rounds, radii and the weight of the contours.
        contour_matches: Finds contour matches; without it there is no contour term.
    """
    poses = dict(sorted(world_from_sensor.items()))
    sources = {k: surface_source(scans[k], NUM_POINTS) for k in poses}
    diameter = float(np.median([scans[k].diameter for k in poses]))
    pixel = float(np.median([scans[k].image.pixel for k in poses]))
    noise = SURFACE_NOISE_DIAMETERS * diameter, OUTLINE_NOISE_PIXELS * pixel
    first_contour_round = config.num_rounds - (NUM_CONTOUR_ROUNDS if config.contour_weight else 0)
    views = sorted({(min(pair), max(pair)) for pair in pairs if set(pair) <= set(poses)})
    step = 0.0
    for n, radius in enumerate(np.geomspace(*config.match_diameters, config.num_rounds)):
        surface = _match_surfaces(sources, poses, float(radius) * diameter)
        contour: list[_Found] = []
        if contour_matches is not None and n >= first_contour_round:
            contour = _match_contours(poses, views, contour_matches)
        terms = _weighted(surface, contour, poses, config.contour_weight, noise)
        poses, moved = _solve(terms, poses, diameter)
        step = moved / diameter
        logger.debug("refinement: radius %.4f, step %.2e of the diameter", radius, step)
    surface = _match_surfaces(sources, poses, config.match_diameters[1] * diameter)
    terms = _weighted(surface, [], poses, 0.0, noise)
    rms = _rms(terms)
    logger.info("refined %d poses: rms %.3g, last step %.1e diameters", len(poses), rms, step)
    return Refinement(poses=poses, pairs=_residuals(terms), rms=rms, step=step)


def _match_surfaces(
    sources: Mapping[int, SurfaceSource], poses: Mapping[int, Pose], radius: float
) -> list[_Found]:
    found = []
    for i, j in permutations(poses, 2):
        matches = surface_matches(sources[i], sources[j], poses[j].inverse() @ poses[i], radius)
        if len(matches) >= MIN_MATCHES:
            found.append((i, j, matches))
    return found


def _match_contours(
    poses: Mapping[int, Pose],
    views: Sequence[tuple[int, int]],
    contour_matches: ContourMatcher,
) -> list[_Found]:
    found = []
    for pair in views:
        for i, j in (pair, pair[::-1]):
            matches = contour_matches(i, j, poses[j].inverse() @ poses[i])
            if len(matches) >= MIN_MATCHES:
                found.append((i, j, matches))
    return found


def _weighted(
    surface: Sequence[_Found],
    contour: Sequence[_Found],
    poses: Mapping[int, Pose],
    contour_weight: float,
    noise: tuple[float, float],
) -> list[_Term]:
    """Terms in the world; each kind is measured by its own spread, at least its noise."""
    surface_spread, contour_spread = _spread(surface, noise[0]), _spread(contour, noise[1])
    share = contour_weight * (surface_spread / contour_spread) ** 2 if surface else 1.0
    return [_term(*match, poses, surface_spread, 1.0) for match in surface] + [
        _term(*match, poses, contour_spread, share) for match in contour
    ]


def _spread(found: Sequence[_Found], noise: float) -> float:
    """Robust standard deviation of all residuals, by their median."""
    if not found:
        return noise
    residuals = np.concatenate([matches.residuals for _, _, matches in found])
    return max(1.4826 * float(np.median(np.abs(residuals))), noise)


def _term(
    i: int, j: int, matches: Matches, poses: Mapping[int, Pose], spread: float, share: float
) -> _Term:
    ratio = np.minimum(np.abs(matches.residuals) / (TUKEY * spread), 1.0)
    return _Term(
        i=i,
        j=j,
        points=poses[j].apply(matches.points),
        directions=poses[j].turn(matches.directions),
        residuals=matches.residuals,
        weights=share * (1.0 - ratio**2) ** 2,
    )


def _solve(
    terms: Sequence[_Term], poses: Mapping[int, Pose], diameter: float
) -> tuple[dict[int, Pose], float]:
    """One Gauss-Newton step; also the largest movement of a scan, as a length."""
    if not terms:
        return dict(poses), 0.0
    place = {k: slice(6 * n, 6 * n + 6) for n, k in enumerate(poses)}
    normal, gradient = np.zeros((6 * len(poses),) * 2), np.zeros(6 * len(poses))
    centre = np.mean([term.points.mean(axis=0) for term in terms], axis=0)
    arm = diameter / 3
    for term in terms:
        a, b = place[term.i], place[term.j]
        jacobian = _jacobian(term, centre, arm)
        weighted = jacobian * term.weights[:, None]
        block, slope = weighted.T @ jacobian, weighted.T @ term.residuals
        normal[a, a] += block
        normal[b, b] += block
        normal[a, b] -= block
        normal[b, a] -= block.T
        gradient[a] += slope
        gradient[b] -= slope
    normal[np.diag_indices_from(normal)] += DAMPING * np.trace(normal) / len(normal)
    twists = np.zeros((len(poses), 6))
    twists[1:] = -np.linalg.solve(normal[6:, 6:], gradient[6:]).reshape(-1, 6)
    moved = {
        k: _moved(poses[k], twist, centre, arm) for k, twist in zip(poses, twists, strict=True)
    }
    return moved, float(np.linalg.norm(twists, axis=1).max())


def _jacobian(term: _Term, centre: FloatArray, arm: float) -> FloatArray:
    """Of the residuals (N, 6) by a motion of i: turn about the centre times arm, then shift.

    By a motion of j it is the negative.
    """
    turns = np.cross(term.points - centre, term.directions) / arm
    return np.concatenate([turns, term.directions], axis=1)


def _moved(pose: Pose, twist: FloatArray, centre: FloatArray, arm: float) -> Pose:
    rotation = rotation_exp(twist[:3] / arm)
    step = Pose(rotation=rotation, translation=centre + twist[3:] - rotation @ centre)
    return step @ pose if twist.any() else pose


def _rms(terms: Sequence[_Term]) -> float:
    total = sum(float(term.weights.sum()) for term in terms)
    square = sum(float(term.weights @ term.residuals**2) for term in terms)
    return float(np.sqrt(square / total)) if total > 0 else 0.0


def _residuals(terms: Sequence[_Term]) -> dict[tuple[int, int], PairResidual]:
    both: dict[tuple[int, int], list[_Term]] = {}
    for term in terms:
        both.setdefault((min(term.i, term.j), max(term.i, term.j)), []).append(term)
    return {pair: _pair_residual(sides) for pair, sides in sorted(both.items())}


def _pair_residual(sides: Sequence[_Term]) -> PairResidual:
    centre = np.concatenate([term.points for term in sides]).mean(axis=0)
    rms = _rms(sides)
    information = np.zeros((6, 6))
    for term in sides:
        jacobian = _jacobian(term, centre, 1.0)
        information += (jacobian * term.weights[:, None]).T @ jacobian
    return PairResidual(
        num_matches=sum(len(term.residuals) for term in sides),
        rms=rms,
        information=information / rms**2 if rms > 0 else information,
    )
