"""Merges that fail at first sight: once all scans have settled, beside others."""

from collections.abc import Mapping
from dataclasses import replace

import pytest

from scanweld.evidence.evidence import Evidence
from scanweld.geometry.pose import Pose
from scanweld.graph.assemble import build_view_graph
from scanweld.graph.merge import Merge, without_excluded
from scanweld.graph.proposals import Proposal
from scanweld.graph.view_graph import ViewGraph
from scanweld.pairs.result import PairKind
from tests.view_graphs import (
    USUAL_LIMITS,
    DrawnJudge,
    Say,
    exact_pairs,
    graph_of,
    is_same,
    judge_of,
    only_component,
    option,
    pair_of,
    problem_of,
    scans_of,
    seen,
    stay,
    true_pose,
    turn_about_centre,
    turned,
    world_of,
)


def drifting(at_truth: Evidence) -> Say:
    """Three scans in a row; what 0 and 2 say of each other where 1-2 is 4 deg off, and at truth."""
    world = world_of(3)
    denied = Evidence(
        agree=0.3, front=0.14, contradict=0, free=0, occluded=0.5, unknown=0.06, front_patch=0.1
    )

    def judge_pair(i: int, j: int, i_from_j: Pose) -> Evidence:
        if i > j:
            return judge_pair(j, i, i_from_j.inverse())
        if is_same(true_pose(world, i, j), i_from_j):
            return at_truth if (i, j) == (0, 2) else seen(0.4)
        return denied if (i, j) == (0, 2) else seen(0.4)

    return judge_pair


def chain(
    judge_pair: Say,
    *,
    settles: bool,
    off_deg: float = 4.0,
) -> ViewGraph:
    """0-1 is exact, 1-2 is off; where scans settle, they settle at truth."""
    world = world_of(3)
    pairs = exact_pairs([(0, 1), (1, 2)], world)
    pairs[1, 2] = turned(pairs[1, 2], off_deg)

    def settle(poses: Mapping[int, Pose]) -> Mapping[int, Pose]:
        first = min(poses)
        return {k: poses[first] @ true_pose(world, first, k) for k in poses}

    judge = DrawnJudge(says=judge_pair)
    return build_view_graph(problem_of(3, pairs, judge, settle if settles else stay))


def test_a_merge_is_judged_again_once_its_scans_have_settled():
    """From 4 deg off it is the same merge that settles, from 8 deg another one."""
    judge_pair, world = drifting(seen(0.3)), world_of(3)
    assert scans_of(chain(judge_pair, settles=False).components[0]) == {0, 1}
    (component,) = chain(judge_pair, settles=True).components
    assert scans_of(component) == {0, 1, 2}
    assert is_same(component.poses[0].inverse() @ component.poses[2], true_pose(world, 0, 2))
    assert 2 in chain(judge_pair, settles=True, off_deg=8.0).unplaced


def proposed_by(*edges: tuple[int, int]) -> Merge:
    proposals = tuple(
        Proposal(i=i, j=j, rank=0, score=0.4, agree=0.4, is_good=True) for i, j in edges
    )
    return Merge(
        a_from_b=Pose.identity(), proposals=proposals, agree=0.4, violated=0.0, free=0.0, worst=0.0
    )


def test_a_pair_taken_back_counts_only_beside_others():
    alone, beside, other = proposed_by((1, 2)), proposed_by((1, 2), (0, 3)), proposed_by((3, 0))
    merges = [alone, beside, other]

    def left(*excluded: tuple[int, int, int]) -> list[list[bool]]:
        return [[s.is_good for s in m.proposals] for m in without_excluded(excluded, merges)]

    assert left((1, 2, 0)) == [[False, True], [True]]
    assert left((1, 2, 0), (0, 3, 0)) == []
    assert left((1, 2, 1)) == [[True], [True, True], [True]]


def test_a_right_pair_that_came_too_early_comes_in_late():
    """1-2 first: then 0 and 3 each fit it in two ways. 0-1 and 2-3 first: all four fit in one."""
    world = world_of(4)
    pairs = exact_pairs([(0, 1), (1, 2), (2, 3)], world, {(1, 2): 0.6})
    for i, j in ((0, 2), (1, 3)):
        wrong = true_pose(world, i, j) @ turn_about_centre(90.0)
        pairs[i, j] = pair_of(i, j, PairKind.AMBIGUOUS, option(wrong, 0.36))
    pairs[0, 3] = pair_of(0, 3, PairKind.NO_OVERLAP, option(true_pose(world, 0, 3), 0.08))
    graph = graph_of(world, pairs, judge_of(world, pairs, denied=seen(0.0)))
    assert scans_of(only_component(graph, world)) == {0, 1, 2, 3}
    assert {(0, 1), (1, 2), (2, 3)} <= set(graph.accepted)


@pytest.mark.parametrize("through", [(), ((0, 2),), ((0, 2), (0, 3))])
def test_a_merge_is_refused_where_two_pairs_see_through_a_part(
    through: tuple[tuple[int, int], ...],
):
    """0 and 1 hang together, so do 2 and 3, and 1-2 is good."""
    world = world_of(4)
    pairs = exact_pairs([(0, 1), (1, 2), (2, 3)], world, {(1, 2): 0.3})

    def says(i: int, j: int, i_from_j: Pose) -> Evidence:
        edge = min(i, j), max(i, j)
        told = seen(0.9 if edge in ((0, 1), (2, 3)) else 0.3)
        return replace(told, free_patch=USUAL_LIMITS.free + 0.1 * (edge in through))

    graph = build_view_graph(problem_of(4, pairs, DrawnJudge(says=says)))
    assert len(graph.components) == 1 + (len(through) > 1)
