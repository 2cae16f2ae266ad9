"""What two scans alone say about their pose: good, sliding, ambiguous, contradicted, no overlap."""

from collections.abc import Sequence

import numpy as np

from scanweld.config import PairsConfig
from scanweld.evidence.evidence import MIN_AGREE
from scanweld.evidence.field import ScanField
from scanweld.evidence.information import information_from, observability_of, two_way_matches
from scanweld.evidence.slippage import Slide, Slippage, slide_words, slippage_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.alternatives import refined_at, schedules
from scanweld.pairs.holding import comes_back
from scanweld.pairs.result import (
    Alternative,
    PairKind,
    PairResult,
    margin_among,
    near_best,
    weights_of,
)
from scanweld.pairs.symmetry import Symmetry, symmetry_of

ALIKE_SHARE = 0.5
"""Rivals within this share of the margin that makes a pose sure show symmetries; those beaten more
clearly are often chance."""
_NOTHING_MEETS = "no pose makes the scans overlap"


def result_of(
    i: int,
    j: int,
    field_i: ScanField,
    field_j: ScanField,
    alternatives: tuple[Alternative, ...],
    diameter: float,
    config: PairsConfig,
    *,
    is_marked: bool = False,
) -> PairResult:
    """The result of a pair from its distinct poses, the one to be judged first.

    If only a mark decides for it, turns that hide the mark being left, then the pair stays
    ambiguous, and no turn is free. A sure pose of which noise leaves no information, but which
    comes back from wherever it is pushed, does not slide.
    """
    if not alternatives:
        return no_pose(i, j, _NOTHING_MEETS)
    best, tolerance = alternatives[0], config.tolerance_diameters[2] * diameter
    matches = two_way_matches(field_i, field_j, best.i_from_j, tolerance)
    information, rms, _ = information_from([matches], diameter)
    symmetry = _symmetry_among(alternatives, field_j, diameter, config)

    def classified(*, is_held: bool) -> PairResult:
        found = information, rms, symmetry
        flags = {"is_marked": is_marked, "is_held": is_held}
        return classify_pair(i, j, alternatives, *found, config, **flags)

    def refine(poses: Sequence[Pose]) -> list[Alternative]:
        _, near = schedules(diameter)
        return refined_at(field_i, field_j, poses, near, tolerance, diameter)

    result = classified(is_held=False)
    if result.kind is not PairKind.SLIDING or result.margin < config.min_margin:
        return result
    least = config.min_observability, config.min_margin
    is_held = comes_back(best, information, matches[0], diameter, refine, *least)
    return classified(is_held=is_held)


def _symmetry_among(
    alternatives: Sequence[Alternative], j: ScanField, diameter: float, config: PairsConfig
) -> Symmetry | None:
    """What the best pose has in common with those that fit nearly as well."""
    alike = near_best(alternatives, ALIKE_SHARE * config.min_margin)
    weights = weights_of(alike, config.min_margin, config.min_score)
    return symmetry_of([option.i_from_j for option in alike], weights, j.centre, diameter)


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
    is_held: bool = False,
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
        is_held: Whether the best pose does not slide, though there is no information.
    """
    margin = margin_among(alternatives[0], alternatives) if alternatives else 0.0
    sliding = slippage_of(information, config.min_observability)
    if is_held or (is_marked and sliding is not None and sliding.slide is Slide.REVOLUTION):
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
        return PairKind.NO_OVERLAP, _NOTHING_MEETS
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
