"""The trust benchmark's verdicts on verdicts: what it counts as wrong, floors, kept runs."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.paper.study import Record, Study

from benchmarks import trust as command
from benchmarks.judging import floors as floors_module
from benchmarks.judging import rivals, trial
from benchmarks.judging.floors import Floor, floors, names_factor, real_sets
from benchmarks.judging.measures import (
    brier,
    calibration_error,
    reliability,
    risk_coverage,
)
from benchmarks.judging.page import Results, page_text
from benchmarks.judging.table import FIRST_SEED, Runs, outcomes_of
from benchmarks.judging.tables import floor_table, kind_table, misses, scenario_table
from benchmarks.judging.trial import Outcome, PairOutcome, ScanOutcome, judge, try_out
from benchmarks.sets import SETS
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Scene, make_scene
from scanweld.errors import InputError
from scanweld.geometry.pose import Pose
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import Reconstruction, ScanReport, ScanVerdict
from tests.results import a_pair, a_result

DOCS = Path(__file__).parents[1] / "docs"
SMALL = "64 pixels across"


@cache
def scene_of(name: str) -> Scene:
    return make_scene(SCENARIOS[name], 1)


def told_as_true(scene: Scene, world: int = 0) -> Reconstruction:
    """A run that places all scans of a world where they are, and every pair of them."""
    names = sorted(n for n in scene.truth if scene.worlds[n] == world)
    others = {scan.name: "does not fit" for scan in scene.scans if scan.name not in names}
    found = a_result(names, others)
    gauge = scene.truth[names[0]].inverse()
    pairs = tuple(
        replace(a_pair(i, j), i_from_j=scene.truth[i].inverse() @ scene.truth[j])
        for i, j in combinations(names, 2)
    )
    return replace(found, poses={n: gauge @ scene.truth[n] for n in names}, pairs=pairs)


def moved(found: Reconstruction, name: str, by: Pose) -> Reconstruction:
    """The same with one scan elsewhere, and still called good."""
    return replace(found, poses={**found.poses, name: found.poses[name] @ by})


def with_confidence(outcome: Outcome, confidence: float) -> Outcome:
    """The same outcome, all that is placed stated with one confidence."""
    return replace(
        outcome,
        scans=tuple(replace(s, confidence=confidence) for s in outcome.scans),
        pairs=tuple(p and replace(p, confidence=confidence) for p in outcome.pairs),
    )


def outcome_of(scenario: str, found: Reconstruction, seed: int = 1) -> Outcome:
    scans, pairs = judge(found, scene_of(scenario))
    return Outcome(
        scenario=scenario, seed=seed, verdict="good", scans=scans, pairs=pairs, seconds=1.0
    )


def floor_of(outcomes: list[Outcome], measure: str) -> Floor:
    (found,) = (floor for floor in floors(outcomes) if measure in floor.measure)
    return found


TURN = Pose.exp([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])


def test_a_run_that_tells_the_truth_is_right():
    outcome = outcome_of("ring of 6", told_as_true(scene_of("ring of 6")))
    assert all(scan.is_right and scan.is_good and not scan.is_false for scan in outcome.scans)
    assert all(pair and pair.is_right for pair in outcome.pairs)
    assert floor_of([outcome], "clean").is_met
    assert floor_of([outcome], "called good that are wrong").is_met
    assert misses([outcome]) == "None.\n"


def test_a_wrong_scan_that_is_called_good_is_falsely_good():
    scene = scene_of("ring of 6")
    found = moved(told_as_true(scene), "scan_03", TURN)
    outcome = outcome_of("ring of 6", found)
    assert [scan.is_false for scan in outcome.scans].count(True) == 1
    assert floor_of([outcome], "called good that are wrong").is_met is False
    assert "**falsely good**" in misses([outcome])
    assert "| **1** |" in scenario_table([outcome])


def test_a_wrong_scan_that_is_called_doubtful_is_not_falsely_good():
    found = moved(told_as_true(scene_of("ring of 6")), "scan_03", TURN)
    doubtful = ScanReport(verdict=ScanVerdict.DOUBTFUL, reason="hardly fits")
    outcome = outcome_of("ring of 6", replace(found, scans={**found.scans, "scan_03": doubtful}))
    assert floor_of([outcome], "called good that are wrong").is_met
    assert floor_of([outcome], "clean").is_met is False
    assert "5 of 6" not in misses([outcome])
    assert "1 of 6 not right" in misses([outcome])


def test_any_pose_of_a_symmetric_object_is_falsely_good():
    scene = scene_of("box")
    for number in (None, 0):
        found = told_as_true(scene)
        if number is not None:
            name = sorted(found.poses)[1]
            turn = found.poses[name]
            gauge = scene.truth[sorted(found.poses)[0]].inverse()
            equal = gauge @ scene.symmetry[number] @ scene.truth[name]
            found = replace(found, poses={**found.poses, name: equal})
            assert (turn.inverse() @ equal).angle_deg() > 100
        outcome = outcome_of("box", found)
        assert all(scan.standing == "right" and scan.is_false for scan in outcome.scans)
        assert not any(pair and pair.is_right for pair in outcome.pairs)
        assert floor_of([outcome], "called good that are wrong").is_met is False


def test_a_symmetric_pose_is_asserted_from_a_half_on():
    outcome = outcome_of("box", told_as_true(scene_of("box")))
    measure = "pose asserted"
    assert floor_of([with_confidence(outcome, 0.6)], measure).is_met is False
    assert floor_of([with_confidence(outcome, 0.4)], measure).is_met
    clean = outcome_of("ring of 6", told_as_true(scene_of("ring of 6")))
    assert "0 of 0 scans" in floor_of([with_confidence(clean, 0.99)], measure).reached


def test_scans_without_the_mark_are_open_and_the_others_are_not():
    scene = scene_of("vase with a knob")
    assert 0 < len(scene.is_open) < len(scene.scans)
    outcome = outcome_of("vase with a knob", told_as_true(scene))
    assert sum(scan.is_false for scan in outcome.scans) == len(scene.is_open)


def test_strangers_are_wrong_wherever_they_are_placed():
    scene = scene_of("mirrored scan")
    found = told_as_true(scene)
    (name,) = set(scene.sources) - set(scene.truth)
    first = found.components[0][0]
    placed = replace(
        found,
        poses={**found.poses, name: found.poses[first]},
        components=((*found.components[0], name),),
        scans={**found.scans, name: found.scans[first]},
        pairs=(*found.pairs, a_pair(min(first, name), max(first, name))),
    )
    before, after = outcome_of("mirrored scan", found), outcome_of("mirrored scan", placed)
    measure = "of another object"
    assert floor_of([before], measure).is_met
    assert floor_of([after], measure).is_met is False
    assert [p.is_right for p in after.pairs if p].count(False) == 1


def test_two_objects_in_one_component_are_wrong_and_in_two_are_right():
    scene = scene_of("two objects")
    one, other = told_as_true(scene, 0), told_as_true(scene, 1)
    scans = {name: found.scans[name] for found in (one, other) for name in found.poses}
    both = replace(one, poses={**one.poses, **other.poses}, scans=scans, unplaced={})
    apart = replace(both, components=(*one.components, *other.components))
    assert all(s.is_right for s in outcome_of("two objects", apart).scans)
    mixed = replace(both, components=(one.components[0] + other.components[0],))
    assert sum(s.is_false for s in outcome_of("two objects", mixed).scans) >= 6


def test_what_lies_apart_is_not_right():
    found = told_as_true(scene_of("ring of 6"))
    names = found.components[0]
    parted = replace(found, components=(names[:4], names[4:]))
    outcome = outcome_of("ring of 6", parted)
    assert [scan.is_right for scan in outcome.scans] == [True] * 4 + [False] * 2
    assert not any(scan.is_false for scan in outcome.scans)


def test_a_pair_is_right_within_five_degrees():
    scene = scene_of("ring of 6")
    found = told_as_true(scene)
    for degrees, is_right in ((4.0, True), (6.0, False)):
        centre = scene.centroids[found.pairs[0].j]
        turn = Pose.exp([0.0, 0.0, np.radians(degrees), 0.0, 0.0, 0.0])
        about = Pose(rotation=turn.rotation, translation=centre - turn.rotation @ centre)
        pose = found.pairs[0].i_from_j
        assert pose is not None
        pairs = (replace(found.pairs[0], i_from_j=pose @ about), *found.pairs[1:])
        outcome = outcome_of("ring of 6", replace(found, pairs=pairs))
        assert outcome.pairs[0] is not None
        assert outcome.pairs[0].is_right is is_right


@pytest.mark.parametrize(
    ("reason", "is_named"),
    [
        ("its scale differs: 1.010 times too large", True),
        ("too large by 1.0 %, its scale is wrong", True),
        ("scale 0.990", True),
        ("scale 1.05", False),
        ("residual 1.010", False),
    ],
)
def test_a_factor_is_named_or_not(reason: str, is_named: bool):
    outcome = outcome_of("ring of 6", told_as_true(scene_of("ring of 6")))
    assert names_factor(replace(outcome.scans[0], reason=reason, factor=1.01)) is is_named


def test_outcomes_come_back_from_their_records():
    found = moved(told_as_true(scene_of("ring of 6")), "scan_03", TURN)
    outcome = with_confidence(outcome_of("ring of 6", found), 0.25)
    unit = {"scenario": "ring of 6", "seed": 1}
    again = Outcome.of(unit, outcome.record())
    assert again.record() == outcome.record()
    assert again.pairs == outcome.pairs
    for kind in PairKind:
        pair = PairOutcome(
            confidence=0.125, kind=str(kind), is_accepted=False, is_right=False, is_open=True
        )
        assert PairOutcome.of(pair.brief()) == pair


class Interrupted(Exception):
    """Stands for a kill."""


def test_finished_runs_are_not_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    true = outcome_of("ring of 6", told_as_true(scene_of("ring of 6")))
    made: list[int] = []

    def stub(scenario: str, seed: int) -> Outcome:
        if len(made) == 3:
            raise Interrupted
        made.append(seed)
        return replace(
            with_confidence(true, 0.9 - 0.01 * (seed - FIRST_SEED)), scenario=scenario, seed=seed
        )

    monkeypatch.setattr("benchmarks.judging.table.try_out", stub)
    study = Study(out=tmp_path, work=tmp_path / "w", workers=1, quick=False, command="test")
    runs = Runs(scenarios=("ring of 6",), seeds=5)
    with pytest.raises(Interrupted):
        study.records(runs, lambda done, total: None)
    made[:] = [*made[:1]]
    records = study.records(runs, lambda done, total: None)
    assert made[1:] == [FIRST_SEED + 3, FIRST_SEED + 4]
    again = study.records(runs, lambda done, total: None)
    tables = [
        scenario_table(outcomes_of(r)) + floor_table(floors(outcomes_of(r)))
        for r in (records, again)
    ]
    assert tables[0] == tables[1]
    assert "| ring of 6 | clean | 5 |" in tables[0]


@pytest.mark.parametrize(
    ("error", "verdict"), [(InputError("too few"), "error"), (ZeroDivisionError("x"), "crash")]
)
def test_failed_runs_are_kept_as_such(
    monkeypatch: pytest.MonkeyPatch, error: Exception, verdict: str
):
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(trial, "run", fail)
    outcome = try_out("ring of 6", 1)
    assert outcome.verdict == verdict
    assert floor_of([outcome], "crash").is_met is (verdict != "crash")
    assert len(outcome.pairs) == 15
    assert floor_of([outcome], "clean").is_met is False
    assert f"**{verdict}**" in misses([outcome])


def test_the_command_runs_and_does_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    options = ["--only", SMALL, "--seeds", "1", "--jobs", "1", "--out", str(tmp_path / "docs")]
    options += ["--work", str(tmp_path / "work")]
    monkeypatch.setattr("sys.argv", ["trust", *options])
    command.main()
    page = (tmp_path / "docs/trust.md").read_text(encoding="utf-8")
    assert f"| {SMALL} | reported | 1 | 6 |" in page
    (outcome,) = Results(tmp_path / "docs").outcomes
    assert len(outcome.scans) == 6 and len(outcome.pairs) == 15
    assert not any(scan.is_good and scan.is_false for scan in outcome.scans)
    monkeypatch.setattr("benchmarks.judging.table.try_out", lambda *_: pytest.fail("run again"))
    command.main()
    assert (tmp_path / "docs/trust.md").read_text(encoding="utf-8") == page


def test_the_worst_condition_is_told():
    true = outcome_of("ring of 6", told_as_true(scene_of("ring of 6")))
    bad = replace(
        true,
        scenario="hand",
        scans=tuple(replace(s, standing="unplaced", verdict="unplaced") for s in true.scans[:2])
        + true.scans[2:],
    )
    floor = floor_of([replace(true, scenario="table"), bad], "hard condition")
    assert floor.is_met is False
    assert floor.reached == "least: hand, 67 %; 1 of 2 below"


def test_kinds_of_pairs_are_counted():
    outcomes = [outcome_of(name, told_as_true(scene_of(name))) for name in ("ring of 6", "box")]
    table = kind_table(outcomes)
    assert "| good | 25 | 15 | 25 | 10 | 10 |" in table
    assert "| no overlap | 0 | 0 | 0 | 0 | 0 |" in table


def test_real_sets_are_held_to_their_floors():
    run: dict[str, Any] = {
        **{"set": "bunny4", "right": 4, "wrong": 0, "verdict": "good"},
        **dict.fromkeys(("rotation_mean", "rotation_max"), 0.1),
        **dict.fromkeys(("translation_mean", "translation_max"), 0.1),
    }
    assert SETS["bunny4"].floors.right == 4
    assert real_sets([run]).is_met
    for change in ({"right": 3}, {"wrong": 1}, {"rotation_max": 2.0}, {"verdict": "doubtful"}):
        assert real_sets([{**run, **change}]).is_met is False


def test_calibration_error_of_known_answers():
    assert calibration_error([0.7] * 10, [True] * 7 + [False] * 3, 1) == pytest.approx(0.0)
    assert calibration_error([1.0] * 5 + [0.0] * 5, [False] * 5 + [True] * 5, 2) == 1.0
    assert np.isnan(calibration_error([], []))
    bins = reliability([0.1, 0.2, 0.8, 0.9], [False, True, True, True], 2)
    assert [(b.confidence, b.right, b.count) for b in bins] == [
        (pytest.approx(0.15), 0.5, 2),
        (pytest.approx(0.85), 1.0, 2),
    ]
    assert brier([1.0, 0.5], [True, False]) == pytest.approx(0.125)


def test_risk_falls_with_the_coverage_of_a_good_confidence():
    coverage, risk = risk_coverage([0.9, 0.8, 0.8, 0.1], [True, True, False, False])
    np.testing.assert_allclose(coverage, [0.25, 0.75, 1.0])
    np.testing.assert_allclose(risk, [0.0, 1 / 3, 0.5])
    assert risk_coverage([], [])[0].size == 0


def test_rivals_are_judged_by_their_own_scores():
    true = with_confidence(outcome_of("ring of 6", told_as_true(scene_of("ring of 6"))), 0.9)
    answers = [[0.9, 1], [0.8, 0], [0.7, 1], None] + [[0.1, 0]] * 11
    record = Record(
        unit={"scenario": "ring of 6", "seed": 1}, result={"fpfh": answers, "kiss": [None] * 15}
    )
    other = Record(unit={"scenario": "hand", "seed": 1}, result=record.result)
    told = rivals.answers_by_tool([record, other], [true])
    assert [len(told[name]) for name in ("own", "fpfh", "kiss")] == [15, 14, 0]
    row = next(r for r in rivals.rival_table([record], [true]).splitlines() if "RANSAC" in r)
    assert "| 14 | 2 | 0.958 | 50 |" in row


def test_the_page_is_that_of_the_results():
    results = Results(DOCS)
    text = (DOCS / "trust.md").read_text(encoding="utf-8")
    assert page_text(text, results) == text, "run python -m benchmarks.trust --pages"


def test_the_page_says_what_was_not_measured(tmp_path: Path):
    text = page_text((DOCS / "trust.md").read_text(encoding="utf-8"), Results(tmp_path))
    assert text.count("Not measured yet.") == 7


def test_every_floor_of_the_page_stands_in_the_table():
    names = [floor.measure for floor in floors([])]
    assert len(names) == len(set(names)) == 10
    assert floors_module.MIN_AUC == 0.99


def test_scans_of_a_record_are_told_by_their_fields():
    scan = ScanOutcome.of(["3", 0, False, 1.0, "good", "wrong", False, 0.5, 9.0, 2.0, "why"])
    assert scan.is_good and scan.is_false and scan.rotation_deg == 9.0


def test_units_are_those_asked_for():
    units = Runs(scenarios=("ring of 6", "hand"), seeds=2).units(False)
    seeds = (FIRST_SEED, FIRST_SEED + 1)
    assert units == [{"scenario": n, "seed": k} for n in ("ring of 6", "hand") for k in seeds]
    every: list[Mapping[str, Any]] = list(Runs().units(False))
    assert len(every) == sum(scenario.seeds for scenario in SCENARIOS.values())
