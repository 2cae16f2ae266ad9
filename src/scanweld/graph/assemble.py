"""Pairs -> view graph: merge greedily from the strongest, judged by all implied pairs."""

import hashlib
import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

from scanweld.config import GraphConfig
from scanweld.evidence.evidence import MIN_AGREE
from scanweld.evidence.rivals import margin_over
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.graph.merge import (
    Judge,
    Merge,
    Poses,
    Support,
    Tell,
    is_near,
    not_only_by,
    propose_merges,
    rejudged,
)
from scanweld.graph.reasons import why_rejected, why_unplaced
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.pairs.result import Alternative, PairKind, PairResult

logger = logging.getLogger(__name__)

Settle = Callable[[Mapping[int, Pose]], Mapping[int, Pose]]
"""Refines the poses of a component a little, so that chains of pairs do not drift."""

MAX_RETRIES = 3
MAX_SUSPECTS = 12


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Assembly:
    """One outcome of greedy merging."""

    components: tuple[Mapping[int, Pose], ...]
    used: tuple[Support, ...]
    accepted: Mapping[Edge, Alternative] = field(default_factory=dict)

    @property
    def support(self) -> float:
        return sum(max(option.score, 0.0) for option in self.accepted.values())


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Problem:
    """What stays the same in all attempts."""

    num_scans: int
    pairs: Mapping[Edge, PairResult]
    centres: Sequence[FloatArray]
    near: tuple[float, float]
    judge: Judge
    tell: Tell | None
    judge_off_edges: Judge
    settle: Settle
    config: GraphConfig
    apart: Collection[Edge]
    memory: "_Memory" = field(default_factory=lambda: _Memory(merges={}, settled={}))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Memory:
    """What attempts found out, by the content of components: most attempts come by it again."""

    merges: dict[tuple[bytes, bytes], list[Merge]]
    settled: dict[bytes, Poses]


_Dependent = frozenset[tuple[int, int, int]]
_Sight = Callable[[_Problem, Poses, Poses, _Dependent], Merge | None]
_Known = dict[tuple[_Sight, tuple[int, ...], tuple[int, ...]], Merge | None]


def build_view_graph(
    num_scans: int,
    pairs: Mapping[Edge, PairResult],
    centres: Sequence[FloatArray],
    diameter: float,
    judge: Judge,
    settle: Settle,
    config: GraphConfig,
    apart: Collection[Edge] = (),
    tell: Tell | None = None,
    judge_off_edges: Judge | None = None,
) -> ViewGraph:
    """Place all scans that the pairs can place without contradiction.

    Components grow by the best merge that passes: one good pair, or several pairs that propose
    the same motion, with every implied pair across free of contradictions. Where good pairs end
    up outside, the merges that may have shut them out are taken back one at a time, so that a
    pair that made them counts only beside others, and the assembly that explains most is kept.

    Args:
        num_scans: How many scans there are.
        pairs: Results of pairs (i, j), i < j.
        centres: (3,) middle of each scan's samples, sensor frame.
        diameter: Diameter of the run.
        judge: Gives the evidence on any pair at any pose.
        settle: Refines a component's poses.
        config: Settings.
        apart: Pairs whose scans no merge may lay onto each other.
        tell: Gives what all pixels of two components say of each other, where merges are tied.
        judge_off_edges: Gives the evidence without what edges say, for merges that fail at first
            sight; ``judge`` if there is none.
    """
    near = (config.max_cycle_deg, config.max_cycle_diameters * diameter)
    problem = _Problem(
        num_scans=num_scans,
        pairs=pairs,
        centres=centres,
        near=near,
        judge=judge,
        tell=tell,
        judge_off_edges=judge_off_edges or judge,
        settle=settle,
        config=config,
        apart=apart,
    )
    best = _assemble(problem, frozenset())
    dependent: _Dependent = frozenset()
    for _ in range(MAX_RETRIES):
        trials = [dependent | {suspect} for suspect in _suspects(problem, best)]
        outcomes = [(_assemble(problem, trial), trial) for trial in trials]
        better = max(outcomes, key=lambda outcome: outcome[0].support, default=None)
        if better is None or better[0].support <= best.support * 1.02:
            break
        best, dependent = better
        logger.info("took back pairs %s alone: the rest then agrees", sorted(dependent))
    return _graph(problem, best)


def _assemble(problem: _Problem, dependent: _Dependent) -> _Assembly:
    """Merge greedily; dependent alternatives propose nothing that no other one proposes."""
    components: list[Mapping[int, Pose]] = [{k: Pose.identity()} for k in range(problem.num_scans)]
    used: list[Support] = []
    known: _Known = {}
    while (found := _best_merge(problem, components, dependent, known)) is not None:
        merge, a, b = found
        merged = _merged(merge, components[a], components[b])
        used.extend(merge.supports)
        components = [c for n, c in enumerate(components) if n not in (a, b)]
        components.append(_settled(problem, merged))
        logger.debug("merged into %s: score %.2f", sorted(merged), merge.score)
    placed = tuple(c for c in components if len(c) > 1)
    return _Assembly(components=placed, used=tuple(used), accepted=_accepted(problem, placed))


def _best_merge(
    problem: _Problem,
    components: list[Mapping[int, Pose]],
    dependent: _Dependent,
    known: _Known,
) -> tuple[Merge, int, int] | None:
    """The best merge that passes at first sight; if there is none, at second."""
    for sight in (_at_first_sight, _at_second_sight):
        found = []
        for a, b in combinations(range(len(components)), 2):
            key = (sight, tuple(components[a]), tuple(components[b]))
            if key not in known:
                known[key] = sight(problem, components[a], components[b], dependent)
            if (merge := known[key]) is not None:
                found.append((merge, a, b))
        if found:
            return max(found, key=lambda option: option[0].score)
    return None


def _at_first_sight(problem: _Problem, a: Poses, b: Poses, dependent: _Dependent) -> Merge | None:
    """The best way to merge two components, if it passes as it is proposed."""
    merges = not_only_by(dependent, _merges(problem, a, b))
    config = problem.config
    return merges[0] if merges and passes(merges[0], config, config.max_violated_share) else None


def _at_second_sight(problem: _Problem, a: Poses, b: Poses, dependent: _Dependent) -> Merge | None:
    """The best way to merge two components, if it passes settled, and with edges forgiven.

    Of noisy scans, two make errors that all the others deny: the pose of one pair is off where it
    is carried over to those far from it, and samples fall beside edges. So at second sight all
    scans settle first, and edges say nothing; of what is left less may be violated.
    """
    merges = not_only_by(dependent, _merges(problem, a, b))
    if not merges or not _deserves_second_sight(merges[0], a, b, problem.config):
        return None
    best = merges[0]
    proposed = _merged(best, a, b)
    settled = _settled(problem, proposed)
    if not _stayed(problem, proposed, settled):
        return None
    second = _off_edges(problem, best, a, b, settled)
    rivals = [
        _off_edges(problem, merge, a, b, _merged(merge, a, b)).score
        for merge in _merges(problem, a, b)
        if merge.a_from_b is not best.a_from_b
    ]
    second = replace(second, margin=min(best.margin, margin_over(second.score, rivals)))
    passed = passes(second, problem.config, problem.config.max_inner_violated_share)
    return second if passed else None


def _deserves_second_sight(merge: Merge, a: Poses, b: Poses, config: GraphConfig) -> bool:
    has_support = any(s.is_good for s in merge.supports) or merge.num_voices > 1
    is_clear = merge.score > 0 and merge.margin >= config.min_margin
    return has_support and is_clear and len(a) + len(b) > 2


def _stayed(problem: _Problem, proposed: Poses, settled: Poses) -> bool:
    """Whether scans, settled, are still where they were beside the first one."""
    first = min(proposed)
    was, has = proposed[first].inverse(), settled[first].inverse()
    return all(
        is_near(was @ proposed[k], has @ settled[k], problem.centres[k], problem.near)
        for k in proposed
    )


def _off_edges(problem: _Problem, merge: Merge, a: Poses, b: Poses, poses: Poses) -> Merge:
    """The merge as all scans judge it in these poses, edges forgiven."""
    both = {k: poses[k] for k in a}, {k: poses[k] for k in b}
    return rejudged(merge, *both, problem.judge_off_edges)


def _merged(merge: Merge, a: Poses, b: Poses) -> Poses:
    moved = {k: merge.a_from_b @ pose for k, pose in b.items()}
    return dict(sorted({**a, **moved}.items()))


def _merges(problem: _Problem, a: Poses, b: Poses) -> list[Merge]:
    key = _content(a), _content(b)
    if key not in problem.memory.merges:
        merges = propose_merges(
            a, b, problem.pairs, problem.centres, problem.near, problem.judge, problem.tell
        )
        problem.memory.merges[key] = [m for m in merges if not _joins_apart(problem, a, b, m)]
    return problem.memory.merges[key]


def _joins_apart(problem: _Problem, a: Poses, b: Poses, merge: Merge) -> bool:
    """Whether a merge lays scans onto each other that are apart."""
    for i, j in problem.apart:
        first, second = (i, j) if i in a else (j, i)
        if first in a and second in b:
            pose = a[first].inverse() @ merge.a_from_b @ b[second]
            if problem.judge(first, second, pose).agree >= MIN_AGREE:
                return True
    return False


def _settled(problem: _Problem, poses: Poses) -> Poses:
    if len(poses) < 3:
        return poses
    key = _content(poses)
    if key not in problem.memory.settled:
        problem.memory.settled[key] = problem.settle(poses)
    return problem.memory.settled[key]


def _content(poses: Poses) -> bytes:
    """A hash of which scans a component holds, and exactly where."""
    digest = hashlib.sha256()
    for k, pose in poses.items():
        digest.update(b"%d" % k + pose.rotation.tobytes() + pose.translation.tobytes())
    return digest.digest()


def passes(merge: Merge, config: GraphConfig, max_violated_share: float) -> bool:
    """Whether a merge may be made: supported well enough, contradicted by no pair across."""
    if merge.worst > config.max_violation or merge.margin < config.min_margin:
        return False
    if merge.violated > max_violated_share * merge.agree:
        return False
    if any(support.is_good for support in merge.supports):
        return merge.score > 0
    # Weak pairs count only where several of them, found separately, say the same.
    is_clean = merge.violated <= config.max_mutual_violated_share * merge.agree
    return merge.num_voices > 1 and is_clean and merge.score >= config.min_mutual_score


def _accepted(
    problem: _Problem, components: Sequence[Mapping[int, Pose]]
) -> dict[Edge, Alternative]:
    """The alternative of each pair within a component that agrees with the poses."""
    accepted: dict[Edge, Alternative] = {}
    for poses in components:
        for (i, j), result in problem.pairs.items():
            if i not in poses or j not in poses:
                continue
            i_from_j = poses[i].inverse() @ poses[j]
            for option in result.alternatives:
                is_same = is_near(option.i_from_j, i_from_j, problem.centres[j], problem.near)
                if is_same and option.score >= problem.config.min_edge_score:
                    accepted[i, j] = option
                    break
    return accepted


def _suspects(problem: _Problem, assembly: _Assembly) -> list[tuple[int, int, int]]:
    """Alternatives that merges were made by, weakest first, if good pairs were shut out."""
    shut_out = [
        edge
        for edge, result in problem.pairs.items()
        if result.kind is PairKind.GOOD and edge not in assembly.accepted
    ]
    if not shut_out:
        return []
    touched = {scan for edge in shut_out for scan in edge}
    suspects = [s for s in assembly.used if s.i in touched or s.j in touched]
    suspects.sort(key=lambda s: s.score)
    return [support.alternative for support in suspects[:MAX_SUSPECTS]]


def _graph(problem: _Problem, assembly: _Assembly) -> ViewGraph:
    accepted = assembly.accepted
    components = [_component(poses, accepted) for poses in assembly.components]
    components.sort(key=lambda c: (-len(c.poses), min(c.poses)))
    placed = {scan for c in components for scan in c.poses}
    rejected = {
        edge: why_rejected(problem.pairs[edge], components, problem.centres, problem.near)
        for edge in sorted(problem.pairs)
        if edge not in accepted
    }
    unplaced = {
        k: why_unplaced(k, problem.pairs) for k in range(problem.num_scans) if k not in placed
    }
    return ViewGraph(
        pairs=problem.pairs,
        accepted=dict(sorted(accepted.items())),
        rejected=rejected,
        components=tuple(components),
        unplaced=unplaced,
    )


def _component(poses: Mapping[int, Pose], accepted: Mapping[Edge, Alternative]) -> Component:
    support = {k: 0.0 for k in poses}
    for (i, j), option in accepted.items():
        if i in poses:
            support[i] += max(option.score, 0.0)
            support[j] += max(option.score, 0.0)
    reference = max(sorted(poses), key=lambda k: support[k])
    to_reference = poses[reference].inverse()
    moved = {k: to_reference @ pose for k, pose in poses.items()}
    moved[reference] = Pose.identity()
    return Component(poses=moved, reference=reference)
