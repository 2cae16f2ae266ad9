"""What two scans alone say about their pose: good, sliding, ambiguous, contradicted, no overlap."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanweld.config import PairsConfig
from scanweld.evidence.evidence import MIN_AGREE, Evidence
from scanweld.evidence.information import information_from, observability_of
from scanweld.evidence.slippage import Slide, Slippage, slide_words, slippage_of
from scanweld.geometry.arrays import FloatArray
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import (
    Alternative,
    PairKind,
    PairResult,
    margin_among,
    near_best,
    weights_of,
)
from scanweld.pairs.stability import is_stable
from scanweld.pairs.symmetry import Symmetry, symmetry_of

ALIKE_SHARE = 0.5
"""Rivals within this share of the margin that makes a pose sure show symmetries; those beaten more
clearly are often chance."""
MAX_CONTRADICTION = 0.35
"""Patches over what agrees that no set excuses: whole parts of wrong poses come to this."""
_NOTHING_MEETS = "no pose makes the scans overlap"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Measured:
    """What was measured at the best pose of a pair.

    Attributes:
        information: (6, 6) information of the pose, as ``information_of`` gives it.
        rms: Residual of its matches, in the scans' unit; NaN if there are none.
        symmetry: What the best pose and its rivals have in common; None without a rival.
        rests_on_feature: Whether a symmetry-breaking feature alone decides, which some turns hide.
        is_stable: Whether the pose does not slide, though there is no information.
    """

    information: FloatArray
    rms: float
    symmetry: Symmetry | None = None
    rests_on_feature: bool = False
    is_stable: bool = False


def result_of(
    problem: PairProblem, alternatives: tuple[Alternative, ...], *, rests_on_feature: bool = False
) -> PairResult:
    """The result of a pair from its distinct poses, the one to be judged first.

    If only a feature decides for it, turns that hide the feature being left, then the pair stays
    ambiguous, and no turn is free. A sure pose of which noise leaves no information, but which
    comes back from wherever it is pushed, does not slide.
    """
    if not alternatives:
        return no_pose(*problem.edge, _NOTHING_MEETS)
    config, best = problem.config, alternatives[0]
    matches = problem.matches(best.i_from_j)
    information, rms, _ = information_from([matches], problem.diameter)
    measured = Measured(
        information=information,
        rms=rms,
        symmetry=_symmetry_among(problem, alternatives),
        rests_on_feature=rests_on_feature,
    )
    result = classify_pair(problem.edge, alternatives, measured, config)
    if result.kind is not PairKind.SLIDING or result.margin < config.min_margin:
        return result
    stable = is_stable(problem, best, information, matches[0])
    return classify_pair(problem.edge, alternatives, replace(measured, is_stable=stable), config)


def _symmetry_among(problem: PairProblem, alternatives: Sequence[Alternative]) -> Symmetry | None:
    """What the best pose has in common with those that fit nearly as well."""
    config = problem.config
    alike = near_best(alternatives, ALIKE_SHARE * config.min_margin)
    weights = weights_of(alike, config.min_margin, config.min_score)
    poses = [option.i_from_j for option in alike]
    return symmetry_of(poses, weights, problem.j.centre, problem.diameter)


def classify_pair(
    edge: tuple[int, int],
    alternatives: tuple[Alternative, ...],
    measured: Measured,
    config: PairsConfig,
) -> PairResult:
    """Give a pair its kind: what its evidence, margin and observability allow to say.

    Args:
        edge: Indices (i, j) of the scans, i < j.
        alternatives: Distinct poses between the sensor frames, best first.
        measured: What was measured at the best of them.
        config: Settings.
    """
    margin = margin_among(alternatives[0], alternatives) if alternatives else 0.0
    sliding = slippage_of(measured.information, config.min_observability)
    turns_freely = sliding is not None and sliding.slide is Slide.REVOLUTION
    if measured.is_stable or (measured.rests_on_feature and turns_freely):
        sliding = None
    kind, reason = _kind(alternatives, sliding, margin, measured.symmetry, config)
    rests_on_feature = measured.rests_on_feature and kind is PairKind.GOOD
    if rests_on_feature:
        kind, reason = PairKind.AMBIGUOUS, "only a small mark decides: other poses hide it"
    return PairResult(
        i=edge[0],
        j=edge[1],
        kind=kind,
        reason=reason,
        alternatives=alternatives,
        information=measured.information,
        observability=observability_of(measured.information),
        margin=margin,
        rms=measured.rms,
        sliding=sliding if kind is PairKind.SLIDING else None,
        symmetry=measured.symmetry if kind is PairKind.AMBIGUOUS else None,
        rests_on_feature=rests_on_feature,
    )


def held_to(result: PairResult, max_contradiction: float, evidence: Evidence) -> PairResult:
    """A pair by what its set lets violating patches come to, once that is known.

    Args:
        result: The pair.
        max_contradiction: Largest patches over what agrees.
        evidence: That on its best pose, at the tolerance of the set.
    """
    if result.kind in (PairKind.CONTRADICTED, PairKind.NO_OVERLAP):
        return result
    if evidence.contradiction <= max_contradiction:
        return result
    return replace(
        result,
        kind=PairKind.CONTRADICTED,
        reason=_contradicted(evidence),
        sliding=None,
        symmetry=None,
        rests_on_feature=False,
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


def not_compared(i: int, j: int, reason: str) -> PairResult:
    """The result of a pair of scans i < j of which nothing was asked."""
    return replace(no_pose(i, j, reason), is_searched=False, is_compared=False)


def _contradicted(evidence: Evidence) -> str:
    front, free = evidence.front_patch, evidence.free_patch
    told = f"patches of {front + free:.2f} violated, {evidence.agree:.2f} agreed"
    return f"each sensor saw through the other's surface: {told}"


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
    if best.evidence.contradiction > MAX_CONTRADICTION:
        return PairKind.CONTRADICTED, _contradicted(best.evidence)
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
