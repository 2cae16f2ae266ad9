"""What two scans alone say about their pose: good, sliding, ambiguous, contradicted, no overlap."""

import numpy as np

from scanweld.config import PairsConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.pairs.result import Alternative, PairKind, PairResult

MIN_AGREE = 0.05
"""Share of agreeing samples below which two scans do not overlap."""


def judge_pair(
    i: int,
    j: int,
    alternatives: tuple[Alternative, ...],
    information: FloatArray,
    rms: float,
    config: PairsConfig,
) -> PairResult:
    """Give a pair its kind: what its evidence, margin and observability allow to say."""
    eigenvalues = np.linalg.eigvalsh(information)
    observability = (
        float(max(eigenvalues[0], 0.0) / eigenvalues[-1]) if eigenvalues[-1] > 0 else 0.0
    )
    margin = margin_of(alternatives)
    kind, reason = _kind(alternatives, observability, margin, config)
    return PairResult(
        i=i,
        j=j,
        kind=kind,
        reason=reason,
        alternatives=alternatives,
        information=information,
        observability=observability,
        margin=margin,
        rms=rms,
    )


def margin_of(alternatives: tuple[Alternative, ...]) -> float:
    """Share of the best score by which it beats the best distinct rival; 1 without a rival."""
    if not alternatives or alternatives[0].score <= 0:
        return 0.0
    if len(alternatives) == 1:
        return 1.0
    best, rival = alternatives[0].score, alternatives[1].score
    return float(min(1.0, (best - rival) / best))


def _kind(
    alternatives: tuple[Alternative, ...], observability: float, margin: float, config: PairsConfig
) -> tuple[PairKind, str]:
    if not alternatives or alternatives[0].evidence.agree < MIN_AGREE:
        return PairKind.NO_OVERLAP, "no pose makes the scans overlap"
    best = alternatives[0]
    if best.evidence.violation > config.max_violated_share * best.evidence.agree:
        told = f"{best.evidence.violation:.2f} violated, {best.evidence.agree:.2f} agreed"
        return PairKind.CONTRADICTED, f"each sensor saw through the other's surface: {told}"
    if best.score < config.min_score:
        told = f"score {best.score:.2f} below {config.min_score:.2f}"
        return PairKind.NO_OVERLAP, f"too little overlap to be sure: {told}"
    if observability < config.min_observability:
        return (
            PairKind.SLIDING,
            f"the surfaces slide on each other: observability {observability:.1e}",
        )
    if margin < config.min_margin:
        return PairKind.AMBIGUOUS, f"another pose explains the scans as well: margin {margin:.2f}"
    return PairKind.GOOD, ""
