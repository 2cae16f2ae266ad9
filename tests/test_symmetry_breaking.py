"""Marks: one small place that decides between the turns of an object that is nearly symmetric."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from scanweld.config import GraphConfig
from scanweld.evaluation.primitives import lathe
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import view_of
from scanweld.evidence.judge import Poses
from scanweld.evidence.patches import PixelConsensus, is_refuted_jointly, pixel_consensus
from scanweld.evidence.pixels import see
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.graph.merge import Merge, propose_merges, unrefuted
from scanweld.graph.reasons import doubt_alone, find_doubts
from scanweld.graph.view_graph import Component, ViewGraph
from scanweld.pairs.anchors import even_anchors
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pairs.revolution import STEP_DEG, turn_to_feature
from scanweld.pairs.symmetry_breaking import Decision, decide
from tests.prepared import PreparedPair, prepared_pair
from tests.scenes import scene_of
from tests.view_graphs import SAME, DrawnJudge, exact_pair, pair_of, seen, world_of

Radius = Callable[[FloatArray, FloatArray], FloatArray]
TOLERANCE = 0.012
NEAR_DEG = 12.0


def gear(turn: FloatArray, level: FloatArray) -> FloatArray:
    return 44.0 + 6.0 * np.tanh(4.0 * np.cos(8 * turn)) + 0.0 * level


def worn(turn: FloatArray, level: FloatArray) -> FloatArray:
    is_worn = np.abs(np.angle(np.exp(1j * (turn - np.pi / 4)))) < np.pi / 10
    return gear(turn, level) - np.where(is_worn & (level > 0.5), 6.0, 0.0)


def vase(turn: FloatArray, level: FloatArray) -> FloatArray:
    return 24.0 + 10.0 * np.sin(2.5 * np.pi * level + 0.3) - 4.0 * level + 0.0 * turn


def knobbed(turn: FloatArray, level: FloatArray) -> FloatArray:
    away2 = (30.0 * (turn - 0.5)) ** 2 + (100.0 * (level - 0.3)) ** 2
    return vase(turn, level) + 4.0 * np.exp(-away2 / 17.0)


def unequal(turn: FloatArray, level: FloatArray) -> FloatArray:
    """Every other tooth is lower."""
    return gear(turn, level) - np.where(np.cos(8 * turn) > 0, 4.0 * (np.cos(4 * turn) < 0), 0.0)


def scanned(radius: Radius, height: float, elevation_deg: float, noise: float) -> PreparedPair:
    """Two scans 50 deg apart."""
    mesh = lathe(radius, height)
    views = [view_of(mesh, turn, elevation_deg, 20.0, pixels=200.0) for turn in (0.0, 50.0)]
    scene = scene_of(mesh, views, noise=NoiseModel(depth_diameters=noise, dropout=0.01))
    return prepared_pair(scene.scans[0], scene.scans[1], scene.i_from_j(0, 1))


def turned(pair: PreparedPair, degrees: Sequence[float]) -> list[Alternative]:
    """The true pose with j's object turned about the object's axis, best evidence first."""
    axis, point = axis_of(pair)
    options = []
    for angle in degrees:
        turn = rotation_exp(np.radians(angle) * axis)
        pose = pair.i_from_j @ Pose(rotation=turn, translation=point - turn @ point)
        options.append(pair.problem().evaluate(pose))
    return sorted(options, key=lambda option: -option.score)


def axis_of(pair: PreparedPair) -> tuple[FloatArray, FloatArray]:
    """Direction and a point of the axis in the sensor frame of j, from both sensors' places.

    The sensors look at the middle of the object from the same elevation, so that their turn about
    its axis takes one to the other.
    """
    motion = pair.i_from_j
    angles, vectors = np.linalg.eig(motion.rotation)
    axis = np.real(vectors[:, int(np.argmin(np.abs(angles - 1.0)))])
    rows = np.eye(3) - motion.rotation
    point = np.linalg.lstsq(rows, motion.translation, rcond=1e-6)[0]
    return axis.astype(np.float64), point.astype(np.float64)


def decided(pair: PreparedPair, options: Sequence[Alternative]) -> Decision | None:
    return decide(pair.problem(), options)


EIGHT = [45.0 * k for k in range(8)]


@pytest.mark.parametrize("noise", [0.0005, 0.003])
def test_a_worn_tooth_decides_between_the_turns_of_a_gear(noise: float):
    pair = scanned(worn, 30.0, 35.0, noise)
    found = decided(pair, turned(pair, EIGHT))
    assert found is not None
    angle, shift = pair.off_by(found.pose.i_from_j)
    assert angle < 1.0 and shift < 0.01
    assert len(found.passed_over) == 7


def registered(pair: PreparedPair) -> PairResult:
    problem = pair.problem()
    a, b = (even_anchors(field, problem.config.num_anchors) for field in pair.fields)
    return register_pair(problem, [(a, b)])


def test_what_a_mark_decides_against_is_told():
    pair = scanned(worn, 30.0, 35.0, 0.0005)
    found = registered(pair)
    assert pair.off_by(found.alternatives[0].i_from_j)[0] < 1.0
    off = [pair.off_by(option.i_from_j)[0] for option in found.passed_over]
    assert min(off) > NEAR_DEG
    assert all(min(abs(angle - turn) for angle in off) < 5.0 for turn in (45, 90, 135, 180))
    assert not registered(scanned(gear, 30.0, 35.0, 0.0005)).passed_over


def test_turns_that_the_search_missed_are_found():
    pair = scanned(worn, 30.0, 35.0, 0.0005)
    wrong = turned(pair, [45.0, 90.0, 180.0, 270.0])
    found = decided(pair, wrong)
    assert found is not None and pair.off_by(found.pose.i_from_j)[0] < 1.0


@pytest.mark.parametrize("noise", [0.0005, 0.005])
def test_nothing_decides_between_the_turns_of_a_whole_gear(noise: float):
    pair = scanned(gear, 30.0, 35.0, noise)
    assert decided(pair, turned(pair, EIGHT)) is None


def test_a_difference_all_over_is_no_mark():
    pair = scanned(unequal, 30.0, 35.0, 0.0005)
    found = decided(pair, turned(pair, EIGHT))
    assert found is None


def test_a_knob_decides_and_says_that_some_turns_hide_it():
    pair = scanned(knobbed, 100.0, 15.0, 0.0005)
    found = decided(pair, turned(pair, [20.0 * k for k in range(18)]))
    assert found is not None and found.is_hidden_in_others
    assert pair.off_by(found.pose.i_from_j)[0] < 1.0
    plain = scanned(vase, 100.0, 15.0, 0.0005)
    assert decided(plain, turned(plain, [20.0 * k for k in range(18)])) is None


@pytest.mark.parametrize("start_deg", [-40.0, -25.0, 50.0, 100.0])
def test_a_vase_is_turned_until_its_knobs_meet(start_deg: float):
    pair = scanned(knobbed, 100.0, 15.0, 0.001)
    start = turned(pair, [start_deg])[0].i_from_j
    found = turn_to_feature(pair.problem(), start)
    assert found is not None
    angle, shift = pair.off_by(found)
    assert angle < STEP_DEG and shift < 0.01


@pytest.mark.parametrize(("body", "height"), [(vase, 100.0), (gear, 30.0), (worn, 30.0)])
def test_without_a_mark_or_a_free_turn_nothing_is_turned(body: Radius, height: float):
    pair = scanned(body, height, 20.0, 0.001)
    start = turned(pair, [45.0])[0].i_from_j
    assert turn_to_feature(pair.problem(), start) is None


def test_one_rival_shows_no_symmetry():
    pair = scanned(worn, 30.0, 35.0, 0.0005)
    assert decided(pair, turned(pair, [0.0, 180.0])) is None
    assert decided(pair, turned(pair, [0.0])) is None
    assert decided(pair, []) is None


def test_a_pose_refutes_another_and_not_itself():
    pair = scanned(worn, 30.0, 35.0, 0.0005)
    right, wrong = (turned(pair, [angle])[0].i_from_j for angle in (0.0, 45.0))
    tolerance = TOLERANCE * pair.diameter
    here, there = (
        [pixel_consensus([one], tolerance) for one in see(*pair.fields, pose, pair.diameter)]
        for pose in (right, wrong)
    )
    assert is_refuted_jointly(there, here)
    assert not is_refuted_jointly(here, there)
    assert not is_refuted_jointly(here, here)


def test_merges_that_another_one_refutes_are_no_rivals():
    world = world_of(2)
    right = world[0].inverse() @ world[1]
    spin = Pose(rotation=rotation_exp(np.array([0.0, 0.0, 1.0])), translation=np.zeros(3))
    both = [Alternative(i_from_j=pose, evidence=seen(0.5)) for pose in (right, right @ spin)]
    pairs = {(0, 1): pair_of(0, 1, PairKind.AMBIGUOUS, *both)}
    a, b = {0: Pose.identity()}, {1: Pose.identity()}
    fixed = a, b, pairs, [np.zeros(3)] * 2, SAME
    judge = DrawnJudge(says=lambda i, j, pose: seen(0.5))
    tied = propose_merges(*fixed, judge)
    assert [merge.margin for merge in tied] == pytest.approx([0.0, 0.0])

    pair = scanned(worn, 30.0, 35.0, 0.0005)
    poses = {
        is_right: turned(pair, [0.0 if is_right else 45.0])[0].i_from_j
        for is_right in (True, False)
    }

    def tell(_: Poses, moved: Poses) -> list[PixelConsensus]:
        is_right = (right.inverse() @ moved[1]).angle_deg() < 1.0
        both = see(*pair.fields, poses[is_right], pair.diameter)
        return [pixel_consensus([seen_], TOLERANCE * pair.diameter) for seen_ in both]

    (kept,) = unrefuted(a, b, tied, replace(judge, sees=tell))
    assert (kept.a_from_b.inverse() @ right).angle_deg() < 1e-6 and kept.margin == 1.0


@pytest.mark.parametrize(("kind", "num_left"), [(PairKind.SLIDING, 1), (PairKind.AMBIGUOUS, 2)])
def test_what_slides_is_no_rival_of_what_a_mark_decides(kind: PairKind, num_left: int):
    world = world_of(3)
    right, other = (world[0].inverse() @ world[k] for k in (1, 2))
    slid = right @ Pose(rotation=rotation_exp(np.array([0.0, 0.0, 1.0])), translation=np.zeros(3))
    marked = pair_of(0, 1, PairKind.AMBIGUOUS, Alternative(i_from_j=right, evidence=seen(0.3)))
    turn = Alternative(i_from_j=other.inverse() @ slid, evidence=seen(0.6))
    slides = pair_of(1, 2, kind, replace(turn, i_from_j=turn.i_from_j.inverse()))
    a, b = {0: Pose.identity(), 2: other}, {1: Pose.identity()}

    def merges(rests_on_feature: bool) -> list[Merge]:
        pairs = {(0, 1): replace(marked, rests_on_feature=rests_on_feature), (1, 2): slides}
        judge = DrawnJudge(says=lambda i, j, pose: seen(0.3))
        proposed = propose_merges(a, b, pairs, [np.zeros(3)] * 3, SAME, judge)
        return unrefuted(a, b, proposed, judge)

    assert len(merges(rests_on_feature=False)) == 2
    left = merges(rests_on_feature=True)
    assert len(left) == num_left
    assert any((merge.a_from_b.inverse() @ right).angle_deg() < 1e-6 for merge in left)


def test_what_only_a_mark_holds_is_doubtful():
    world = world_of(4)
    pairs = {e: exact_pair(*e, world) for e in ((0, 1), (1, 2), (2, 3))}
    marked = replace(pairs[2, 3], kind=PairKind.AMBIGUOUS, rests_on_feature=True)
    component = Component(poses=dict(enumerate(world)), reference=0)

    def doubts(last: PairResult) -> dict[int, str]:
        both = {**pairs, (2, 3): last}
        accepted = {edge: result.alternatives[0] for edge, result in both.items()}
        graph = ViewGraph(
            pairs=both,
            usable=both,
            accepted=accepted,
            rejected={},
            components=(component,),
            unplaced={},
        )
        return find_doubts(graph, DrawnJudge(says=lambda i, j, pose: seen(0.5)), GraphConfig())

    assert doubts(pairs[2, 3]) == {}
    assert list(doubts(marked)) == [3]
    assert "mark" in doubts(marked)[3]


def test_no_scan_is_good_alone():
    world = world_of(5)
    three, two = (
        Component(poses={k: world[k] for k in scans}, reference=scans[0])
        for scans in ((0, 1, 2), (3, 4))
    )
    graph = ViewGraph(
        pairs={},
        usable={},
        accepted={},
        rejected={},
        components=(three, two),
        unplaced={},
        doubts={0: "far"},
    )
    assert doubt_alone(graph) == {}
    assert list(doubt_alone(replace(graph, doubts={0: "far", 2: "far", 4: "far"}))) == [1, 3]
    assert doubt_alone(replace(graph, doubts=dict.fromkeys(range(5), "far"))) == {}
