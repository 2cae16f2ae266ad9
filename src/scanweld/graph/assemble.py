"""Pairs -> view graph: merge greedily from the strongest, judged by all implied pairs."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scanweld.evidence.judge import Poses
from scanweld.geometry.pose import Pose
from scanweld.graph.choose import Excluded, Known, best_merge, merged
from scanweld.graph.problem import GraphProblem
from scanweld.graph.proposals import Proposal
from scanweld.graph.reasons import why_rejected, why_unplaced
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.pairs.result import Alternative, PairKind

logger = logging.getLogger(__name__)

MAX_RETRIES = 3
"""Rounds in which a merge may be taken back."""
MAX_SUSPECTS = 12
"""Alternatives that are taken back one at a time in a round, the weakest first."""
MIN_GAIN = 1.02
"""So many times the score must the pairs that agree sum to for an assembly to replace another."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Assembly:
    """One outcome of greedy merging."""

    components: tuple[Poses, ...]
    used: tuple[Proposal, ...]
    accepted: Mapping[Edge, Alternative] = field(default_factory=dict)

    @property
    def score(self) -> float:
        return sum(max(option.score, 0.0) for option in self.accepted.values())


def build_view_graph(problem: GraphProblem) -> ViewGraph:
    """Place all scans that the pairs can place without contradiction.

    Components grow by the best merge that passes: one good pair, or several pairs that propose
    the same motion, with every implied pair across free of contradictions. Where good pairs end
    up outside, the merges that may have shut them out are taken back one at a time, so that a
    pair that made them counts only beside others, and the assembly that explains most is kept.

    Args:
        problem: The pairs, and who judges and settles components.
    """
    best = _assemble(problem, frozenset())
    excluded: Excluded = frozenset()
    for _ in range(MAX_RETRIES):
        trials = [excluded | {suspect} for suspect in _suspects(problem, best)]
        outcomes = [(_assemble(problem, trial), trial) for trial in trials]
        better = max(outcomes, key=lambda outcome: outcome[0].score, default=None)
        if better is None or better[0].score <= best.score * MIN_GAIN:
            break
        best, excluded = better
        logger.info("took back pairs %s alone: the rest then agrees", sorted(excluded))
    return _graph(problem, best)


def _assemble(problem: GraphProblem, excluded: Excluded) -> _Assembly:
    """Merge greedily; excluded alternatives propose nothing that no other one proposes."""
    components = list(problem.initial)
    alone = set(range(len(problem.centres))).difference(*components)
    components += [{k: Pose.identity()} for k in sorted(alone)]
    used: list[Proposal] = []
    known: Known = {}
    while (found := best_merge(problem, components, excluded, known)) is not None:
        merge, a, b = found
        joined = merged(merge, components[a], components[b])
        used.extend(merge.proposals)
        components = [c for n, c in enumerate(components) if n not in (a, b)]
        components.append(problem.settled(joined))
        logger.debug("merged into %s: score %.2f", sorted(joined), merge.score)
    placed = tuple(c for c in components if len(c) > 1)
    return _Assembly(components=placed, used=tuple(used), accepted=_accepted(problem, placed))


def _accepted(problem: GraphProblem, components: Sequence[Poses]) -> dict[Edge, Alternative]:
    """The alternative of each pair within a component that agrees with the poses."""
    accepted: dict[Edge, Alternative] = {}
    for poses in components:
        for (i, j), result in problem.pairs.items():
            if i not in poses or j not in poses:
                continue
            i_from_j = poses[i].inverse() @ poses[j]
            for option in result.alternatives:
                is_same = problem.same.covers(option.i_from_j, i_from_j, problem.centres[j])
                if is_same and option.score >= problem.config.min_edge_score:
                    accepted[i, j] = option
                    break
    return accepted


def _suspects(problem: GraphProblem, assembly: _Assembly) -> list[tuple[int, int, int]]:
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
    return [proposal.alternative for proposal in suspects[:MAX_SUSPECTS]]


def _graph(problem: GraphProblem, assembly: _Assembly) -> ViewGraph:
    accepted = assembly.accepted
    components = [_component(poses, accepted) for poses in assembly.components]
    components.sort(key=lambda c: (-len(c.poses), min(c.poses)))
    placed = {scan for c in components for scan in c.poses}
    rejected = {
        edge: why_rejected(problem.pairs[edge], components, problem.centres, problem.same)
        for edge in sorted(problem.pairs)
        if edge not in accepted
    }
    unplaced = {
        k: why_unplaced(k, problem.pairs) for k in range(len(problem.centres)) if k not in placed
    }
    return ViewGraph(
        pairs=problem.pairs,
        usable=problem.pairs,
        accepted=dict(sorted(accepted.items())),
        rejected=rejected,
        components=tuple(components),
        unplaced=unplaced,
    )


def _component(poses: Poses, accepted: Mapping[Edge, Alternative]) -> Component:
    strength = {k: 0.0 for k in poses}
    for (i, j), option in accepted.items():
        if i in poses:
            strength[i] += max(option.score, 0.0)
            strength[j] += max(option.score, 0.0)
    reference = max(sorted(poses), key=lambda k: strength[k])
    to_reference = poses[reference].inverse()
    moved = {k: to_reference @ pose for k, pose in poses.items()}
    moved[reference] = Pose.identity()
    return Component(poses=moved, reference=reference)
