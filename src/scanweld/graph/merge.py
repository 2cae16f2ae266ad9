"""Ways to lay one component of placed scans onto another, and what all their scans say of it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from scanweld.evidence.evidence import MAX_EXCESS, VIOLATION_WEIGHT, Evidence, seen_twice
from scanweld.evidence.judge import PairJudge, Poses
from scanweld.evidence.patches import PixelConsensus, is_refuted_jointly, violates_free_space
from scanweld.evidence.rivals import margin_over
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.proposals import Motion, Proposal, proposed_motions
from scanweld.pairs.result import PairResult
from scanweld.pairs.symmetry_breaking import MIN_REFUTED

MAX_JUDGED = 12
"""Distinct ways to merge two components that are judged, those with most support first."""
TIED_SHARE = 0.4
"""Merges within this share of the best one's score are told apart by all pixels, if they can be."""
FREE_SHARE = 0.1
"""Weight of free space when many pairs speak: real silhouettes have gaps, surfaces do not."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Merge:
    """One way to lay component b onto component a, judged by every pair across.

    Attributes:
        a_from_b: The motion between the components' frames.
        proposals: The alternatives that propose it, strongest first, one a pair.
        agree: Sum over the pairs across of the shares of samples that agree,
        violated: that lie before the other's surface or contradict it,
        free: that lie in the other's free space.
        worst: Largest excess of patches before surfaces of any single pair across, or of patches in
            free space of any two, over what the set excuses.
        margin: Share of the score by which it beats its best distinct rival.
    """

    a_from_b: Pose
    proposals: tuple[Proposal, ...]
    agree: float
    violated: float
    free: float
    worst: float
    margin: float = 1.0

    @property
    def num_independent(self) -> int:
        """Proposals found independently: start poses say the same of all pairs, and count once."""
        found = sum(not proposal.is_given for proposal in self.proposals)
        return found + (found < len(self.proposals))

    @property
    def is_contradicted(self) -> bool:
        """Whether any single pair across shows that the merge is wrong, whatever others say."""
        return self.worst > MAX_EXCESS

    @property
    def score(self) -> float:
        """Agreement less weighted violations, summed over the pairs across."""
        return self.agree - VIOLATION_WEIGHT * self.violated - FREE_SHARE * self.free


_Option = tuple[Merge, Sequence[PixelConsensus]]
_Refutes = Callable[[Sequence[PixelConsensus], Sequence[PixelConsensus]], bool]


def propose_merges(
    a: Poses,
    b: Poses,
    pairs: Mapping[tuple[int, int], PairResult],
    centres: Sequence[FloatArray],
    same: PoseTolerance,
    judge: PairJudge,
) -> list[Merge]:
    """Distinct ways to merge two components, best first, each with its margin over its rivals.

    Args:
        a: First component.
        b: Second component.
        pairs: Results of all pairs, by i < j.
        centres: (3,) middle of each scan's samples, sensor frame.
        same: Proposals that differ by less propose the same.
        judge: Gives the evidence on any pair at any pose.
    """
    motions = proposed_motions(a, b, pairs, centres, same)[:MAX_JUDGED]
    merges = _judged_motions(a, b, motions, judge)
    merges.sort(key=lambda merge: (merge.is_contradicted, -merge.score))
    return with_margins(merges)


def with_margins(merges: Sequence[Merge]) -> list[Merge]:
    """The merges, each with its margin over the others that nothing contradicts."""
    rivals = [merge for merge in merges if not merge.is_contradicted]
    return [
        replace(merge, margin=margin_over(merge.score, [m.score for m in rivals if m is not merge]))
        for merge in merges
    ]


def unrefuted(a: Poses, b: Poses, merges: Sequence[Merge], judge: PairJudge) -> list[Merge]:
    """Merges, best first, that no other one refutes by all pixels, with margins over those left.

    Looked at are those tied with the best. One that a sure pair proposes is tied however little the
    components meet in it.

    Args:
        a: First component.
        b: Second component.
        merges: Ways to merge them, best first.
        judge: Says what all pixels of the scans say of each other.
    """
    least = (1.0 - TIED_SHARE) * merges[0].score if merges else 0.0
    tied = [
        merge
        for merge in merges
        if merge.score > 0 and (merge.score >= least or any(p.is_good for p in merge.proposals))
    ]
    refuted = _refuted(a, b, tied, judge) if len(tied) > 1 else set[Merge]()
    return with_margins(_decided([merge for merge in merges if merge not in refuted]))


def _refuted(a: Poses, b: Poses, tied: Sequence[Merge], judge: PairJudge) -> set[Merge]:
    """Those of several merges that another one refutes."""
    consensus = [
        judge.pixels(a, {j: merge.a_from_b @ pose for j, pose in b.items()}) for merge in tied
    ]
    left = _standing(list(zip(tied, consensus, strict=True)), is_refuted_jointly)
    # Outlines also lack what a sensor missed: they speak only where surfaces have shown a feature.
    if len(tied) - len(left) >= MIN_REFUTED:
        left = _standing(left, violates_free_space)
    return set(tied) - {merge for merge, _ in left}


def _standing(options: list[_Option], refutes: _Refutes) -> list[_Option]:
    """Options that no other refutes; all of them if that leaves none."""
    standing = [
        (merge, own)
        for merge, own in options
        if not any(refutes(own, other) for _, other in options if other is not own)
    ]
    return standing or options


def _decided(merges: list[Merge]) -> list[Merge]:
    """Merges without those that sliding pairs alone propose, if a feature decides for another one.

    A pair that slides fits anywhere on its way. What it proposes there is chance.
    """
    if not any(proposal.rests_on_feature for merge in merges for proposal in merge.proposals):
        return merges
    return [merge for merge in merges if not all(p.is_sliding for p in merge.proposals)]


def without_excluded(
    excluded: Collection[tuple[int, int, int]], merges: Sequence[Merge]
) -> list[Merge]:
    """Merges that others than the excluded alternatives (i, j, rank), i < j, propose too.

    There, excluded ones count like weak pairs. An excluded alternative still counts as a
    competitor, so excluding it never raises another margin.
    """
    left = [m for m in merges if not all(p.alternative in excluded for p in m.proposals)]
    return [replace(m, proposals=tuple(_demoted(p, excluded) for p in m.proposals)) for m in left]


def _demoted(proposal: Proposal, excluded: Collection[tuple[int, int, int]]) -> Proposal:
    return replace(proposal, is_good=False) if proposal.alternative in excluded else proposal


def judged_in_place(merge: Merge, a: Poses, b: Poses, poses: Poses, judge: PairJudge) -> Merge:
    """The merge judged anew at poses of all its scans in one frame; its margin stays.

    Args:
        merge: A way to lay b onto a.
        a: First component.
        b: Second component.
        poses: Of the scans of both.
        judge: Gives the evidence on any pair at any pose.
    """
    evidence = [
        judge.pair(i, j, poses[i].inverse() @ poses[j]) for i in sorted(a) for j in sorted(b)
    ]
    return replace(_summed(merge.a_from_b, merge.proposals, evidence, judge), margin=merge.margin)


def judged_motion(a: Poses, b: Poses, a_from_b: Pose, judge: PairJudge) -> Merge:
    """One motion between two components, whoever proposes it, judged by all pairs across."""
    (merge,) = _judged_motions(a, b, [(a_from_b, ())], judge)
    return merge


def _judged_motions(a: Poses, b: Poses, motions: Sequence[Motion], judge: PairJudge) -> list[Merge]:
    """Each motion judged by all pairs across; a pair is asked of all motions at once."""
    moved = [{j: a_from_b @ b[j] for j in sorted(b)} for a_from_b, _ in motions]
    by_pair = []
    for i in sorted(a):
        i_from_a = a[i].inverse()
        by_pair += [judge.poses(i, j, [i_from_a @ poses[j] for poses in moved]) for j in sorted(b)]
    return [
        _summed(a_from_b, proposals, [evidence[n] for evidence in by_pair], judge)
        for n, (a_from_b, proposals) in enumerate(motions)
    ]


def _summed(
    a_from_b: Pose, proposals: tuple[Proposal, ...], evidence: Sequence[Evidence], judge: PairJudge
) -> Merge:
    violated = [e.surface_violation for e in evidence]
    return Merge(
        a_from_b=a_from_b,
        proposals=proposals,
        agree=sum(e.agree for e in evidence),
        violated=sum(violated),
        free=sum(e.free for e in evidence),
        worst=max(
            *(e.front_excess(judge.limits) for e in evidence),
            seen_twice(e.free_excess(judge.limits) for e in evidence),
        ),
    )
