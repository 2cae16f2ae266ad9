"""Doubts about scans: every one is told, by a code that stays and in words."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from scanweld.app.model_folder import open_model
from scanweld.app.outputs import write_outputs
from scanweld.evidence.evidence import Evidence, PatchLimits
from scanweld.geometry.pose import Pose
from scanweld.graph.doubts import Doubt, DoubtCode, doubt_of, merged
from scanweld.graph.reasons import find_doubts
from scanweld.graph.view_graph import Component
from scanweld.reconstruction import DoubtReport, ScanReport, ScanVerdict
from tests.results import a_result
from tests.view_graphs import DrawnJudge, graph_with, seen, world_of

LIMITS = PatchLimits(contradiction=0.1, free=0.05)
CODES = [
    *("camera_stood", "alone", "moved_part", "violated", "inside", "unpaired", "mark_only"),
    *("not_refined", "disagreement", "off_axis", "scale", "inexact", "confidence"),
]


def test_codes_are_as_published():
    """Programs rely on them: one may be added, none may change or go."""
    assert [code.value for code in DoubtCode] == CODES
    text = (Path(__file__).parents[1] / "docs/report.md").read_text(encoding="utf-8")
    for code in CODES:
        assert f"- `{code}`: " in text


def test_all_doubts_about_a_scan_are_kept_and_the_weightiest_comes_first():
    parts = [
        doubt_of(DoubtCode.CONFIDENCE, {1: "unsure", 2: "unsure"}),
        doubt_of(DoubtCode.VIOLATED, {1: "seen through"}),
        doubt_of(DoubtCode.SCALE, {1: "too large"}),
        doubt_of(DoubtCode.SCALE, {1: "told twice"}),
    ]
    doubts = merged(*parts)
    assert doubts[1] == (
        Doubt(DoubtCode.VIOLATED, "seen through"),
        Doubt(DoubtCode.SCALE, "too large"),
        Doubt(DoubtCode.CONFIDENCE, "unsure"),
    )
    assert doubts[2] == (Doubt(DoubtCode.CONFIDENCE, "unsure"),)
    assert set(doubts) == {1, 2} and merged() == {}


@pytest.mark.parametrize("through", [(), ((0, 1),), ((0, 1), (1, 2))])
def test_a_part_that_two_pairs_see_through_is_doubted_and_a_shadow_in_one_is_not(
    through: tuple[tuple[int, int], ...],
):
    world = world_of(3)
    graph = graph_with({}, Component(poses=dict(enumerate(world)), reference=0))
    known = doubt_of(DoubtCode.NOT_REFINED, {0: "pulled apart"})
    graph = replace(graph, doubts=known)

    def says(i: int, j: int, i_from_j: Pose) -> Evidence:
        is_through = (min(i, j), max(i, j)) in through
        return replace(seen(0.0), free_patch=LIMITS.free + 0.04 * is_through)

    codes = {
        k: [doubt.code.value for doubt in doubts]
        for k, doubts in find_doubts(graph, DrawnJudge(says=says, limits=LIMITS)).items()
    }
    violated = ["violated"] if len(through) > 1 else []
    assert codes == {
        0: [*violated, "unpaired", "not_refined"],
        1: [*violated, "unpaired"],
        2: [*violated, "unpaired"],
    }


@pytest.mark.parametrize(
    ("accusing", "accused"),
    [
        ([(0, 1)], {0, 1}),  # nobody knows which
        ([(0, 2), (1, 2), (2, 3)], {2}),
        ([(0, 1), (0, 2), (0, 3), (3, 4)], {0, 3, 4}),
        ([], set()),
    ],
)
def test_a_false_inside_is_that_of_the_scan_that_most_others_accuse(
    accusing: list[tuple[int, int]], accused: set[int]
):
    graph = graph_with({}, Component(poses=dict(enumerate(world_of(5))), reference=0))

    def says(i: int, j: int, i_from_j: Pose) -> Evidence:
        return replace(seen(0.2), inside_patch=0.05 * ((min(i, j), max(i, j)) in accusing))

    doubts = find_doubts(graph, DrawnJudge(says=says, limits=LIMITS))
    told = {k for k, some in doubts.items() if DoubtCode.INSIDE in {one.code for one in some}}
    assert told == accused


def test_doubts_are_written_and_read_back(tmp_path: Path):
    told = (DoubtReport(code="scale", text="too large"), DoubtReport(code="off_axis", text="off"))
    result = a_result(["a", "b"])
    doubtful = ScanReport(verdict=ScanVerdict.DOUBTFUL, reason="too large", doubts=told)
    write_outputs(replace(result, scans={**result.scans, "b": doubtful}), tmp_path)
    scans = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["scans"]
    assert scans["b"]["doubts"] == [
        {"code": "scale", "text": "too large"},
        {"code": "off_axis", "text": "off"},
    ]
    assert scans["a"]["doubts"] == [] and scans["b"]["reason"] == "too large"
    assert open_model(tmp_path).report.scans["b"].doubts == told
