"""Scans whose unit is a little off: the scales that would make the placed surfaces agree."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import (
    MAD_TO_SIGMA,
    SIGNIFICANT_SIGMAS,
    damped,
    lever_arm,
    motion_of,
)
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.refinement.least_squares import Term, weighted_terms
from scanweld.refinement.refine import (
    NUM_POINTS,
    SURFACE_NOISE_DIAMETERS,
    match_surfaces,
)
from scanweld.refinement.surface_terms import SurfaceSource, surface_source
from scanweld.sensor.accuracy import match_weights
from scanweld.sensor.model import SensorModel

MATCH_DIAMETERS = 0.012
"""Farthest match: a scale error of one percent moves a surface by up to half a percent."""
NUM_ROUNDS = 4
"""Steps of least squares, each with new matches."""
MIN_ERROR = 0.004
"""Scales that are off by less are within the calibration of sensors."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScaleEstimate:
    """How many times too large a scan is, compared with the other scans of its component.

    Attributes:
        factor: 1 for a scan in the unit of the others.
        deviation: Standard deviation of the factor.
    """

    factor: float
    deviation: float

    @property
    def is_off(self) -> bool:
        """Whether the scale differs from the others' by more than its error."""
        error = abs(self.factor - 1.0)
        return error > max(MIN_ERROR, SIGNIFICANT_SIGMAS * self.deviation)

    def words(self) -> str:
        """What is wrong with the scan's scale, and what to do."""
        larger = (
            f"{self.factor:.3f} times too large"
            if self.factor > 1
            else (f"{1 / self.factor:.3f} times too small")
        )
        return (
            f"its scale is off: {larger} compared with the other scans (± {self.deviation:.3f}); "
            "check its unit and the sensor's calibration"
        )


def estimate_scales(
    scans: Sequence[PreparedScan],
    world_from_sensor: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    sensor: SensorModel,
    workers: int = 1,
) -> dict[int, ScaleEstimate]:
    """Free the scale of every placed scan beside its pose, in a few steps of least squares.

    Args:
        scans: All scans.
        world_from_sensor: Refined poses of a component's, by index in ``scans``.
        pairs: Scans that are matched, (i, j) in any order.
        sensor: What is known of the sensor.
        workers: Threads; the result is the same for any number.

    Returns:
        Estimates of the scans whose surfaces touch others', by index.
    """
    poses = dict(sorted(world_from_sensor.items()))
    diameter = sensor.diameter
    sources = {k: surface_source(scans[k], NUM_POINTS) for k in poses}
    arm = lever_arm(diameter)
    logs = dict.fromkeys(poses, 0.0)
    deviations: dict[int, float] = {}
    order: list[int] = []
    terms: list[Term] = []
    centres: dict[int, FloatArray] = {}
    for _ in range(NUM_ROUNDS):
        terms.clear()  # those of this round take as much memory
        grown = {k: _grown(sources[k], np.exp(-logs[k])) for k in poses}
        terms = _surface_terms(grown, poses, pairs, sensor, workers)
        order = [k for k in poses if any(k in (term.i, term.j) for term in terms)]
        if len(order) < 2:
            return {}
        centres = {k: poses[k].apply(grown[k].points.mean(axis=0)) for k in order}
        twists, steps, spreads = _solve(terms, order, centres, arm)
        middle = np.mean([centres[k] for k in order], axis=0)
        for k, twist, step, spread in zip(order, twists, steps, spreads, strict=True):
            # Grown about the sensor in the next round, it is moved back to where it was.
            about = poses[k].translation
            back = (1.0 - np.exp(step)) * (centres[k] - about)
            stay = Pose(rotation=np.eye(3), translation=back)
            poses[k] = motion_of(twist, middle, arm) @ stay @ poses[k]
            logs[k] -= step
            deviations[k] = float(spread)
    usual = float(np.median([logs[k] for k in order]))
    excess = _excess_scatter(terms, order, centres, arm)
    # A sensor whose scans all differ in scale makes none of them an exception.
    scatter = MAD_TO_SIGMA * float(np.median([abs(logs[k] - usual) for k in order]))
    return {
        k: ScaleEstimate(
            factor=float(np.exp(logs[k] - usual)), deviation=max(excess * deviations[k], scatter)
        )
        for k in order
    }


def _excess_scatter(
    terms: Sequence[Term], order: Sequence[int], centres: Mapping[int, FloatArray], arm: float
) -> float:
    """How many times more than by their deviations pairs, asked alone, differ from all together.

    Bent depth looks like another scale in each pair. Where scans are truly of another size, all
    their pairs say the same. It is at least 1 (Birge 1932).
    """
    pairs: dict[tuple[int, int], list[Term]] = {}
    for term in terms:
        pairs.setdefault((min(term.i, term.j), max(term.i, term.j)), []).append(term)
    ratios = []
    for (i, j), both in pairs.items():
        if any(term.weights.any() for term in both):
            _, steps, spreads = _solve(both, [i, j], centres, arm)
            ratios.append(abs(float(steps[0] - steps[1])) / (2.0 * float(spreads[0])))
    return max(1.0, MAD_TO_SIGMA * float(np.median(ratios))) if ratios else 1.0


def _grown(source: SurfaceSource, factor: float) -> SurfaceSource:
    """The same surface as a sensor sees it whose ranges are longer by a factor."""
    camera = np.array(source.camera)
    if camera[0] != 0.0:
        camera[1:3] /= factor
    return replace(source, points=factor * source.points, stretch=float(factor), camera=camera)


def _surface_terms(
    sources: Mapping[int, SurfaceSource],
    poses: Mapping[int, Pose],
    pairs: Collection[tuple[int, int]],
    sensor: SensorModel,
    workers: int,
) -> list[Term]:
    """Matches, each with its robust weight over the variance that the sensor leaves it."""
    diameter = sensor.diameter
    found = match_surfaces(sources, poses, pairs, MATCH_DIAMETERS * diameter, workers)
    noise = SURFACE_NOISE_DIAMETERS * diameter, 1.0
    terms = weighted_terms(found, [], poses, 0.0, noise)
    back = {k: pose.inverse() for k, pose in poses.items()}
    return [
        replace(term, weights=term.weights * match_weights(back[term.j].apply(term.points), sensor))
        for term in terms
    ]


def _solve(
    terms: Sequence[Term], order: Sequence[int], centres: Mapping[int, FloatArray], arm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Twists (N, 6) and growths (N,) that make surfaces agree, and the growths' deviations."""
    unknowns = 7  # of each scan: rotation, translation, growth, all of them lengths
    size = unknowns * len(order)
    place = {k: slice(unknowns * n, unknowns * (n + 1)) for n, k in enumerate(order)}
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    centre = np.mean([centres[k] for k in order], axis=0)
    for term in terms:
        a, b = place[term.i], place[term.j]
        by_motion = term.jacobian(centre, arm)
        by_i = np.column_stack([by_motion, _by_growth(term, centres[term.i]) / arm])
        by_j = -np.column_stack([by_motion, _by_growth(term, centres[term.j]) / arm])
        weighted_i, weighted_j = (term.weights[:, None] * by for by in (by_i, by_j))
        normal[a, a] += weighted_i.T @ by_i
        normal[b, b] += weighted_j.T @ by_j
        cross = weighted_i.T @ by_j
        normal[a, b] += cross
        normal[b, a] += cross.T
        gradient[a] += weighted_i.T @ term.residuals
        gradient[b] += weighted_j.T @ term.residuals
    growths = np.arange(unknowns - 1, size, unknowns)
    # The first scan stays, and a growth of all together is not seen: theirs sum to 0.
    normal[np.ix_(growths, growths)] += np.trace(normal) / size
    free = np.arange(unknowns - 1, size)
    inverse = np.linalg.inv(damped(normal[np.ix_(free, free)]))
    solved = np.zeros(size)
    solved[free] = -inverse @ gradient[free]
    variance = np.zeros(size)
    variance[free] = np.diag(inverse)
    steps = solved.reshape(-1, unknowns)
    return steps[:, :-1], steps[:, -1] / arm, np.sqrt(variance[growths]) / arm


def _by_growth(term: Term, centre: FloatArray) -> FloatArray:
    """Change of the residuals (N,) by the growth of a scan about its centre."""
    return np.einsum("nk,nk->n", term.directions, term.points - centre)
