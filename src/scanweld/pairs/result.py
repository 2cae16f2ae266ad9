"""Records of the pair stage: evidence, kinds of pairs and their judged relative poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from scanweld.evidence.evidence import MIN_AGREE, Evidence
from scanweld.evidence.rivals import (
    CLEAN_CONTRADICTION,
    MIN_RIVAL_SHARE,
    as_rival,
    margin_over,
    refutation,
)
from scanweld.evidence.slippage import Slippage
from scanweld.geometry.arrays import FloatArray, frozen
from scanweld.geometry.pose import Pose
from scanweld.pairs.symmetry import Symmetry

MARGIN_WEIGHT = 2.0
"""Logarithm of the weight that a pose has over a rival which it beats by just the margin."""


class PairKind(StrEnum):
    """What two scans say about their relative pose."""

    GOOD = "good"
    SLIDING = "sliding"
    AMBIGUOUS = "ambiguous"
    CONTRADICTED = "contradicted"
    NO_OVERLAP = "no overlap"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Alternative:
    """A pose of a pair with its evidence. The frames are those of the result it belongs to.

    Attributes:
        i_from_j: The pose.
        evidence: What both sensors say of it.
        is_given: Whether it comes from a start pose alone: the search did not find it.
    """

    i_from_j: Pose
    evidence: Evidence
    is_given: bool = False

    @property
    def score(self) -> float:
        """The evidence's score."""
        return self.evidence.score


def rival_score(rival: Alternative, best: Alternative) -> float:
    """What a pose scores as a rival of another one of the same two scans; see ``as_rival``."""
    said, told = rival.evidence, best.evidence
    if said.agree < MIN_AGREE:
        return rival.score
    patches = said.contradiction, told.contradiction
    return as_rival(rival.score, (said.agree, told.agree), patches, CLEAN_CONTRADICTION)


def near_best(alternatives: Sequence[Alternative], max_margin: float) -> list[Alternative]:
    """The first alternative, its best rival, and others it does not beat by a share of its score.

    Args:
        alternatives: Distinct poses of a pair, the one to be judged first, rivals best first.
        max_margin: The share.
    """
    if len(alternatives) < 2:
        return list(alternatives)
    first, rival, *others = alternatives
    least = (1.0 - max_margin) * first.score
    return [first, rival, *(option for option in others if option.score >= least)]


def weights_of(
    alternatives: Sequence[Alternative], min_margin: float, min_score: float
) -> tuple[float, ...]:
    """How much each alternative counts beside the others; sums to 1.

    Weights fall exponentially with the score (of the others, as rivals of the first), by
    e^2 = 7.4 where the first pose beats a rival by just the margin that makes it sure.

    Args:
        alternatives: Distinct poses of a pair, the best first.
        min_margin: Share of the score by which a pose must beat its rivals to be sure.
        min_score: Least score of a pair; of worse ones the margin is not measured.
    """
    if not alternatives:
        return ()
    first, *others = alternatives
    scores = np.array([first.score, *(rival_score(option, first) for option in others)])
    step = max(min_margin * max(scores.max(), min_score), np.finfo(float).eps)
    weights = np.exp(MARGIN_WEIGHT * (scores - scores.max()) / step)
    return tuple((weights / weights.sum()).tolist())


def margin_among(chosen: Alternative, alternatives: Sequence[Alternative]) -> float:
    """Margin of one of a pair's poses over the others."""
    others = [option for option in alternatives if option is not chosen]
    return margin_over(chosen.score, [rival_score(other, chosen) for other in others])


def refutation_among(chosen: Alternative, alternatives: Sequence[Alternative]) -> float:
    """How clearly the others of a pair's poses are refuted."""
    least = max(MIN_AGREE, MIN_RIVAL_SHARE * chosen.evidence.agree)
    rivals = [other.evidence for other in alternatives if other is not chosen]
    return refutation([told.contradiction for told in rivals if told.agree >= least])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairResult:
    """What was found out about scans i < j; poses relate their sensor frames.

    Attributes:
        i: Index of the first scan in the run's order,
        j: of the second.
        kind: Kind of the pair.
        reason: Why it is not good, in words; empty where it is.
        alternatives: Distinct poses, best first; none where nothing fits at all.
        information: (6, 6) point-to-plane information of the best pose, as ``information_of``
            gives it.
        observability: Smallest over largest eigenvalue of the information; 0 if that is negative.
        margin: Share of the best score by which it beats its best distinct rival; 1 without rival.
        rms: Point-to-plane residual of the best pose's matches, in the scans' unit; NaN if none.
        sliding: Which motion is free, where the pair is a sliding one.
        symmetry: What the equally good poses of an ambiguous pair have in common.
        rests_on_feature: Whether the best pose of an ambiguous pair is the one that explains a
            symmetry-breaking feature, all others that tie being left out: they contradict it or
            hide it.
        passed_over: Those others, best first, where a feature decides.
        further_ties: More poses that explain the scans as well. They are reported, and propose
            nothing.
        is_searched: Whether all was tried from any start. If not, the pose came from a quick search
            or from other pairs, and the margin is over the rivals that were seen on the way.
        is_compared: Whether anything was asked of the two scans at all.
    """

    i: int
    j: int
    kind: PairKind
    reason: str
    alternatives: tuple[Alternative, ...]
    information: FloatArray
    observability: float
    margin: float
    rms: float
    sliding: Slippage | None = None
    symmetry: Symmetry | None = None
    rests_on_feature: bool = False
    passed_over: tuple[Alternative, ...] = ()
    further_ties: tuple[Alternative, ...] = ()
    is_searched: bool = True
    is_compared: bool = True

    def __post_init__(self) -> None:
        if not self.i < self.j:
            raise ValueError("a pair is kept with i < j")
        object.__setattr__(self, "information", frozen(self.information, np.float64, (6, 6)))

    @property
    def best(self) -> Alternative | None:
        """The best-scored pose, if there is any."""
        return self.alternatives[0] if self.alternatives else None
