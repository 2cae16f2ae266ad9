"""Bookkeeping of Table 2, the ablations and the basins of convergence."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.paper.ablations import repeated
from benchmarks.paper.ablations_search import rescored
from benchmarks.paper.baselines.own import right_matches
from benchmarks.paper.pages import write_page
from benchmarks.paper.settings import (
    NUMERALS,
    SETTINGS,
    SWEEP,
    TUNED,
    Setting,
    azimuths_of,
    correspondence_rms,
    is_converged,
    outcome,
    scans_of,
    self_occlusion,
    start_poses,
    true_poses,
)
from benchmarks.paper.views import VirtualScan, known_pair, virtual_scan
from benchmarks.study.study import Record, Unit
from scanweld.config import HeatConfig
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.heat.features import describe

RIGHT = {"rotation_deg": 0.3, "translation_percent": 0.1, "rms_percent": 0.2}
WRONG = {"rotation_deg": 40.0, "translation_percent": 9.0, "rms_percent": 15.0}


@pytest.fixture(scope="module")
def pair() -> list[VirtualScan]:
    return scans_of(SETTINGS["quick"])


def some_pose() -> Pose:
    rng = np.random.default_rng(3)
    return Pose(rotation=random_rotation(rng), translation=rng.normal(size=3))


def test_rms_of_true_correspondences_is_that_of_a_known_motion():
    """A shift moves all points alike; a turn moves each by its distance from the axis."""
    rng = np.random.default_rng(1)
    points, true = rng.normal(size=(500, 3)), some_pose()
    shift = Pose(rotation=np.eye(3), translation=np.array([1.0, -2.0, 2.0]))
    assert correspondence_rms(true, shift @ true, points) == pytest.approx(3.0)
    turn = Pose(rotation=rotation_exp(np.array([0.0, 0.0, 0.2])), translation=np.zeros(3))
    from_axis = np.hypot(points[:, 0], points[:, 1])
    moved = 2 * np.sin(0.1) * np.sqrt(np.mean(from_axis**2))
    assert correspondence_rms(true, true @ turn, points) == pytest.approx(moved)


@pytest.mark.parametrize(("kind", "best"), [("simple", min), ("complex", max)])
def test_views_are_those_with_least_or_most_self_occlusion(kind: Any, best: Any):
    setting = Setting("creature", 90, 2, kind)
    rings: list[tuple[float, ...]] = [(float(a), float((a + 90) % 360)) for a in range(0, 360, 15)]
    hidden = {ring: sum(self_occlusion("creature", a) for a in ring) for ring in rings}
    assert azimuths_of(setting) in rings
    assert hidden[azimuths_of(setting)] == best(hidden.values())
    assert min(hidden.values()) < max(hidden.values())


def test_starts_are_off_by_the_angle_about_the_middle_and_leave_the_first_view(
    pair: list[VirtualScan],
):
    true = true_poses(pair)
    start, again = start_poses(pair, 20, seed=4), start_poses(pair, 20, seed=4)
    assert np.array_equal(start[0].matrix(), true[0].matrix())
    off = true[1].inverse() @ start[1]
    assert off.angle_deg() == pytest.approx(20)
    assert off.shift_at(pair[1].centre()) == pytest.approx(0, abs=1e-9 * pair[1].diameter)
    assert np.array_equal(start[1].matrix(), again[1].matrix())
    other = start_poses(pair, 20, seed=5)
    assert (start[1].inverse() @ other[1]).angle_deg() > 1


def test_outcome_does_not_depend_on_the_frame_of_the_poses(pair: list[VirtualScan]):
    """Truth is truth in any world; a view 3 degrees off is told as that, and is not converged."""
    world = some_pose()
    at_truth = {k: world @ scan.world_from_sensor for k, scan in enumerate(pair)}
    told = outcome(pair, [(0, 1)], at_truth)
    assert is_converged(told)
    assert told["rms_percent"] < 1e-6
    turned = {k: world @ pose for k, pose in start_poses(pair, 3.0, seed=0).items()}
    told = outcome(pair, [(0, 1)], turned)
    assert told["rotation_deg"] == pytest.approx(3)
    assert told["translation_percent"] < 1e-6 < told["rms_percent"]
    assert not is_converged(told)


def record(numeral: str, method: str, runs: list[dict[str, Any]], noise: float = 0.0) -> Record:
    unit: Unit = {"part": "final", "setting": numeral, "noise": noise, "method": method}
    result = {"azimuths_deg": [0.0, 90.0], "diameter": 200.0, "runs": runs}
    return Record(unit=unit, result=result)


def runs_of(num_right: int, num: int, right: Mapping[str, float] = RIGHT) -> list[dict[str, Any]]:
    return [
        {"start": 40, "seed": seed, **(right if seed < num_right else WRONG)} for seed in range(num)
    ]


def seven(changed: Mapping[tuple[str, str], list[dict[str, Any]]]) -> list[Record]:
    """Records that meet every floor, but for what is changed."""
    fine = {**RIGHT, "rms_percent": 0.02}
    usual = {
        "m-icc": runs_of(2, 4),
        "mm-icc": runs_of(4, 4),
        "joint": runs_of(0, 4),
        "default": [{"start": "none", "seed": 0, **fine}],
    }
    return [
        record(numeral, method, changed.get((numeral, method), runs))
        for numeral in NUMERALS
        for method, runs in usual.items()
    ]


def floors_of(records: list[Record], out: Path) -> list[str]:
    """The verdicts, in the order of the page."""
    text = write_page("table2", records, out, quick=True).split("## Floors")[1]
    return [line.split("|")[3].strip() for line in text.splitlines() if line.startswith("| 0 %")]


def test_floors_of_table2_name_the_settings_that_fail(tmp_path: Path):
    assert floors_of(seven({}), tmp_path) == ["pass"] * 4
    even = seven({("iii", "m-icc"): runs_of(4, 4), ("i", "m-icc"): runs_of(4, 4)})
    assert floors_of(even, tmp_path) == [
        "pass",
        "**FAIL** in iii (4/4 against 4/4)",
        "pass",
        "pass",
    ]
    worse = floors_of(seven({("iv", "mm-icc"): runs_of(1, 4)}), tmp_path)
    assert worse == ["**FAIL** in iv (1/4 against 2/4)", "pass", "pass", "pass"]
    coarse_default = [{"start": "none", "seed": 0, **RIGHT, "rms_percent": 0.19}]
    poor = floors_of(seven({("v", "default"): coarse_default}), tmp_path)
    assert poor == ["pass", "pass", "pass", "**FAIL** in v"]


def test_a_default_that_does_not_place_all_views_has_no_rms_and_fails(tmp_path: Path):
    unplaced = seven({("ii", "default"): [{"start": "none", "seed": 0}]})
    assert floors_of(unplaced, tmp_path)[2:] == ["**FAIL** in ii", "**FAIL** in ii"]
    assert "| 0/1: - |" in write_page("table2", unplaced, tmp_path, quick=True)


def test_the_sweep_says_when_another_tuning_does_better(tmp_path: Path):

    def swept(num_used: int, num_other: int) -> str:
        units = [
            ({"part": "sweep", "setting": "i", "method": method, "seeds": 4, **tuning}, num)
            for method in SWEEP
            for tuning, num in (
                (TUNED[method], num_used),
                ({**TUNED[method], "renders": 30}, num_other),
            )
        ]
        result = {"azimuths_deg": [0.0], "diameter": 200.0}
        sweep = [Record(unit=u, result={**result, "runs": runs_of(n, 4)}) for u, n in units]
        return write_page("table2", [*seven({}), *sweep], tmp_path, quick=True)

    assert "MM-ICC takes the bold setting; no other does better" in swept(3, 3)
    assert "30" in swept(2, 3).split("MM-ICC takes the bold setting; ")[1].split("does better")[0]


def test_rescoring_ranks_kept_poses_anew():
    """A wrong pose that agrees more but lies in front of what was seen: only violations tell."""
    right = {"deg": 0.1, "percent": 0.1, "agree": 0.3, "front": 0.0, "contradict": 0.0, "free": 0.0}
    wrong = {"deg": 90.0, "percent": 30.0, "agree": 0.4, "front": 0.2, "contradict": 0.0, "free": 0}
    records = [Record(unit={}, result={"mixed": [right, wrong]})]
    assert rescored(records, "as it stands") == ([True], 1.0)
    assert rescored(records, "without free space") == ([True], 1.0)
    assert rescored(records, "agreement alone") == ([False], 0.0)
    none = [Record(unit={}, result={"mixed": []})]
    assert rescored(none, "as it stands")[0] == [False]


def test_keypoints_of_the_same_view_repeat_and_match_themselves_those_of_another_beat_chance():
    view = virtual_scan("creature", 135.0)
    found = describe(view.scan, HeatConfig())
    right, asked, by_chance = repeated(known_pair(view, view), (found, found))
    assert asked == 2 * len(found) > 0
    assert right == asked > by_chance > 0
    other = virtual_scan("creature", 165.0)
    both = known_pair(view, other)
    right, _, by_chance = repeated(both, (found, describe(other.scan, HeatConfig())))
    assert right > 1.2 * by_chance > 0
    right, asked, by_chance = right_matches(Pose.identity(), found, found, 0.06 * view.diameter)
    assert right == asked == len(found)
    assert 0 < by_chance < asked


def test_basins_count_the_default_alike_from_every_start(tmp_path: Path):
    right, wrong = {"deg": 0.1, "percent": 0.1}, {"deg": 30.0, "percent": 10.0}
    answers = {"5": {"icp": right, "joint": right}, "40": {"icp": wrong, "joint": wrong}}
    unit = {"object": "creature", "gap": 60, "azimuth": 0}
    records = [
        Record(unit=unit, result={"answers": answers, "default": right}),
        Record(unit=unit, result={"answers": {**answers, "40": answers["5"]}, "default": wrong}),
    ]
    text = write_page("basins", records, tmp_path, quick=True)
    assert "| ICP | 2/2 0.10 | 1/2 0.10 |" in text
    assert "| default | 1/2 0.10 | 1/2 0.10 |" in text
    assert (tmp_path / "basins.png").stat().st_size > 0
