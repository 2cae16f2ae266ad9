"""Joint refinement: one robust least squares over the poses of all scans at once."""

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.config import RefineConfig
from scanweld.contours.coherence import OUTLINE_NOISE_PIXELS, ContourMatcher
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.refinement.contour_terms import Outlines
from scanweld.refinement.least_squares import MIN_MATCHES, Found, Term, move_poses, weighted_terms
from scanweld.refinement.surface_terms import SurfaceSource, surface_matches, surface_source
from scanweld.work.threads import map_in_rows

logger = logging.getLogger(__name__)

NUM_POINTS = 4000
"""Surface points of a scan that are matched."""
SURFACE_NOISE_DIAMETERS = 1e-7
"""Least spread of surface residuals: exact data have none."""
MAX_STEP_DIAMETERS = 0.1
"""Most that a scan moves in a round: matches hold for short steps only."""
NUM_CONTOUR_ROUNDS = 4
"""Last rounds, in which contours take part: they cost most, and need nearly right poses."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairResidual:
    """How two scans lie on each other after the refinement.

    Attributes:
        num_matches: Surface matches, both directions.
        rms: Of the robustly weighted point-to-plane residuals, in the scans' unit.
    """

    num_matches: int
    rms: float


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


def refine_poses(
    scans: Sequence[PreparedScan],
    world_from_sensor: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    config: RefineConfig,
    contours: ContourMatcher | None = None,
    workers: int = 1,
) -> Refinement:
    """Refine all poses together by surface and contour matches.

    Surfaces are matched between all given pairs that touch at the current poses, point to plane and
    in both directions, within a radius that shrinks from round to round. Contours are matched in
    the last rounds, between scans that share much surface: alone they hold a pair too weakly. The
    first scan stays where it is.

    Args:
        scans: All scans.
        world_from_sensor: Start poses of those to refine, by index in ``scans``.
        pairs: Scans that are matched, (i, j) in any order.
        config: Rounds, radii and the weight of the contours.
        contours: Of all scans; without them there is no contour term.
        workers: Threads; the result is the same for any number.
    """
    if len(world_from_sensor) < 2:
        return Refinement(poses=dict(world_from_sensor), pairs={}, rms=0.0, step=0.0)
    sources = {k: surface_source(scans[k], NUM_POINTS) for k in sorted(world_from_sensor)}
    poses, step = _moved(scans, sources, world_from_sensor, pairs, config, contours, workers)
    diameter = _diameter(scans, poses)
    radius = config.match_diameters[1] * diameter
    surface = match_surfaces(sources, poses, pairs, radius, workers)
    terms = weighted_terms(surface, [], poses, 0.0, _noise(scans, poses))
    rms = _rms(terms)
    logger.debug("refined %d poses: rms %.3g, last step %.1e diameters", len(poses), rms, step)
    return Refinement(poses=poses, pairs=_residuals(terms), rms=rms, step=step)


def refined_poses(
    scans: Sequence[PreparedScan],
    world_from_sensor: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    config: RefineConfig,
    contours: ContourMatcher | None = None,
    workers: int = 1,
) -> dict[int, Pose]:
    """The poses of ``refine_poses`` alone, which spares a round of matches."""
    if len(world_from_sensor) < 2:
        return dict(world_from_sensor)
    sources = {k: surface_source(scans[k], NUM_POINTS) for k in sorted(world_from_sensor)}
    return _moved(scans, sources, world_from_sensor, pairs, config, contours, workers)[0]


def _moved(
    scans: Sequence[PreparedScan],
    sources: Mapping[int, SurfaceSource],
    world_from_sensor: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    config: RefineConfig,
    contours: ContourMatcher | None,
    workers: int,
) -> tuple[dict[int, Pose], float]:
    """Refined poses, and the last step as a share of the diameter."""
    poses = dict(sorted(world_from_sensor.items()))
    diameter, noise = _diameter(scans, poses), _noise(scans, poses)
    contour_rounds = NUM_CONTOUR_ROUNDS if config.contour_weight > 0 else 0
    outlines = None if contours is None else Outlines(contours=contours, workers=workers)
    step = 0.0
    for n, radius in enumerate(np.geomspace(*config.match_diameters, config.num_rounds)):
        surface = match_surfaces(sources, poses, pairs, float(radius) * diameter, workers)
        contour: list[Found] = []
        if outlines is not None and n >= config.num_rounds - contour_rounds:
            contour = outlines.matches(poses, surface)
        poses, moved = move_poses(
            weighted_terms(surface, contour, poses, config.contour_weight, noise),
            poses,
            lever_arm(diameter),
            MAX_STEP_DIAMETERS * diameter,
        )
        step = moved / diameter
        logger.debug("refinement: radius %.4f, step %.2e of the diameter", radius, step)
    return poses, step


def _diameter(scans: Sequence[PreparedScan], poses: Mapping[int, Pose]) -> float:
    return float(np.median([scans[k].diameter for k in poses]))


def _noise(scans: Sequence[PreparedScan], poses: Mapping[int, Pose]) -> tuple[float, float]:
    """Least spread of the surface and of the contour residuals, in the scans' unit."""
    pixel = float(np.median([scans[k].image.pixel for k in poses]))
    return SURFACE_NOISE_DIAMETERS * _diameter(scans, poses), OUTLINE_NOISE_PIXELS * pixel


def scan_rms(refinement: Refinement) -> dict[int, float]:
    """Residual rms of each scan that has matches, over all its pairs; in the scans' unit."""
    sums: dict[int, tuple[float, int]] = {}
    for pair, residual in refinement.pairs.items():
        for k in pair:
            square, count = sums.get(k, (0.0, 0))
            added = residual.num_matches * residual.rms**2
            sums[k] = square + added, count + residual.num_matches
    return {k: float(np.sqrt(square / count)) for k, (square, count) in sorted(sums.items())}


def match_surfaces(
    sources: Mapping[int, SurfaceSource],
    poses: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    radius: float,
    workers: int = 1,
) -> list[Found]:
    """Point-to-plane matches of the pairs that touch at their poses, in both directions."""
    back = {k: pose.inverse() for k, pose in poses.items()}

    def match(way: tuple[int, int]) -> Found:
        i, j = way
        return i, j, surface_matches(sources[i], sources[j], back[j] @ poses[i], radius)

    ways = sorted({*pairs, *((j, i) for i, j in pairs)})
    found = map_in_rows(match, ways, workers)
    return [each for each in found if len(each[2]) >= MIN_MATCHES]


def _rms(terms: Sequence[Term]) -> float:
    total = sum(float(term.weights.sum()) for term in terms)
    square = sum(float(term.weights @ term.residuals**2) for term in terms)
    return float(np.sqrt(square / total)) if total > 0 else 0.0


def _residuals(terms: Sequence[Term]) -> dict[tuple[int, int], PairResidual]:
    both: dict[tuple[int, int], list[Term]] = {}
    for term in terms:
        both.setdefault((min(term.i, term.j), max(term.i, term.j)), []).append(term)
    return {
        pair: PairResidual(num_matches=sum(len(term.residuals) for term in sides), rms=_rms(sides))
        for pair, sides in sorted(both.items())
    }
