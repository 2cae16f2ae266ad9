"""What pairs propose: motions that would lay one component of placed scans onto another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.evidence.judge import Poses
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.pairs.result import PairKind, PairResult

MIN_CANDIDATE_SCORE = -0.25
"""Alternatives scored below this propose nothing."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Proposal:
    """A pair's alternative that proposes a merge: scan i of the first component, j of the second.

    Attributes:
        i: Scan of the first component.
        j: Scan of the second.
        rank: Of the alternative in the pair's result, 0 for the best.
        score: Its score.
        agree: Share of the samples that agree in it.
        is_good: Whether it is the best of a good pair, or of one that a feature decides.
        rests_on_feature: Whether it is the best of a pair that a feature decides.
        is_sliding: Whether its pair slides.
        is_given: Whether it comes from start poses alone.
    """

    i: int
    j: int
    rank: int
    score: float
    agree: float
    is_good: bool
    rests_on_feature: bool = False
    is_sliding: bool = False
    is_given: bool = False

    @property
    def alternative(self) -> tuple[int, int, int]:
        """The alternative it stands for: its pair (i, j), i < j, and its rank."""
        return min(self.i, self.j), max(self.i, self.j), self.rank


Motion = tuple[Pose, tuple[Proposal, ...]]
"""A motion a_from_b between two components, and the proposals of it, strongest first."""


def proposed_motions(
    a: Poses,
    b: Poses,
    pairs: Mapping[tuple[int, int], PairResult],
    centres: Sequence[FloatArray],
    same: PoseTolerance,
) -> list[Motion]:
    """Distinct motions between two components, those with the strongest proposals first.

    Args:
        a: First component.
        b: Second component.
        pairs: Results of all pairs, by i < j.
        centres: (3,) middle of each scan's samples, sensor frame.
        same: Proposals that differ by less propose the same.
    """
    middle = np.mean([b[j].apply(centres[j]) for j in sorted(b)], axis=0)
    return _cluster(_collect(a, b, pairs), middle, same)


def _collect(
    a: Poses, b: Poses, pairs: Mapping[tuple[int, int], PairResult]
) -> list[tuple[Pose, Proposal]]:
    """The motion that each alternative of each pair across proposes, best scored first."""
    found = [
        proposal
        for i in sorted(a)
        for j in sorted(b)
        if (result := pairs.get((min(i, j), max(i, j)))) is not None
        for proposal in _proposals_of(result, i, j, a[i], b[j].inverse())
    ]
    found.sort(key=lambda proposal: -proposal[1].score)
    return found


def _proposals_of(
    result: PairResult, i: int, j: int, a_from_i: Pose, j_from_b: Pose
) -> list[tuple[Pose, Proposal]]:
    proposals = []
    for rank, option in enumerate(result.alternatives):
        if option.score < MIN_CANDIDATE_SCORE:
            continue
        i_from_j = option.i_from_j if i < j else option.i_from_j.inverse()
        rests_on_feature = rank == 0 and result.rests_on_feature
        proposal = Proposal(
            i=i,
            j=j,
            rank=rank,
            score=option.score,
            agree=option.evidence.agree,
            is_good=rests_on_feature or (rank == 0 and result.kind is PairKind.GOOD),
            rests_on_feature=rests_on_feature,
            is_sliding=result.kind is PairKind.SLIDING,
            is_given=option.is_given,
        )
        proposals.append((a_from_i @ i_from_j @ j_from_b, proposal))
    return proposals


def _cluster(
    proposals: list[tuple[Pose, Proposal]], middle: FloatArray, same: PoseTolerance
) -> list[Motion]:
    """Proposals of the same motion as a stronger one join it, one a pair."""
    turns = np.array([motion.rotation.ravel() for motion, _ in proposals]).reshape(-1, 9)
    middles = np.array([motion.apply(middle) for motion, _ in proposals]).reshape(-1, 3)
    min_trace = 1.0 + 2.0 * np.cos(same.angle)
    clusters: list[Motion] = []
    left = np.arange(len(proposals))
    while len(left):
        head = left[0]
        shift = np.linalg.norm(middles[left] - middles[head], axis=1)
        joins = (turns[left] @ turns[head] > min_trace) & (shift < same.shift)
        joins[0] = True
        joined: dict[tuple[int, int], Proposal] = {}
        for n in left[joins]:
            proposal = proposals[n][1]
            joined.setdefault((proposal.i, proposal.j), proposal)
        clusters.append((proposals[head][0], tuple(joined.values())))
        left = left[~joins]
    clusters.sort(key=lambda cluster: -sum(p.score - MIN_CANDIDATE_SCORE for p in cluster[1]))
    return clusters
