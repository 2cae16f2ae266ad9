"""Which two components are merged next, and how: as pairs propose it, or after a refinement."""

from collections.abc import Callable
from itertools import combinations

from scanweld.config import GraphConfig
from scanweld.evidence.judge import Poses
from scanweld.graph.merge import Merge, judged_in_place, without_excluded
from scanweld.graph.problem import GraphProblem

Excluded = frozenset[tuple[int, int, int]]
"""Alternatives (i, j, rank), i < j, that propose nothing which no other one proposes."""
_Choose = Callable[[GraphProblem, Poses, Poses, Excluded], Merge | None]
Known = dict[tuple[_Choose, tuple[int, ...], tuple[int, ...]], Merge | None]
"""What was found of two components, by how it was looked for and the scans that they hold."""


def best_merge(
    problem: GraphProblem, components: list[Poses], excluded: Excluded, known: Known
) -> tuple[Merge, int, int] | None:
    """The best merge that passes as proposed; if there is none, after refinement.

    Args:
        problem: The pairs and the judge.
        components: All components.
        excluded: Alternatives that propose nothing alone.
        known: What was found before, which is added to.

    Returns:
        The merge and the indices of its two components; None if no merge passes.
    """
    for choose in (_as_proposed, _after_refinement):
        found = []
        for a, b in combinations(range(len(components)), 2):
            key = (choose, tuple(components[a]), tuple(components[b]))
            if key not in known:
                known[key] = choose(problem, components[a], components[b], excluded)
            if (merge := known[key]) is not None:
                found.append((merge, a, b))
        if found:
            return max(found, key=lambda option: option[0].score)
    return None


def merged(merge: Merge, a: Poses, b: Poses) -> Poses:
    """Both components in the frame of a."""
    moved = {k: merge.a_from_b @ pose for k, pose in b.items()}
    return dict(sorted({**a, **moved}.items()))


def _as_proposed(problem: GraphProblem, a: Poses, b: Poses, excluded: Excluded) -> Merge | None:
    """The best way to merge two components, if it passes as it is proposed."""
    merges = without_excluded(excluded, problem.merges(a, b))
    return merges[0] if merges and _passes(merges[0], problem.config) else None


def _after_refinement(
    problem: GraphProblem, a: Poses, b: Poses, excluded: Excluded
) -> Merge | None:
    """The best way to merge two components, if it passes once all scans have settled.

    The pose of one pair is off where it is carried over to scans far from it.
    """
    merges = without_excluded(excluded, problem.merges(a, b))
    if not merges or not _qualifies_for_recheck(merges[0], a, b, problem.config):
        return None
    best = merges[0]
    proposed = merged(best, a, b)
    settled = problem.settled(proposed)
    if not _stayed(problem, proposed, settled):
        return None
    second = judged_in_place(best, a, b, settled, problem.judge)
    return second if _passes(second, problem.config) else None


def _qualifies_for_recheck(merge: Merge, a: Poses, b: Poses, config: GraphConfig) -> bool:
    is_proposed_well = any(p.is_good for p in merge.proposals) or merge.num_independent > 1
    is_clear = merge.score > 0 and merge.margin >= config.min_margin
    return is_proposed_well and is_clear and len(a) + len(b) > 2


def _stayed(problem: GraphProblem, proposed: Poses, settled: Poses) -> bool:
    """Whether scans, settled, are still where they were beside the first one."""
    first = min(proposed)
    was, has = proposed[first].inverse(), settled[first].inverse()
    return all(
        problem.same.covers(was @ proposed[k], has @ settled[k], problem.centres[k])
        for k in proposed
    )


def _passes(merge: Merge, config: GraphConfig) -> bool:
    """Whether a merge may be made: supported well enough, contradicted by no pair across."""
    if merge.margin < config.min_margin or merge.is_contradicted:
        return False
    if any(proposal.is_good for proposal in merge.proposals):
        return merge.score > 0
    # Weak pairs count only where several of them, found separately, say the same.
    is_clean = merge.violated <= config.max_mutual_violated_share * merge.agree
    return merge.num_independent > 1 and is_clean and merge.score >= config.min_mutual_score
