"""Ways to lay one component of placed scans onto another, and what all their scans say of it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanweld.evidence.evidence import VIOLATION_WEIGHT, Evidence
from scanweld.evidence.patches import Told, is_looked_past, is_refuted_jointly
from scanweld.evidence.rivals import margin_over
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.marks import MIN_REFUTED
from scanweld.pairs.result import PairKind, PairResult

Judge = Callable[[int, int, Pose], Evidence]
"""Mean evidence of both directions on scans i and j at a pose ``i_from_j`` of their sensors."""
Poses = Mapping[int, Pose]
"""component_from_sensor of a component's scans."""

Tell = Callable[[Poses, Poses], Sequence[Told]]
"""What the sensors of two components in one frame say of the pixels of each other's scans."""

MIN_CANDIDATE_SCORE = -0.25
"""Alternatives scored below this propose nothing."""
MAX_JUDGED = 12
"""Distinct ways to merge two components that are judged, those with most support first."""
TIED_SHARE = 0.4
"""Merges within this share of the best one's score are told apart by all pixels, if they can be."""
FREE_SHARE = 0.1
"""Weight of free space when many pairs speak: real silhouettes have gaps, surfaces do not."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Support:
    """A pair's alternative that proposes a merge: scan i of the first component, j of the second.

    Attributes:
        i: Scan of the first component.
        j: Scan of the second.
        rank: Of the alternative in the pair's result, 0 for the best.
        score: Its score.
        agree: Share of the samples that agree in it.
        is_good: Whether it is the best of a good pair, or of one that a mark decides.
        is_marked: Whether it is the best of a pair that a mark decides.
        is_sliding: Whether its pair slides.
        is_given: Whether it comes from start poses alone.
    """

    i: int
    j: int
    rank: int
    score: float
    agree: float
    is_good: bool
    is_marked: bool = False
    is_sliding: bool = False
    is_given: bool = False

    @property
    def alternative(self) -> tuple[int, int, int]:
        """The alternative it stands for: its pair (i, j), i < j, and its rank."""
        return min(self.i, self.j), max(self.i, self.j), self.rank


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Merge:
    """One way to lay component b onto component a, judged by every pair across.

    Attributes:
        a_from_b: The motion between the components' frames.
        supports: The alternatives that propose it, strongest first, one a pair.
        agree: Sum over the pairs across of the shares of samples that agree,
        violated: that lie before the other's surface or contradict it,
        free: that lie in the other's free space.
        worst: Largest excess of violation over agreement of any single pair across.
        margin: Share of the score by which it beats its best distinct rival.
    """

    a_from_b: Pose
    supports: tuple[Support, ...]
    agree: float
    violated: float
    free: float
    worst: float
    margin: float = 1.0

    @property
    def num_voices(self) -> int:
        """How many found it on their own: start poses say the same of all pairs, and count once."""
        found = sum(not support.is_given for support in self.supports)
        return found + (found < len(self.supports))

    @property
    def score(self) -> float:
        """Agreement less weighted violations, summed over the pairs across."""
        return self.agree - VIOLATION_WEIGHT * self.violated - FREE_SHARE * self.free


_Option = tuple[Merge, Sequence[Told]]
_Refutes = Callable[[Sequence[Told], Sequence[Told]], bool]


def propose_merges(
    a: Poses,
    b: Poses,
    pairs: Mapping[tuple[int, int], PairResult],
    centres: Sequence[FloatArray],
    near: tuple[float, float],
    judge: Judge,
    tell: Tell | None = None,
) -> list[Merge]:
    """Distinct ways to merge two components, best first, each with its margin over its rivals.

    Those that another one refutes are left out.

    Args:
        a: First component.
        b: Second component.
        pairs: Results of all pairs, by i < j.
        centres: (3,) middle of each scan's samples, sensor frame.
        near: Angle in degrees and shift within which two proposals are the same.
        judge: Gives the evidence on any pair at any pose.
        tell: Gives what all pixels say, where merges are tied.
    """
    proposals = _proposals(a, b, pairs)
    middle = np.mean([b[j].apply(centres[j]) for j in sorted(b)], axis=0)
    clusters = _cluster(proposals, middle, near)[:MAX_JUDGED]
    merges = [_judged(a, b, motion, supports, judge) for motion, supports in clusters]
    merges.sort(key=lambda merge: -merge.score)
    if tell is not None:
        merges = _decided(_unrefuted(a, b, merges, tell))
    return [
        replace(merge, margin=margin_over(merge.score, [m.score for m in merges if m is not merge]))
        for merge in merges
    ]


def _unrefuted(a: Poses, b: Poses, merges: Sequence[Merge], tell: Tell) -> list[Merge]:
    """Merges, best first, without those tied with the best that another one of these refutes.

    One that a sure pair proposes is tied however little the components meet in it.
    """
    least = (1.0 - TIED_SHARE) * merges[0].score if merges else 0.0
    tied = [
        merge
        for merge in merges
        if merge.score > 0 and (merge.score >= least or any(s.is_good for s in merge.supports))
    ]
    if len(tied) < 2:
        return list(merges)
    told = [tell(a, {j: merge.a_from_b @ pose for j, pose in b.items()}) for merge in tied]
    left = _standing(list(zip(tied, told, strict=True)), is_refuted_jointly)
    # Outlines also lack what a sensor missed: they speak only where surfaces have shown a mark.
    if len(tied) - len(left) >= MIN_REFUTED:
        left = _standing(left, is_looked_past)
    refuted = set(tied) - {merge for merge, _ in left}
    return [merge for merge in merges if merge not in refuted]


def _standing(options: list[_Option], refutes: _Refutes) -> list[_Option]:
    """Options that no other refutes; all of them if that leaves none."""
    standing = [
        (merge, own)
        for merge, own in options
        if not any(refutes(own, other) for _, other in options if other is not own)
    ]
    return standing or options


def _decided(merges: list[Merge]) -> list[Merge]:
    """Merges without those that sliding pairs alone propose, if a mark decides for another one.

    A pair that slides fits anywhere on its way. What it proposes there is chance.
    """
    if not any(support.is_marked for merge in merges for support in merge.supports):
        return merges
    return [merge for merge in merges if not all(s.is_sliding for s in merge.supports)]


def not_only_by(
    dependent: Collection[tuple[int, int, int]], merges: Sequence[Merge]
) -> list[Merge]:
    """Merges that others than the dependent alternatives (i, j, rank), i < j, propose too.

    Dependent ones count like weak pairs there. Margins stay: what may not propose is a rival
    still, and taking a pair back does not make another one surer.
    """
    left = [m for m in merges if not all(s.alternative in dependent for s in m.supports)]
    return [replace(m, supports=tuple(_demoted(s, dependent) for s in m.supports)) for m in left]


def _demoted(support: Support, dependent: Collection[tuple[int, int, int]]) -> Support:
    return replace(support, is_good=False) if support.alternative in dependent else support


def _proposals(
    a: Poses, b: Poses, pairs: Mapping[tuple[int, int], PairResult]
) -> list[tuple[Pose, Support]]:
    found = []
    for i in sorted(a):
        for j in sorted(b):
            result = pairs.get((min(i, j), max(i, j)))
            if result is None:
                continue
            for rank, option in enumerate(result.alternatives):
                if option.score < MIN_CANDIDATE_SCORE:
                    continue
                i_from_j = option.i_from_j if i < j else option.i_from_j.inverse()
                is_good, is_marked = result.kind is PairKind.GOOD, result.is_marked
                support = Support(
                    i=i,
                    j=j,
                    rank=rank,
                    score=option.score,
                    agree=option.evidence.agree,
                    is_good=rank == 0 and (is_good or is_marked),
                    is_marked=rank == 0 and is_marked,
                    is_sliding=result.kind is PairKind.SLIDING,
                    is_given=option.is_given,
                )
                found.append((a[i] @ i_from_j @ b[j].inverse(), support))
    found.sort(key=lambda proposal: -proposal[1].score)
    return found


def _cluster(
    proposals: list[tuple[Pose, Support]], middle: FloatArray, near: tuple[float, float]
) -> list[tuple[Pose, tuple[Support, ...]]]:
    """Proposals near a stronger one support it; clusters with most support first."""
    turns = np.array([motion.rotation.ravel() for motion, _ in proposals]).reshape(-1, 9)
    middles = np.array([motion.apply(middle) for motion, _ in proposals]).reshape(-1, 3)
    min_trace = 1.0 + 2.0 * np.cos(np.radians(near[0]))
    clusters: list[tuple[Pose, tuple[Support, ...]]] = []
    left = np.arange(len(proposals))
    while len(left):
        head = left[0]
        shift = np.linalg.norm(middles[left] - middles[head], axis=1)
        joins = (turns[left] @ turns[head] > min_trace) & (shift < near[1])
        joins[0] = True
        supports: dict[tuple[int, int], Support] = {}
        for n in left[joins]:
            support = proposals[n][1]
            supports.setdefault((support.i, support.j), support)
        clusters.append((proposals[head][0], tuple(supports.values())))
        left = left[~joins]
    clusters.sort(key=lambda cluster: -sum(s.score - MIN_CANDIDATE_SCORE for s in cluster[1]))
    return clusters


def is_near(p: Pose, q: Pose, middle: FloatArray, near: tuple[float, float]) -> bool:
    """Whether two motions differ by less than an angle (degrees) and a shift of the middle."""
    apart = p.inverse() @ q
    return apart.shift_at(middle) < near[1] and apart.angle_deg() < near[0]


def rejudged(merge: Merge, a: Poses, b: Poses, judge: Judge) -> Merge:
    """The merge with another judge's evidence at other poses of its scans, all in one frame."""
    said = _judged(a, b, Pose.identity(), merge.supports, judge)
    return replace(said, a_from_b=merge.a_from_b, margin=merge.margin)


def _judged(
    a: Poses, b: Poses, a_from_b: Pose, supports: tuple[Support, ...], judge: Judge
) -> Merge:
    from_a = {i: a[i].inverse() for i in sorted(a)}
    moved = {j: a_from_b @ b[j] for j in sorted(b)}
    evidence = [
        judge(i, j, i_from_a @ pose) for i, i_from_a in from_a.items() for j, pose in moved.items()
    ]
    violated = [e.surface_violation for e in evidence]
    return Merge(
        a_from_b=a_from_b,
        supports=supports,
        agree=sum(e.agree for e in evidence),
        violated=sum(violated),
        free=sum(e.free for e in evidence),
        worst=max(v - 0.5 * e.agree for v, e in zip(violated, evidence, strict=True)),
    )
