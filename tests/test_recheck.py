"""Merges that fail at first sight: once all scans have settled, edges forgiven, beside others."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from scanweld.evidence.edges import evidence_off_edges, with_wide_edges
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.field import RASTER_DEPTH, RASTER_KIND, RASTER_NORMAL, ScanField
from scanweld.evidence.visibility import mean_evidence, two_way_evidence
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind
from scanweld.graph.assemble import build_view_graph
from scanweld.graph.merge import Merge, without_excluded
from scanweld.graph.proposals import Proposal
from scanweld.graph.view_graph import ViewGraph
from scanweld.pairs.result import PairKind
from tests.prepared import creature_pair
from tests.view_graphs import (
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

FOCAL, WALL, BAR = 200.0, 5.0, 4.0
PIXEL = WALL / FOCAL


def wall_with_a_bar(model: CameraModel = CameraModel.PINHOLE) -> ScanField:
    """A bar, 11 pixels wide, before a wall that fills the image; the samples are the bar's."""
    focal = FOCAL if model is CameraModel.PINHOLE else 1.0 / PIXEL
    camera = Camera(model=model, width=101, height=101, fx=focal, fy=focal, cx=50.0, cy=50.0)
    raster = np.zeros((101, 101, 6), dtype=np.float32)
    raster[..., RASTER_DEPTH] = WALL
    raster[:, 45:56, RASTER_DEPTH] = BAR
    raster[..., RASTER_NORMAL + 2] = -1.0
    columns, rows = np.meshgrid(np.arange(45.0, 56.0), np.arange(20.0, 81.0, 4.0))
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=1)
    points = camera.unproject(pixels, np.full(len(pixels), BAR))
    return replace(
        creature_pair(40.0).fields[0],
        camera=camera.parameters,
        raster=raster,
        points=points,
        normals=np.tile([0.0, 0.0, -1.0], (len(points), 1)),
        centre=points.mean(axis=0),
    )


def evidence_aside(scan: ScanField, pixels: float) -> tuple[Evidence, Evidence]:
    """Of a scan and itself some of the bar's pixels aside, with edges and without."""
    width = (BAR if scan.camera[0] == CameraModel.PINHOLE else WALL) / FOCAL
    aside = Pose(rotation=np.eye(3), translation=np.array([pixels * width, 0.0, 0.0]))
    both = scan, with_wide_edges(scan, 3.0 * PIXEL)
    strict = mean_evidence(*two_way_evidence(scan, scan, aside, 0.1))
    return strict, evidence_off_edges(both, both, aside, 0.1)


@pytest.mark.parametrize("model", [CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC])
def test_what_falls_beside_an_edge_is_forgiven(model: CameraModel):
    scan = wall_with_a_bar(model)
    assert evidence_aside(scan, 0.0)[0].front == 0.0
    for pixels in (1.0, 2.0, 3.0):
        strict, off_edges = evidence_aside(scan, pixels)
        assert strict.front == pytest.approx(pixels / 11)
        assert off_edges.front == 0.0
        assert off_edges.agree == strict.agree
        assert off_edges.unknown == pytest.approx(strict.front)
    strict, off_edges = evidence_aside(scan, 8.0)
    assert strict.front == pytest.approx(8 / 11)
    assert off_edges.front == pytest.approx(5 / 11)


def test_what_is_no_edge_is_not_forgiven():
    """A slope; a border of free space; what lies before a surface all around."""
    for slope in (0.0, 1.0, 3.0):
        scan = wall_with_a_bar(CameraModel.ORTHOGRAPHIC)
        scan.raster[..., RASTER_DEPTH] = WALL + slope * PIXEL * (np.arange(101) - 50.0)
        assert np.array_equal(with_wide_edges(scan, 3.0 * PIXEL).raster, scan.raster)
    scan = wall_with_a_bar()
    nearer = Pose.exp([0, 0, 0, 0, 0, -0.3])
    both = scan, with_wide_edges(scan, 3.0 * PIXEL)
    # One direction lies before what the other saw, the other one behind it.
    assert evidence_off_edges(both, both, nearer, 0.1).front == pytest.approx(0.5)
    scan.raster[:, 45:56, RASTER_KIND] = float(PixelKind.FREE)
    assert np.array_equal(with_wide_edges(scan, 3.0 * PIXEL).raster, scan.raster)


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
    off_edges: Say | None = None,
    off_deg: float = 4.0,
    rival: Pose | None = None,
) -> ViewGraph:
    """0-1 is exact, 1-2 is off; where scans settle, they settle at truth."""
    world = world_of(3)
    pairs = exact_pairs([(0, 1), (1, 2)], world)
    pairs[1, 2] = turned(pairs[1, 2], off_deg)
    if rival is not None:
        options = (*pairs[1, 2].alternatives, option(rival, 0.3))
        pairs[1, 2] = replace(pairs[1, 2], alternatives=options)

    def settle(poses: Mapping[int, Pose]) -> Mapping[int, Pose]:
        first = min(poses)
        return {k: poses[first] @ true_pose(world, first, k) for k in poses}

    judge = DrawnJudge(says=judge_pair, says_off_edges=off_edges)
    return build_view_graph(problem_of(3, pairs, judge, settle if settles else stay))


def test_a_merge_is_judged_again_once_its_scans_have_settled():
    """From 4 deg off it is the same merge that settles, from 8 deg another one."""
    judge_pair, world = drifting(seen(0.3)), world_of(3)
    assert scans_of(chain(judge_pair, settles=False).components[0]) == {0, 1}
    (component,) = chain(judge_pair, settles=True).components
    assert scans_of(component) == {0, 1, 2}
    assert is_same(component.poses[0].inverse() @ component.poses[2], true_pose(world, 0, 2))
    assert 2 in chain(judge_pair, settles=True, off_deg=8.0).unplaced


@pytest.mark.parametrize("agree", [0.05, 0.6])
def test_rivals_are_judged_without_edges_too(agree: float):
    """At first sight edges speak against the rival; without them it may fit as well."""
    judge_pair = drifting(seen(0.3))
    rival = true_pose(world_of(3), 1, 2) @ turn_about_centre(90.0)
    fits = seen(agree)
    denied = replace(fits, front=0.2, unknown=0.0, occluded=0.8 - agree)

    def is_rival(i: int, j: int, i_from_j: Pose) -> bool:
        return {i, j} == {1, 2} and is_same(rival, i_from_j if i < j else i_from_j.inverse())

    def at_sight(i: int, j: int, i_from_j: Pose) -> Evidence:
        return denied if is_rival(i, j, i_from_j) else judge_pair(i, j, i_from_j)

    def off_edges(i: int, j: int, i_from_j: Pose) -> Evidence:
        return fits if is_rival(i, j, i_from_j) else seen(0.3)

    found = chain(at_sight, settles=True, off_edges=off_edges, rival=rival)
    assert (2 in found.unplaced) is (agree > 0.5)


@pytest.mark.parametrize(("front", "is_placed"), [(0.02, True), (0.06, True), (0.1, False)])
def test_without_edges_less_may_be_violated(front: float, is_placed: bool):
    """Of what agrees, 0.9, at most 0.075 is; at first sight twice as much would do."""
    at_edges = Evidence(agree=0.5, front=0.2, contradict=0, free=0, occluded=0.3, unknown=0)
    judge_pair = drifting(at_edges)
    inside = replace(at_edges, front=front, unknown=0.2 - front)

    def off_edges(i: int, j: int, i_from_j: Pose) -> Evidence:
        return inside if {i, j} == {0, 2} else judge_pair(i, j, i_from_j)

    placed = chain(judge_pair, settles=True, off_edges=off_edges)
    assert (2 in placed.unplaced) is not is_placed
    assert 2 in chain(judge_pair, settles=True).unplaced


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
