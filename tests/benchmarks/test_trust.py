"""The trust benchmark's verdicts on verdicts: what it counts as wrong, floors, kept runs."""

from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.blocks import rendered
from benchmarks.judging import other_tools, page, trial
from benchmarks.judging.floors import Floor, floors, names_factor, real_sets
from benchmarks.judging.outcomes import Outcome, PairOutcome, ScanOutcome
from benchmarks.judging.page import Results, page_text
from benchmarks.judging.trial import Runs, judge, try_out
from benchmarks.kept import Record
from benchmarks.results import DOCS
from benchmarks.scores import Stated, bound
from benchmarks.seeds import FIRST_FRESH
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import BASIN, Scene, make_scene
from scanweld.errors import InputError
from scanweld.geometry.pose import Pose
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import Reconstruction, ScanReport, ScanVerdict
from tests.results import a_pair, a_result

CLEAN, FALSE = "ring of 6", "called good in a wrong basin"
TURN = Pose.exp([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])


@cache
def scene_of(name: str) -> Scene:
    return make_scene(SCENARIOS[name], 1)


def is_met(outcome: Outcome, measure: str) -> bool | None:
    return floor_of([outcome], measure).is_met


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


def one_moved() -> Reconstruction:
    """A clean run with one scan elsewhere, and still called good."""
    found = told_as_true(scene_of(CLEAN))
    return replace(found, poses={**found.poses, "scan_03": found.poses["scan_03"] @ TURN})


def with_confidence(outcome: Outcome, confidence: float) -> Outcome:
    """The same outcome, all that is placed stated with one confidence."""
    scans = tuple(s._replace(confidence=confidence) for s in outcome.scans)
    pairs = tuple(p and p._replace(confidence=confidence) for p in outcome.pairs)
    return replace(outcome, scans=scans, pairs=pairs)


def outcome_of(scenario: str, found: Reconstruction | None = None) -> Outcome:
    """How a run is judged, by default one that tells the truth."""
    scene = scene_of(scenario)
    scans, pairs = judge(found or told_as_true(scene), scene)
    return Outcome(scenario=scenario, seed=1, verdict="good", scans=scans, pairs=pairs, seconds=1.0)


def floor_of(outcomes: list[Outcome], measure: str) -> Floor:
    (found,) = (floor for floor in floors(outcomes) if measure in floor.measure)
    return found


def told(template: str, *outcomes: Outcome) -> str:
    make = {"trust-misses": page.misses, "trust-scenarios": page.by_scenario}
    return rendered(template, **make.get(template, page.by_kind)(outcomes))


def test_a_run_that_tells_the_truth_is_right():
    outcome = outcome_of(CLEAN)
    assert all(scan.is_right and scan.is_good and not scan.is_false for scan in outcome.scans)
    assert all(pair and pair.is_right for pair in outcome.pairs)
    assert is_met(outcome, "clean") and is_met(outcome, FALSE)
    assert told("trust-misses", outcome) == "None.\n"
    assert floor_of([outcome], "AUC").asked == ">= 0.99"
    names = [floor.measure for floor in floors([])]
    assert len(names) == len(set(names)) == 17


def test_a_wrong_scan_is_falsely_good_only_if_it_is_called_good():
    found = one_moved()
    outcome = outcome_of(CLEAN, found)
    assert [scan.is_false for scan in outcome.scans].count(True) == 1
    assert is_met(outcome, FALSE) is False and "| **1** |" in told("trust-scenarios", outcome)
    assert "**falsely good**" in told("trust-misses", outcome)
    doubtful = ScanReport(verdict=ScanVerdict.DOUBTFUL, reason="hardly fits")
    outcome = outcome_of(CLEAN, replace(found, scans={**found.scans, "scan_03": doubtful}))
    assert is_met(outcome, FALSE) and is_met(outcome, "clean") is False
    assert "1 of 6 not right" in told("trust-misses", outcome)


def test_what_is_a_little_farther_off_than_allowed_is_no_other_basin():
    near, far = (Pose.exp([0.0, 0.0, np.radians(turn), 0.0, 0.0, 0.0]) for turn in (6.0, 20.0))
    scene = scene_of(CLEAN)
    found = told_as_true(scene)
    middle = Pose(rotation=np.eye(3), translation=scene.centroids["scan_03"])
    for turn, is_inexact in ((near, True), (far, False)):
        about = middle @ turn @ middle.inverse()
        moved = replace(found, poses={**found.poses, "scan_03": found.poses["scan_03"] @ about})
        outcome = outcome_of(CLEAN, moved)
        (wrong,) = (scan for scan in outcome.scans if scan.is_false)
        assert wrong.is_inexact is is_inexact
        assert is_met(outcome, FALSE) is is_inexact
        assert is_met(outcome, "farther off than is allowed") is not is_inexact


def test_any_pose_of_a_symmetric_object_is_falsely_good_and_asserted_from_a_half_on():
    outcome = outcome_of("box")
    assert all(scan.is_false for scan in outcome.scans) and is_met(outcome, FALSE) is False
    assert not any(pair and pair.is_right for pair in outcome.pairs)
    assert is_met(with_confidence(outcome, 0.6), "pose asserted") is False
    assert is_met(with_confidence(outcome, 0.4), "pose asserted")
    clean = floor_of([with_confidence(outcome_of(CLEAN), 0.99)], "pose asserted")
    assert "0 of 0 scans" in clean.reached and clean.is_met is None
    # Only the scans that show the mark are determined.
    scene = scene_of("vase with a knob")
    assert 0 < len(scene.is_open) < len(scene.scans)
    assert sum(s.is_false for s in outcome_of("vase with a knob").scans) == len(scene.is_open)


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
    before, after = (outcome_of("mirrored scan", each) for each in (found, placed))
    assert is_met(before, "of another object") and is_met(after, "of another object") is False
    assert [p.is_right for p in after.pairs if p].count(False) == 1


def test_objects_are_right_in_one_component_each():
    scene = scene_of("two objects")
    one, other = told_as_true(scene, 0), told_as_true(scene, 1)
    scans = {name: found.scans[name] for found in (one, other) for name in found.poses}
    both = replace(one, poses={**one.poses, **other.poses}, scans=scans, unplaced={})
    apart = replace(both, components=(*one.components, *other.components))
    assert all(s.is_right for s in outcome_of("two objects", apart).scans)
    mixed = replace(both, components=(one.components[0] + other.components[0],))
    assert sum(s.is_false for s in outcome_of("two objects", mixed).scans) >= 6
    # Nor is what lies apart from its own object right.
    found = told_as_true(scene_of(CLEAN))
    names = found.components[0]
    outcome = outcome_of(CLEAN, replace(found, components=(names[:4], names[4:])))
    assert [scan.is_right for scan in outcome.scans] == [True] * 4 + [False] * 2
    assert not any(scan.is_false for scan in outcome.scans)


def test_a_pair_is_right_within_five_degrees():
    scene, found = scene_of(CLEAN), told_as_true(scene_of(CLEAN))
    centre, pose = scene.centroids[found.pairs[0].j], found.pairs[0].i_from_j
    assert pose is not None
    for degrees, is_right in ((4.0, True), (6.0, False)):
        turn = Pose.exp([0.0, 0.0, np.radians(degrees), 0.0, 0.0, 0.0])
        about = Pose(rotation=turn.rotation, translation=centre - turn.rotation @ centre)
        pairs = (replace(found.pairs[0], i_from_j=pose @ about), *found.pairs[1:])
        (pair, *_) = outcome_of(CLEAN, replace(found, pairs=pairs)).pairs
        assert pair is not None and pair.is_right is is_right


def test_a_factor_is_named_or_not():
    right = ("its scale differs: 1.010 times too large", "too large by 1.0 %, its scale is wrong")
    reasons = {**dict.fromkeys((*right, "scale 0.990"), True), "scale 1.05": False}
    for reason, is_named in {**reasons, "residual 1.010": False}.items():
        scan = ScanOutcome(source="0", world=0, is_open=False, factor=1.01, reason=reason)
        assert names_factor(scan) is is_named, reason


def test_outcomes_come_back_from_their_records():
    outcome = with_confidence(outcome_of(CLEAN, one_moved()), 0.25)
    again = Outcome.of({"scenario": CLEAN, "seed": 1}, outcome.record())
    assert again.record() == outcome.record() and again.pairs == outcome.pairs
    for kind in PairKind:
        pair = PairOutcome(0.125, kind, False, False, True)
        assert PairOutcome.of(pair.brief()) == pair
    scan = ScanOutcome(*["3", 0, False, 1.0, "good", "wrong", False, 0.5, 9.0, 2.0, "why"])
    assert scan.is_good and scan.is_false and scan.rotation_deg == 9.0


def test_runs_are_those_of_the_scenarios_from_the_first_fresh_seed_on():
    units = Runs(scenarios=(CLEAN, "hand"), seeds=2).units(False)
    seeds = (FIRST_FRESH, FIRST_FRESH + 1)
    assert units == [{"scenario": n, "seed": k} for n in (CLEAN, "hand") for k in seeds]
    thrice = Runs(scenarios=(CLEAN, "hand"), seeds=30, times=3).units(False)
    assert len(thrice) == 3 * SCENARIOS["hand"].seeds + 30 < 3 * (SCENARIOS[CLEAN].seeds + 8)
    assert len(Runs().units(False)) == sum(scenario.seeds for scenario in SCENARIOS.values()) >= 300


@pytest.mark.parametrize(
    ("error", "verdict"), [(InputError("too few"), "error"), (ZeroDivisionError("x"), "crash")]
)
def test_failed_runs_are_kept_as_such(
    monkeypatch: pytest.MonkeyPatch, error: Exception, verdict: str
):
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(trial, "run", fail)
    monkeypatch.setattr(trial, "make_scene", lambda *_: scene_of(CLEAN))
    outcome = try_out(CLEAN, 1)
    assert outcome.verdict == verdict and len(outcome.pairs) == 15
    assert is_met(outcome, "crash") is (verdict != "crash") and is_met(outcome, "clean") is False
    assert f"**{verdict}**" in told("trust-misses", outcome)


def test_the_worst_condition_is_told():
    true = outcome_of(CLEAN)
    lost = tuple(s._replace(standing="unplaced", verdict="unplaced") for s in true.scans[:2])
    bad = replace(true, scenario="hand", scans=lost + true.scans[2:])
    floor = floor_of([replace(true, scenario="table"), bad], "hard condition")
    assert floor.is_met is False and floor.reached == "least: hand, 67 %; 1 of 2 below"


def test_what_sensors_do_is_asked_to_be_right_and_not_doubted():
    true = replace(outcome_of(CLEAN), scenario="trimmed maps")
    measure = "trimmed maps: scans that are right and called good"
    assert is_met(true, measure) and floor_of([], measure).is_met is None
    doubted = tuple(s._replace(verdict="doubtful") for s in true.scans[:1])
    floor = floor_of([replace(true, scans=doubted + true.scans[1:])], measure)
    assert floor.is_met is False and floor.reached == "83.3 % of 6" and floor.asked == ">= 95 %"


def test_nobody_accuses_clean_scans_of_their_scale():
    measure, true = "accused of a wrong scale", replace(outcome_of(CLEAN), scenario="file: mesh")
    told = {"verdict": "doubtful", "reason": "its scale is off: 1.011 times too large"}
    for changes, is_fine in (({}, True), ({**told, "verdict": "good"}, True), (told, False)):
        scans = (true.scans[0]._replace(**changes), *true.scans[1:])
        assert is_met(replace(true, scans=scans), measure) is is_fine


def test_two_bodies_are_never_good_and_the_reason_names_them():
    measure = "not all moves as one body"
    for verdict, reason, told in (
        ("doubtful", "the camera did not move; what was laid together stood still", True),
        ("doubtful", "all of its scans are doubtful", False),
        ("good", "the camera did not move", False),
    ):
        run = replace(outcome_of(CLEAN), scenario="standing background")
        assert is_met(replace(run, verdict=verdict, reason=reason), measure) is told
    assert floor_of([outcome_of(CLEAN)], measure).is_met is None


def test_a_pose_is_right_within_the_limits_of_its_scene():
    scene, found = scene_of(CLEAN), told_as_true(scene_of(CLEAN))
    centre, pose = scene.centroids["scan_03"], found.poses["scan_03"]
    turn = Pose.exp([0.0, 0.0, np.radians(4.0), 0.0, 0.0, 0.0]).rotation
    moved = pose @ Pose(rotation=turn, translation=centre - turn @ centre)
    found = replace(found, poses={**found.poses, "scan_03": moved})
    for limits, num_right in ((scene.limits, 5), (BASIN, 6)):
        scans, _ = judge(found, replace(scene, limits=limits))
        assert sum(scan.is_right for scan in scans) == num_right


def test_kinds_of_pairs_are_counted_and_a_zero_is_told_with_its_bound():
    """Rates at which 0 of n runs has a chance of 5 % lie just below 3 / n."""
    table = told("trust-kinds", outcome_of(CLEAN), outcome_of("box"))
    assert "| good | 25 | 15 | 25 | 10 | 10 |" in table
    assert "| no overlap | 0 | 0 | 0 | 0 | 0 |" in table
    for count in (8, 40, 300):
        rate = 3 / count
        assert bound(count) == f"< {100 * rate:.2g} % of runs"
        assert 0.01 < (1 - rate) ** count < 0.05
    assert bound(3) == "too few runs for a bound"
    outcomes = [replace(outcome_of(CLEAN), seed=seed) for seed in range(30)]
    assert "(< 10 % of runs)" in floor_of(outcomes, FALSE).reached
    assert "| 450 | 0 (< 10 % of runs) |" in told("trust-kinds", *outcomes)
    crashed = [*outcomes, replace(outcomes[0], verdict="crash")]
    assert floor_of(crashed, "crash").reached == "1 of 31"


def test_real_sets_are_held_to_their_floors():
    errors = dict(rotation_mean=0.1, rotation_max=0.1, translation_mean=0.1, translation_max=0.1)
    run: dict[str, Any] = {"set": "bunny4", "right": 4, "wrong": 0, "verdict": "good", **errors}
    assert real_sets([run]).is_met
    for change in ({"right": 3}, {"wrong": 1}, {"rotation_max": 2.0}, {"verdict": "doubtful"}):
        assert real_sets([{**run, **change}]).is_met is False


def stated(scores: list[float], is_right: list[bool]) -> Stated:
    return Stated.of(zip(scores, is_right, strict=True))


def test_scores_of_known_answers():
    assert stated([0.7] * 10, [True] * 7 + [False] * 3).calibration_error(1) == pytest.approx(0.0)
    wrong_way = stated([1.0] * 5 + [0.0] * 5, [False] * 5 + [True] * 5)
    assert wrong_way.calibration_error(2) == 1.0 and wrong_way.auc == 0.0
    assert np.isnan(stated([], []).calibration_error()) and np.isnan(stated([], []).auc)
    low, high = stated([0.1, 0.2, 0.8, 0.9], [False, True, True, True]).bins(2)
    assert (low.confidence, low.right, low.count) == (pytest.approx(0.15), 0.5, 2)
    assert (high.confidence, high.right, high.count) == (pytest.approx(0.85), 1.0, 2)
    assert stated([1.0, 0.5], [True, False]).brier == pytest.approx(0.125)
    coverage, risk = stated([0.9, 0.8, 0.8, 0.1], [True, True, False, False]).risk_coverage()
    np.testing.assert_allclose(coverage, [0.25, 0.75, 1.0])
    np.testing.assert_allclose(risk, [0.0, 1 / 3, 0.5])
    assert stated([], []).risk_coverage()[0].size == 0


def test_other_tools_are_judged_by_their_own_scores():
    true = with_confidence(outcome_of(CLEAN), 0.9)
    answers = [[0.9, 1], [0.8, 0], [0.7, 1], None] + [[0.1, 0]] * 11
    unit = {"scenario": CLEAN, "seed": 1}
    record = Record(unit=unit, result={"fpfh": answers, "kiss": [None] * 15})
    other = Record(unit={"scenario": "hand", "seed": 1}, result=record.result)
    tools = other_tools.answers_by_tool([record, other], [true])
    assert [len(tools[name]) for name in ("own", "fpfh", "kiss")] == [15, 14, 0]
    assert tools["fpfh"].sure == pytest.approx(0.5)
    table = rendered("trust-rivals", tools=tools, titles=other_tools.TITLES)
    assert "| 14 | 2 | 0.958 | 50 |" in table


def test_the_page_is_that_of_the_results_and_says_what_was_not_measured(tmp_path: Path):
    text = (DOCS / "trust.md").read_text(encoding="utf-8")
    assert page_text(text, Results(DOCS)) == text, "run python -m benchmarks.trust --pages"
    assert page_text(text, Results(tmp_path)).count("Not measured yet.") == 8
