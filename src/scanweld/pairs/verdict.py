"""What two scans alone say about their pose: good, sliding, ambiguous, contradicted, no overlap."""

import numpy as np

from scanweld.config import PairsConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.pairs.information import observability_of
from scanweld.pairs.result import MIN_AGREE, Alternative, PairKind, PairResult, margin_among
from scanweld.pairs.slippage import Slide, Slippage, slide_words, slippage_of
from scanweld.pairs.symmetry import Symmetry


def classify_pair(
    i: int,
    j: int,
    alternatives: tuple[Alternative, ...],
    information: FloatArray,
    rms: float,
    symmetry: Symmetry | None,
    config: PairsConfig,
    *,
    is_marked: bool = False,
) -> PairResult:
    """Give a pair its kind: what its evidence, margin and observability allow to say.

    Args:
        i: Index of the first scan,
        j: of the second, i < j.
        alternatives: Distinct poses between the sensor frames, best first.
        information: (6, 6) information of the best pose.
        rms: Residual of the best pose, in the scans' unit; NaN if there is none.
        symmetry: What the best pose and its rivals have in common; None without a rival.
        config: Settings.
        is_marked: Whether a mark alone decides, which some turns hide.
    """
    margin = margin_among(alternatives[0], alternatives) if alternatives else 0.0
    sliding = slippage_of(information, config.min_observability)
    if is_marked and sliding is not None and sliding.slide is Slide.REVOLUTION:
        sliding = None
    kind, reason = _kind(alternatives, sliding, margin, symmetry, config)
    is_marked = is_marked and kind is PairKind.GOOD
    if is_marked:
        kind, reason = PairKind.AMBIGUOUS, "only a small mark decides: other poses hide it"
    return PairResult(
        i=i,
        j=j,
        kind=kind,
        reason=reason,
        alternatives=alternatives,
        information=information,
        observability=observability_of(information),
        margin=margin,
        rms=rms,
        sliding=sliding if kind is PairKind.SLIDING else None,
        symmetry=symmetry if kind is PairKind.AMBIGUOUS else None,
        is_marked=is_marked,
    )


def no_pose(i: int, j: int, reason: str) -> PairResult:
    """The result of a pair of scans i < j for which there is no pose at all."""
    return PairResult(
        i=i,
        j=j,
        kind=PairKind.NO_OVERLAP,
        reason=reason,
        alternatives=(),
        information=np.zeros((6, 6)),
        observability=0.0,
        margin=0.0,
        rms=float("nan"),
    )


def _kind(
    alternatives: tuple[Alternative, ...],
    sliding: Slippage | None,
    margin: float,
    symmetry: Symmetry | None,
    config: PairsConfig,
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
    if sliding is not None:
        return PairKind.SLIDING, f"the surfaces slide on each other {slide_words(sliding.slide)}"
    if margin < config.min_margin:
        told = f"another pose explains the scans as well: margin {margin:.2f}"
        apart = "" if symmetry is None else f"; what lies between: {symmetry.words}"
        return PairKind.AMBIGUOUS, told + apart
    return PairKind.GOOD, ""
