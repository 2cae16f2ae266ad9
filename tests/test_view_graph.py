"""The view graph on drawn graphs: which pairs hold, which scans are placed, and what is said.

The judge knows where the scans truly are. A pair that is fooled fools the judge too, as in life:
both look at the same two scans. What a wrong pose of one pair implies for other pairs, they deny.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanweld.evidence.evidence import Evidence
from scanweld.geometry.pose import Pose
from scanweld.graph.view_graph import Edge
from scanweld.pairs.result import PairKind, PairResult
from tests.view_graphs import (
    DIAGONAL,
    GOOD,
    WEAK,
    DrawnJudge,
    Pairs,
    assert_right,
    exact_pair,
    exact_pairs,
    graph_of,
    judge_of,
    only_component,
    option,
    scans_of,
    seen,
    true_pose,
    turn_about_centre,
    turned,
    world_of,
)


@pytest.mark.parametrize("agree", [0.2, 0.35, 0.65])
def test_bad_diagonal_is_found(agree: float):
    """Both triangles through 2-3 disagree, the loop 1-2-4-3 around it closes: only 2-3 is wrong.

    0 --- 1 --- 3
     \\   /   /  |
      \\ / /     |
       2 ------ 4

    Also where the bad one is the strongest, and is merged first: then its scans, held by three
    pairs and by two, are doubtful.
    """
    world = world_of(5)
    pairs = exact_pairs(DIAGONAL, world, {(2, 3): agree})
    pairs[2, 3] = turned(pairs[2, 3], degrees=15)
    graph = graph_of(world, pairs)
    assert scans_of(only_component(graph, world)) == {0, 1, 2, 3, 4}
    assert set(graph.accepted) == set(DIAGONAL) - {(2, 3)}
    assert graph.rejected[2, 3].startswith("cycle: 15.0 deg off")
    assert set(graph.doubts) == {0.2: set(), 0.35: set(), 0.65: {2, 3}}[agree]


def test_attempts_do_not_settle_the_same_component_again():
    """A bad diagonal makes the graph try again without each pair; most merges stay the same."""
    world = world_of(5)
    pairs = exact_pairs(DIAGONAL, world)
    pairs[2, 3] = turned(pairs[2, 3], degrees=15)
    settled: list[bytes] = []

    def settle(poses: Mapping[int, Pose]) -> Mapping[int, Pose]:
        settled.append(b"".join(b"%d" % k + pose.matrix().tobytes() for k, pose in poses.items()))
        return poses

    only_component(graph_of(world, pairs, settle=settle), world)
    assert len(settled) > len(world) - 2
    assert len(set(settled)) == len(settled)


RING = [(0, 1), (1, 2), (2, 3), (0, 3)]


@pytest.mark.parametrize("bad", RING)
@pytest.mark.parametrize("agree", [0.3, 0.5])
def test_a_ring_that_does_not_close_loses_the_pair_that_the_others_deny(bad: Edge, agree: float):
    """One of the four is 20 deg off: what it implies, the opposite scans deny."""
    world = world_of(4)
    pairs = exact_pairs(RING, world, {bad: agree})
    pairs[bad] = turned(pairs[bad], degrees=20)
    graph = graph_of(world, pairs)
    only_component(graph, world)
    assert set(graph.accepted) == set(RING) - {bad}
    assert graph.rejected[bad].startswith("cycle")


@pytest.mark.parametrize("weakest", [0.1, 0.15, 0.3, 0.35, 0.39])
def test_of_a_lone_triangle_that_does_not_close_the_weakest_goes(weakest: float):
    """0-1 and 1-2 are stronger than 0-2, which does not fit; nobody knows which one is wrong.

    The clearly weakest goes; where it is not outweighed by far, its scans are doubtful. Too close
    to call, only the strongest pair is placed: rather than guess between 1-2 and 0-2, or drop 0-1
    to make room for both, 2 stays out.
    """
    world = world_of(3)
    pairs = exact_pairs([(0, 1), (1, 2), (0, 2)], world, {(0, 1): 0.5, (0, 2): weakest})
    pairs[0, 2] = turned(pairs[0, 2], degrees=15)
    graph = graph_of(world, pairs, judge_of(world, pairs, denied=seen(0.0)))
    if weakest > 0.3:
        assert scans_of(only_component(graph, world)) == {0, 1}
        assert "contradicts other scans" in graph.unplaced[2]
        return
    assert scans_of(only_component(graph, world)) == {0, 1, 2}
    assert set(graph.accepted) == {(0, 1), (1, 2)}
    assert graph.rejected[0, 2].startswith("cycle: 15.0 deg")
    assert set(graph.doubts) == ({0, 2} if weakest == 0.3 else set())


@pytest.mark.parametrize("with_bridge", [False, True])
def test_two_components_are_not_joined_by_a_wrong_bridge(with_bridge: bool):
    """0-1-2 ~ 3-4-5: the bridge 2-3 is sure of itself, but all other pairs across deny it."""
    world = world_of(6)
    edges = [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5)]
    pairs = exact_pairs([*edges, (2, 3)] if with_bridge else edges, world, {(2, 3): 0.3})
    if with_bridge:
        pairs[2, 3] = turned(pairs[2, 3], degrees=60)
    graph = graph_of(world, pairs)
    assert [scans_of(c) for c in graph.components] == [{0, 1, 2}, {3, 4, 5}]
    for component in graph.components:
        assert_right(component, world)
    assert not graph.unplaced and set(graph.accepted) == set(edges)
    assert ("contradictions" in graph.rejected[2, 3]) is with_bridge


def ambiguous(pair: PairResult, rival: float, degrees: float = 90) -> PairResult:
    """The pair with a wrong pose before the true one."""
    wrong = option(pair.alternatives[0].i_from_j @ turn_about_centre(degrees), rival)
    options = sorted((wrong, *pair.alternatives), key=lambda option: -option.score)
    reason = "another pose explains the scans as well"
    return replace(
        pair, kind=PairKind.AMBIGUOUS, reason=reason, alternatives=tuple(options), margin=0.05
    )


def test_good_pairs_do_not_outvote_a_part_that_lies_where_it_cannot():
    """Three good pairs join two halves, and beside scan 0 a part of 5 was seen through."""
    world = world_of(6)
    across = [(0, 3), (1, 4), (2, 3)]
    weak = dict.fromkeys(across, 0.12)
    pairs = exact_pairs([(0, 1), (1, 2), (3, 4), (4, 5), *across], world, weak)
    known = judge_of(world, pairs)

    def says(i: int, j: int, i_from_j: Pose) -> Evidence:
        told = known.pair(i, j, i_from_j)
        is_seen_through = {i, j} == {0, 5} and not told.agree
        return replace(told, front=0.03, front_patch=0.03) if is_seen_through else told

    graph = graph_of(world, pairs, DrawnJudge(says=says))
    assert all(not {0, 5} <= scans_of(component) for component in graph.components)


@pytest.mark.parametrize("third", [PairKind.GOOD, PairKind.NO_OVERLAP, None])
def test_a_third_scan_resolves_an_ambiguous_pair(third: PairKind | None):
    """0-1 could be either of two poses; 1-2 is good, and 0-2, even if weak, knows which.

    If 2 knows nothing of 0, 0 stays out rather than be guessed.
    """
    world = world_of(3)
    pairs = exact_pairs([(0, 1), (1, 2)], world)
    pairs[0, 1] = ambiguous(pairs[0, 1], rival=0.42 if third else 0.38)
    if third is None:
        graph = graph_of(world, pairs, judge_of(world, pairs, denied=seen(0.0)))
        assert scans_of(only_component(graph, world)) == {1, 2}
        assert "another pose explains" in graph.unplaced[0]
        return
    pairs[0, 2] = exact_pair(0, 2, world, GOOD if third is PairKind.GOOD else WEAK, third)
    graph = graph_of(world, pairs)
    assert scans_of(only_component(graph, world)) == {0, 1, 2}
    assert graph.accepted[0, 1] is pairs[0, 1].alternatives[1]
    assert not graph.doubts


def test_a_pair_may_be_right_only_in_its_second_pose():
    """2-3 prefers a wrong pose, but kept the true one: the others pick it; alone it stays open."""
    world = world_of(5)
    pairs = exact_pairs(DIAGONAL, world)
    pairs[2, 3] = replace(ambiguous(pairs[2, 3], rival=0.55), kind=PairKind.GOOD)
    graph = graph_of(world, pairs)
    only_component(graph, world)
    assert set(graph.accepted) == set(DIAGONAL)
    assert graph.accepted[2, 3] is pairs[2, 3].alternatives[1]
    pairs = exact_pairs([(0, 1)], world[:2])
    graph = graph_of(world[:2], {(0, 1): ambiguous(pairs[0, 1], rival=0.42)})
    assert not graph.components and "another pose explains" in graph.unplaced[0]


@pytest.mark.parametrize("off_deg", [0.0, 30.0, None])
def test_weak_pairs_join_two_components_only_where_they_agree(off_deg: float | None):
    """0 = 1 and 2 = 3 are good, 0 - 2 and 1 - 3 weak; found separately they say the same or not."""
    world = world_of(4)
    pairs = exact_pairs([(0, 1), (2, 3)], world)
    for i, j in [(0, 2)] if off_deg is None else [(0, 2), (1, 3)]:
        pairs[i, j] = exact_pair(i, j, world, WEAK, PairKind.NO_OVERLAP)
    if off_deg:
        pairs[1, 3] = turned(pairs[1, 3], off_deg)
    graph = graph_of(world, pairs)
    if off_deg == 0.0:
        assert scans_of(only_component(graph, world)) == {0, 1, 2, 3}
        assert {(0, 2), (1, 3)} <= set(graph.accepted)
    else:
        assert [scans_of(c) for c in graph.components] == [{0, 1}, {2, 3}]
        assert off_deg or graph.rejected[0, 2] == "no overlap by itself"


@pytest.mark.parametrize("agree", [0.15, 0.45, None])
def test_a_scan_of_something_else_or_without_any_pose_stays_out(agree: float | None):
    """3 takes itself for a neighbour of 2, but 0 and 1 see through it; nobody else knows it."""
    world = world_of(4)
    edges = [(0, 1), (1, 2), (0, 2)]
    pairs = exact_pairs(edges if agree is None else [*edges, (2, 3)], world, {(2, 3): agree or 0})
    if agree is not None:
        pairs[2, 3] = turned(pairs[2, 3], degrees=70)
    graph = graph_of(world, pairs)
    assert scans_of(only_component(graph, world)) == {0, 1, 2}
    assert set(graph.unplaced) == {3}
    if agree is None:
        assert graph.unplaced[3] == "no pose brings it onto any other scan"
    else:
        for words in (f"score {agree:.2f}", "contradicts other scans"):
            assert words in graph.unplaced[3]


@pytest.mark.parametrize("centre", range(5))
def test_the_reference_is_the_best_supported_scan(centre: int):
    r"""All pairs meet in one scan.

    a   b
     \ /
      c
     / \
    d   e
    """
    world = world_of(5)
    star = [(min(centre, k), max(centre, k)) for k in range(5) if k != centre]
    graph = graph_of(world, exact_pairs(star, world))
    assert only_component(graph, world).reference == centre
    assert graph.neighbours(centre) == tuple(k for k in range(5) if k != centre)


def test_settling_keeps_a_long_chain_from_drifting():
    """Each pair of a ring of 12 is 1.5 deg off, all the same way; the ring still closes."""
    world = world_of(12)
    ring = [(k, k + 1) for k in range(11)] + [(0, 11)]
    pairs = {edge: turned(pair, 1.5) if pair.alternatives else pair
             for edge, pair in exact_pairs(ring, world).items()}  # fmt: skip

    def settle(poses: Mapping[int, Pose]) -> Mapping[int, Pose]:
        first = min(poses)
        return {k: poses[first] @ true_pose(world, first, k) for k in poses}

    graph = graph_of(world, pairs, settle=settle)
    assert len(only_component(graph, world).poses) == 12
    assert set(graph.accepted) == set(ring)


@dataclass(frozen=True)
class Drawing:
    """A drawn graph: which pairs are good, how strong, and which of them are fooled."""

    num_scans: int
    strengths: dict[Edge, float]
    fooled: dict[Edge, float]

    def pairs(self, world: Sequence[Pose]) -> Pairs:
        pairs = exact_pairs(self.strengths, world, self.strengths)
        return pairs | {edge: turned(pairs[edge], d) for edge, d in self.fooled.items()}


@st.composite
def drawings(draw: st.DrawFn) -> Drawing:
    """Up to 7 scans; some good pairs, each of its own strength, a few of which are fooled."""
    n = draw(st.integers(2, 7))
    every = [(i, j) for i in range(n) for j in range(i + 1, n)]
    edges = draw(st.lists(st.sampled_from(every), unique=True, max_size=12))
    ranks = draw(st.permutations(range(len(edges))))
    fooled = draw(st.lists(st.sampled_from(edges), unique=True, max_size=3)) if edges else []
    return Drawing(
        num_scans=n,
        strengths={edge: 0.2 + 0.03 * rank for edge, rank in zip(edges, ranks, strict=True)},
        fooled={edge: draw(st.sampled_from([15.0, 60.0, 150.0])) for edge in fooled},
    )


@settings(max_examples=40)
@given(drawings())
def test_nothing_wrong_is_asserted_where_a_third_scan_can_tell(drawing: Drawing):
    """Only a fooled pair without a third scan can be placed wrongly."""
    world = world_of(drawing.num_scans)
    graph = graph_of(world, drawing.pairs(world))
    for component in graph.components:
        if len(component.poses) > 2 or tuple(sorted(component.poses)) not in drawing.fooled:
            assert_right(component, world)
    for edge in graph.accepted:
        assert edge in drawing.strengths


@settings(max_examples=30)
@given(drawings().filter(lambda drawing: not drawing.fooled))
def test_without_a_fooled_pair_components_are_those_of_the_drawing(drawing: Drawing):
    """Rings without chords too, in which opposite scans share nothing and deny nothing."""
    world = world_of(drawing.num_scans)
    graph = graph_of(world, drawing.pairs(world))
    assert set(graph.accepted) == set(drawing.strengths) and not graph.doubts
    assert set(graph.unplaced) == set(range(drawing.num_scans)) - {
        k for e in graph.accepted for k in e
    }
    home = {k: n for n, c in enumerate(graph.components) for k in c.poses}
    for i, j in drawing.strengths:
        assert home[i] == home[j]


@settings(max_examples=30)
@given(drawings(), st.integers(0, 10**6))
def test_permuting_the_scans_permutes_the_outcome(drawing: Drawing, seed: int):
    world = world_of(drawing.num_scans)
    pairs = drawing.pairs(world)
    new = np.random.default_rng(seed).permutation(drawing.num_scans).tolist()
    old = {k: n for n, k in enumerate(new)}
    shuffled = {}
    for (i, j), pair in pairs.items():
        if new[i] < new[j]:
            shuffled[new[i], new[j]] = replace(pair, i=new[i], j=new[j])
        else:
            options = tuple(replace(o, i_from_j=o.i_from_j.inverse()) for o in pair.alternatives)
            shuffled[new[j], new[i]] = replace(pair, i=new[j], j=new[i], alternatives=options)
    a = graph_of(world, pairs)
    b = graph_of([world[old[k]] for k in range(len(world))], dict(sorted(shuffled.items())))
    assert {tuple(sorted((new[i], new[j]))) for i, j in a.accepted} == set(b.accepted)
    assert {new[k] for k in a.unplaced} == set(b.unplaced)
    assert {new[k] for k in a.doubts} == set(b.doubts)
    sets = [{new[k] for k in c.poses} for c in a.components]
    assert sorted(map(sorted, sets)) == sorted(sorted(c.poses) for c in b.components)
    for c in a.components:
        d = next(d for d in b.components if new[c.reference] in d.poses)
        assert len(c.poses) == 2 or d.reference == new[c.reference]
        for i in c.poses:
            for j in c.poses:
                in_a = c.poses[i].inverse() @ c.poses[j]
                in_b = d.poses[new[i]].inverse() @ d.poses[new[j]]
                np.testing.assert_allclose(in_a.matrix(), in_b.matrix(), atol=1e-9)
