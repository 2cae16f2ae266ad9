"""Certain pairs -> sensor model: what surfaces make sure of tells how well they are measured.

Free space takes no part in what makes a pair certain, else nothing could be learnt of it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from scanweld.evidence.evidence import NO_LIMIT
from scanweld.evidence.field import ScanField
from scanweld.evidence.information import two_way_matches
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.buckets import cells_of
from scanweld.geometry.gauss_newton import MAD_TO_SIGMA
from scanweld.pairs.result import PairResult
from scanweld.pairs.verdict import MAX_CONTRADICTION
from scanweld.sensor.certain import Edge, certain_pairs
from scanweld.sensor.closure import NO_CYCLES, closure_of
from scanweld.sensor.model import NUM_SPREAD_BINS, SPREAD_SIGMAS, SensorModel

MIN_CERTAIN = 2
"""Fewer say nothing of the set's silhouettes."""
REACH_DIAMETERS = 0.04
"""Farthest that surfaces that should coincide may lie apart."""
TOLERANCE_SIGMAS = 5.0
"""Depth tolerance in standard deviations, which open cycles that were not seen add to,"""
MAX_TOLERANCE_DIAMETERS = 0.03
"""but not more than this: what lies farther apart is another place."""
USUAL_SPREAD = 0.75
"""Quantile of the contradiction of certain pairs that is added to the usual limit."""
OUTER_FENCE = 3.0
"""Interquartile ranges above the upper quartile beyond which a value is far out (Tukey 1977)."""
PATCH_DIAMETERS = 0.06
"""Edge of the cells within which residuals are averaged to find what neighbours share."""
PRIOR_SIGMA_DIAMETERS = 0.002
"""Of a set that does not tell: between range scanners (0.001) and depth cameras (0.0045)."""


def learn_sensor(
    pairs: Mapping[Edge, PairResult],
    fields: Sequence[ScanField],
    diameter: float,
    usual_tolerance: float,
    usual_contradiction: float,
) -> SensorModel:
    """Learn from the pairs of a set what its sensor does.

    Args:
        pairs: All pairs, judged.
        fields: All scans, laid out.
        diameter: Of the run, in the scans' unit.
        usual_tolerance: Depth tolerance, at least, in the scans' unit.
        usual_contradiction: Limit of violating patches over what agrees, at least.
    """
    certain = certain_pairs(pairs.values())
    found = [_residuals(pair, fields, diameter) for pair in certain]
    residuals = np.concatenate([[], *(each for each, _ in found)])
    if len(residuals) == 0:
        prior = PRIOR_SIGMA_DIAMETERS * diameter
        return SensorModel(
            num_certain=0,
            sigma=prior,
            white=prior,
            correlated=prior,
            tolerance=usual_tolerance,
            max_contradiction=usual_contradiction,
            diameter=diameter,
            misclosure=NO_CYCLES.misclosure(float(np.hypot(prior, prior))),
        )
    sigma = MAD_TO_SIGMA * float(np.median(np.abs(residuals)))
    white, correlated = _parts(found, sigma, PATCH_DIAMETERS * diameter)
    closure = closure_of(pairs, fields, diameter)
    misclosure = closure.misclosure(float(np.hypot(white, correlated)))
    seen, likely = (
        float(np.hypot(sigma, each / np.sqrt(3.0)))  # of a displacement in no direction above all
        for each in (closure.displacement, misclosure)
    )
    limit, most_free = usual_contradiction, NO_LIMIT
    if len(certain) >= MIN_CERTAIN:
        shown = [pair.alternatives[0].evidence for pair in certain]
        limit += float(np.quantile([told.contradiction for told in shown], USUAL_SPREAD))
        most_free = _most_of_usual([told.free_patch for told in shown])
    return SensorModel(
        num_certain=len(certain),
        sigma=seen,
        white=white,
        correlated=correlated,
        tolerance=min(
            max(usual_tolerance, TOLERANCE_SIGMAS * likely), MAX_TOLERANCE_DIAMETERS * diameter
        ),
        max_contradiction=min(limit, MAX_CONTRADICTION),
        diameter=diameter,
        max_free_patch=most_free,
        closure=closure.displacement,
        misclosure=misclosure,
        spread=_spread(residuals, seen),
    )


def _most_of_usual(values: Sequence[float]) -> float:
    """The largest value, but no more than is not far out of all (Tukey's outer fence).

    Where a part moved, it is missing from a few certain pairs too, though from most it is not.
    """
    low, high = np.quantile(values, (0.25, 0.75))
    return float(min(max(values), high + OUTER_FENCE * (high - low)))


def _spread(residuals: FloatArray, sigma: float) -> tuple[int, ...]:
    """The residuals (N,), counted."""
    if sigma <= 0.0:
        return ()
    limits = (-SPREAD_SIGMAS * sigma, SPREAD_SIGMAS * sigma)
    counts, _ = np.histogram(residuals, NUM_SPREAD_BINS, range=limits)
    return tuple(counts.tolist())


def _residuals(
    pair: PairResult, fields: Sequence[ScanField], diameter: float
) -> tuple[FloatArray, FloatArray]:
    """Distances (N,) between the surfaces of a pair at its best pose, and where, (N, 3)."""
    matches = two_way_matches(
        fields[pair.i], fields[pair.j], pair.alternatives[0].i_from_j, REACH_DIAMETERS * diameter
    )
    return matches[3], matches[0]


def _parts(
    found: Sequence[tuple[FloatArray, FloatArray]], sigma: float, patch: float
) -> tuple[float, float]:
    """What residuals within a patch do not share, and what they do, as standard deviations."""
    within, freedom, means = 0.0, 0, []
    for residuals, points in found:
        kept = np.abs(residuals) <= 4.0 * sigma
        if not kept.any():
            continue
        residuals, (cell, count) = residuals[kept], cells_of(points[kept], patch)
        mean = np.bincount(cell, weights=residuals) / count
        within += float(((residuals - mean[cell]) ** 2).sum())
        freedom += len(residuals) - len(count)
        means += [(m, n) for m, n in zip(mean, count, strict=True) if n > 1]
    variance = within / max(freedom, 1)
    if not means:
        return float(np.sqrt(variance)), sigma
    mean, count = np.array(means).T
    shared = float(np.average(mean**2, weights=count)) - variance * len(count) / float(count.sum())
    return float(np.sqrt(variance)), float(np.sqrt(max(shared, 0.0)))
