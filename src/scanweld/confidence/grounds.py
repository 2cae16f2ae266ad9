"""What a confidence rests on: named numbers on a pair and on a scan, more of each is better.

All are free of units and frames.
"""

from collections.abc import Mapping

import numpy as np

from scanweld.confidence.diagnostics import Fit
from scanweld.confidence.joint_evidence import MIN_CONDUCTANCE, JointEvidence
from scanweld.evidence.evidence import Evidence
from scanweld.pairs.result import Alternative, PairResult, margin_among, refutation_among

Grounds = Mapping[str, float]

LEAST_OBSERVABILITY = 1e-7
MAX_RATIO = 10.0
"""Of misfits over what the sensor leaves of them, or the inverse: beyond, all say the same."""
MAX_CONTRADICTION = 2.0
MIN_CORROBORATION = MIN_CONDUCTANCE
"""Conductance between two scans below which other pairs do not hold them together."""


def pair_grounds(
    result: PairResult,
    chosen: Alternative,
    told: Evidence,
    fit: Fit,
    joint: JointEvidence | None,
    is_accepted: bool,
) -> Grounds:
    """Grounds to believe one pose of a pair.

    Where the rest of the graph holds both scans without this pair, what it says of their places
    counts if it is more than what the two scans say alone: a third scan may decide.

    Args:
        result: The pair.
        chosen: The pose.
        told: The evidence on it, at the tolerance of the set.
        fit: How the two scans lie on each other in it.
        joint: The component that both scans are in, if they are in one.
        is_accepted: Whether the pose agrees with the component's.
    """
    observability = fit.observability
    margin = margin_among(chosen, result.alternatives)
    refutation = refutation_among(chosen, result.alternatives)
    support = opposition = 0.0
    if joint is not None and not is_accepted:
        opposition = -joint.conductance[result.i, result.j]
    if joint is not None and is_accepted:
        support = joint.conductance_without((result.i, result.j), chosen.score)
        if is_corroborated(support):
            both = result.i, result.j
            margin = max(margin, min(joint.margins[k] for k in both))
            refutation = max(refutation, min(joint.refutations[k] for k in both))
            observability = max(observability, min(joint.fits[k].observability for k in both))
    return {
        "contradiction": -min(told.contradiction, MAX_CONTRADICTION),
        "margin": max(margin, -1.0),
        "refutation": refutation,
        "observability": float(np.log10(max(observability, LEAST_OBSERVABILITY))),
        "coherence": fit.coherence,
        "misfit": -_magnitude(fit.misfit),
        "support": support,
        "opposition": opposition,
    }


def scan_grounds(
    k: int,
    joint: JointEvidence,
    link: float,
    coherence: float,
) -> Grounds:
    """Grounds to believe the place of a scan in its component.

    Args:
        k: The scan.
        joint: Its component.
        link: How surely pairs tie it to the reference scan.
        coherence: The best contour coherence of its accepted pairs.
    """
    fit = joint.fits[k]
    return {
        "margin": joint.margins[k],
        "refutation": joint.refutations[k],
        "observability": float(np.log10(max(fit.observability, LEAST_OBSERVABILITY))),
        "coherence": coherence,
        "misfit": -_magnitude(fit.misfit),
        "link": link,
    }


def _magnitude(ratio: float) -> float:
    """As a power of ten, within bounds."""
    return float(np.log10(np.clip(ratio, 1.0 / MAX_RATIO, MAX_RATIO)))


def is_corroborated(support: float) -> bool:
    """Whether other accepted pairs hold the two scans of a pair together."""
    return support > MIN_CORROBORATION
