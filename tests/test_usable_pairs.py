"""Users' facts as files give them, and on drawn pairs with known truth: axes, start poses."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanweld.config import PairsConfig
from scanweld.errors import KnowledgeError
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.graph.assemble import build_view_graph
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.io import PoseSet, write_poses
from scanweld.knowledge.by_index import IndexedKnowledge
from scanweld.knowledge.facts import Knowledge, read_knowledge
from scanweld.knowledge.turntable import Turntable, find_turntable, off_axis_doubts
from scanweld.knowledge.usable_pairs import LenientVerdict, usable_pairs, with_found_pairs
from scanweld.pairs.anchors import even_anchors
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pipeline import run as pipeline
from tests.prepared import creature_pair
from tests.scenes import primitive_scene, random_motion
from tests.view_graphs import (
    CENTRE,
    SAME,
    WEAK,
    Pairs,
    exact_pair,
    exact_pairs,
    graph_with,
    judge_of,
    only_component,
    option,
    pair_of,
    problem_of,
    scans_of,
    turn_about_centre,
    turned,
    world_of,
)


def table_of(angles_deg: Sequence[float], seed: int = 0) -> tuple[list[Pose], Pose]:
    """Poses of sensors around an axis that is drawn, and the pose of the axis (its z) in them."""
    rng = np.random.default_rng(seed)
    sensor_from_axis = Pose(rotation=random_rotation(rng), translation=CENTRE)
    turns = [Pose.exp([0, 0, np.radians(angle), 0, 0, 0]) for angle in angles_deg]
    return [turn @ sensor_from_axis.inverse() for turn in turns], sensor_from_axis


def axis_of(pairs: Pairs, num_scans: int, *frames: Sequence[Pose]) -> Turntable | None:
    frames = frames or ([Pose.identity()] * num_scans,)
    return find_turntable(pairs, frames, [CENTRE] * num_scans, SAME)


def every_edge(num_scans: int) -> list[Edge]:
    return list(combinations(range(num_scans), 2))


def assert_axis(
    found: Turntable | None, sensor_from_axis: Pose, tolerance: float = 1e-6
) -> Turntable:
    assert found is not None
    direction = sensor_from_axis.rotation[:, 2]
    assert abs(abs(float(found.axis.direction @ direction)) - 1) < tolerance
    apart = found.axis.point - sensor_from_axis.translation
    assert np.linalg.norm(apart - direction * float(apart @ direction)) < tolerance
    return found


@settings(max_examples=15)
@given(
    seed=st.integers(0, 10**6),
    steps=st.lists(st.integers(20, 100), min_size=2, max_size=4),
    off_deg=st.integers(20, 160),
)
def test_the_axis_is_found_whatever_one_scan_off_it_says(seed: int, steps: list[int], off_deg: int):
    """The last scan is tilted, and all its pairs are good; the axis stays that of the others."""
    world, sensor_from_axis = table_of([0, *np.cumsum(steps)], seed)
    world.append(Pose.exp([np.radians(off_deg), 0, 0, 0, 0, 0]) @ world[-1])
    num = len(world)
    found = assert_axis(axis_of(exact_pairs(every_edge(num), world), num), sensor_from_axis)
    assert found.num_scans == num - 1
    assert found.angle_deg < 1e-5 and found.shift < 1e-6


def test_the_axis_is_that_of_most_scans_not_of_most_or_surest_pairs():
    """Five scans on one table, a chain of weak pairs; four on another, each with each, and sure."""
    table, sensor_from_axis = table_of([0, 30, 75, 130, 200], seed=1)
    world = [*table, *table_of([0, 40, 90, 150], seed=2)[0]]
    chain = [(0, 1), (1, 2), (2, 3), (3, 4)]
    each = [(i + 5, j + 5) for i, j in every_edge(4)]
    pairs = exact_pairs([*chain, *each], world, dict.fromkeys(chain, 0.2))
    found = assert_axis(axis_of(pairs, len(world)), sensor_from_axis)
    assert set(found.edges) == set(chain) and found.num_scans == 5


def test_the_axis_is_found_in_the_frames_of_the_files_where_the_sensors_have_none():
    """Sensors whose frames were made up scan by scan; but the files are in the scanner's."""
    world, sensor_from_axis = table_of([0, 40, 100, 190])
    rng = np.random.default_rng(1)
    files = [random_motion(rng, 1.0) for _ in range(4)]
    pairs = exact_pairs(every_edge(4), [w @ f for w, f in zip(world, files, strict=True)])
    assert axis_of(pairs, 4) is None
    assert_axis(axis_of(pairs, 4, [Pose.identity()] * 4, files), sensor_from_axis)


def test_residuals_are_those_of_the_pairs():
    world, sensor_from_axis = table_of([0, 50, 110, 160, 230])
    pairs = exact_pairs(every_edge(5), world)
    for n, edge in enumerate(pairs):
        pairs[edge] = turned(pairs[edge], degrees=0.5 * (-1) ** n)
    assert 0.1 < assert_axis(axis_of(pairs, 5), sensor_from_axis, tolerance=0.01).angle_deg < 0.5


def test_scans_from_anywhere_and_one_pair_have_no_common_axis():
    for num_scans in (3, 4, 6):
        world = world_of(num_scans)
        assert axis_of(exact_pairs(every_edge(num_scans), world), num_scans) is None
    assert axis_of(exact_pairs([(0, 1)], table_of([0, 40])[0]), 2) is None


def test_final_poses_off_the_axis_are_doubtful():
    world, _ = table_of([0, 40, 100, 190])
    pairs = exact_pairs(every_edge(4), world)
    found = axis_of(pairs, 4)
    assert found is not None
    slid = [*world[:3], world[3] @ turn_about_centre(2.0)]
    for poses, doubtful in ((slid, {3}), (world, set())):
        component = Component(poses=dict(enumerate(poses)), reference=0)
        doubts = off_axis_doubts(graph_with(pairs, component), found)
        assert set(doubts) == doubtful and all(
            "deg off the axis" in doubt.text for (doubt,) in doubts.values()
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class AsUsual(LenientVerdict):
    """Leaves every pair as it is."""

    pairs: Pairs
    fields: Sequence[ScanField] = ()
    config: PairsConfig = field(default_factory=PairsConfig)
    max_contradiction: float = 0.1

    def classify(self, edge: Edge, alternatives: object) -> PairResult:
        return self.pairs[edge]


def placed(
    world: Sequence[Pose], pairs: Pairs, known: IndexedKnowledge, table: Turntable | None
) -> ViewGraph:
    """The view graph of what is given; nothing is easier than usual."""
    usable = usable_pairs(pairs, known, table, AsUsual(pairs=pairs))
    problem = problem_of(len(world), usable, judge_of(world, pairs), apart=known.apart)
    return with_found_pairs(build_view_graph(problem), pairs, known)


def test_a_rival_off_the_axis_is_none():
    """0-3 has a wrong pose first; it is off the axis, and 3 is placed by the other."""
    world, _ = table_of([0, 40, 100, 190])
    pairs = exact_pairs([(0, 1), (1, 2), (0, 2)], world)
    true = exact_pair(0, 3, world, 0.3).alternatives[0]
    wrong = option(true.i_from_j @ turn_about_centre(90, (0.8, 0.6, 0.0)), 0.35)
    pairs[0, 3] = pair_of(0, 3, PairKind.AMBIGUOUS, wrong, true)
    pairs[1, 3] = exact_pair(1, 3, world, WEAK, PairKind.NO_OVERLAP)
    table = axis_of(pairs, 4)
    graph = placed(world, pairs, IndexedKnowledge(turntable=True), table)
    assert scans_of(only_component(graph, world)) == {0, 1, 2, 3}
    assert graph.accepted[0, 3] is true and graph.pairs is pairs


@pytest.mark.parametrize(("num_given", "num_placed"), [(0, 3), (1, 3), (2, 2)])
def test_start_poses_count_once_however_many_pairs_they_speak_for(num_given: int, num_placed: int):
    """0-1 is good; 0-2 and 1-2 are weak, and so many of them come from start poses alone.

    Weak pairs place a scan where they say the same, found separately; start poses are not.
    """
    world = world_of(3)
    pairs = exact_pairs([(0, 1)], world)
    for n, edge in enumerate([(0, 2), (1, 2)]):
        weak = exact_pair(*edge, world, WEAK, PairKind.NO_OVERLAP)
        given_one = replace(weak.alternatives[0], is_given=n < num_given)
        pairs[edge] = replace(weak, alternatives=(given_one,))
    (component,) = placed(world, pairs, IndexedKnowledge(), None).components
    assert len(component.poses) == num_placed


def test_pairs_apart_are_not_joined_by_others_and_the_first_fixed_scan_is_the_reference():
    """0-1-2-3, all good; 0 and 3 are apart but would lie on each other."""
    world = world_of(4)
    pairs = exact_pairs([(0, 1), (1, 2), (2, 3), (0, 3)], world)
    graph = placed(world, pairs, IndexedKnowledge(apart=frozenset({(0, 3)})), None)
    for component in graph.components:
        assert not {0, 3} <= set(component.poses)
    assert graph.rejected[0, 3] == "said to be apart" and (0, 3) not in graph.accepted
    place = Pose.exp([0.1, 0.2, 0.3, 4, 5, 6])
    known = IndexedKnowledge(fixed={3: place, 1: Pose.identity()})
    component = only_component(placed(world, pairs, known, None), world)
    assert component.reference == 3 and component.world_from_scan is place
    assert component.poses[3].angle_deg() == 0.0


@pytest.mark.parametrize("num_anchors", [8, 64])
def test_a_start_pose_is_marked_unless_the_search_finds_it_too(num_anchors: int):
    """The pose of a search that finds it is its own; in no case is there a second one near it."""
    pair = creature_pair(80)
    config = PairsConfig(num_anchors=num_anchors, num_turns=8, num_survivors=(5 * num_anchors, 5))
    first, second = (even_anchors(field, num_anchors) for field in pair.fields)
    sets = [(first, second)]
    start = pair.i_from_j @ turn_about_centre(1.0)
    alone, result = (
        register_pair(pair.problem(config), sets, None, given_pose) for given_pose in (None, start)
    )
    found = [option for option in alone.alternatives if pair.off_by(option.i_from_j)[0] < 5]
    right = [option for option in result.alternatives if pair.off_by(option.i_from_j)[0] < 5]
    assert len(right) == 1 and right[0] is result.best
    assert len(found) == (0 if num_anchors == 8 else 1)
    assert right[0].is_given is not bool(found)
    assert not any(option.is_given for option in alone.alternatives)


# Facts from files, and such as cannot be meant.


STRANGERS = PoseSet(poses={"x": Pose.identity()}, components=(("x",),))


@pytest.mark.parametrize(
    ("known", "told"),
    [
        ({"fix": ("nobody",)}, "fix: no scan is called nobody; there are scan_01"),
        ({"together": (("scan_01", "nobody"),)}, "together: no scan is called nobody"),
        ({"apart": (("nobody", "scan_01"),)}, "apart: no scan is called nobody"),
        ({"start": STRANGERS}, "start: has a pose for none of the scans"),
        ({"together": (("a", "b"),), "apart": (("b", "a"),)}, "a and b are .*together and apart"),
        ({"apart": (("a", "a"),)}, "a is named twice"),
    ],
)
def test_facts_about_no_scan_or_that_deny_each_other_are_errors(known: dict[str, Any], told: str):
    with pytest.raises(KnowledgeError, match=told):
        pipeline.run(primitive_scene("box", pixels=30).scans, knowledge=Knowledge(**known))


def test_facts_from_a_file(tmp_path: Path):
    poses = PoseSet(poses={"a": Pose.identity()}, components=(("a",),))
    write_poses(tmp_path / "poses.json", poses)
    file = tmp_path / "facts.json"
    told = {"fix": ["a"], "start": "poses.json", "together": [["b", "a"]], "turntable": True}
    file.write_text(json.dumps(told))
    known = read_knowledge(file)
    assert known.fix == ("a",) and known.together == (("a", "b"),) and known.turntable
    assert known.start is not None and set(known.start.poses) == {"a"}
    more = known.joined(Knowledge(fix=("c",), apart=(("a", "c"),)))
    assert more.fix == ("a", "c") and more.start is known.start and more.apart == (("a", "c"),)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "cannot be read as JSON"),
        ('{"turn_table": true}', "turn_table"),
        ('{"together": [["a"]]}', "together"),
        ("[]", "the file"),
        (None, r"facts\.json: No such file"),
    ],
)
def test_files_that_are_no_facts_are_named(tmp_path: Path, text: str | None, told: str):
    file = tmp_path / "facts.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(KnowledgeError, match=told) as raised:
        read_knowledge(file)
    assert str(file) in str(raised.value) and "\n" not in str(raised.value)
    assert text is not None or "correct it" not in str(raised.value)
