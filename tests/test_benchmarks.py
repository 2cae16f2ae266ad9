"""The benchmark's own bookkeeping: floors, paired differences, sets that keep their truth."""

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_scan
from tests.data import require_data

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch):
    """Import a benchmark module the way a script does, from its own folder."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))

    def import_module(name: str) -> ModuleType:
        return importlib.import_module(name)

    yield import_module
    for name in ("sets", "run", "compare", "pairs", "results"):
        sys.modules.pop(name, None)


def a_run(seed: int, **changes: Any) -> dict[str, Any]:
    run = {
        "set": "bunny4",
        "seed": seed,
        "right": 4,
        "wrong": 0,
        "verdict": "good",
        "rotation_mean": 0.1,
        "rotation_max": 0.3,
        "translation_mean": 0.1,
        "translation_max": 0.2,
        "seconds": 10.0,
        "cpu_seconds": 15.0,
        "peak_mb": 500.0,
    }
    return {**run, **changes}


def test_floors_that_are_met(load: Any):
    lines, is_passed = load("run").table([a_run(0), a_run(1, rotation_max=0.4), a_run(2)])
    assert is_passed
    assert "| bunny4 | 3 | 4/4 | 0 | 0.100 (0.5) | 0.400 (1) |" in lines[2]
    assert "FAIL" not in "".join(lines)


@pytest.mark.parametrize(
    "changes",
    [{"right": 3}, {"wrong": 1}, {"rotation_max": 1.1}, {"translation_max": 1.1}],
    ids=["right", "wrong", "rotation", "translation"],
)
def test_one_bad_seed_fails_the_set(load: Any, changes: dict[str, float]):
    lines, is_passed = load("run").table([a_run(0), a_run(1, **changes), a_run(2)])
    assert not is_passed
    assert lines[2].count("FAIL") == 1


def test_a_failed_run_has_no_errors_and_fails(load: Any):
    nothing = dict.fromkeys(
        ("rotation_mean", "rotation_max", "translation_mean", "translation_max")
    )
    lines, is_passed = load("run").table([a_run(0, right=0, verdict="error", **nothing)])
    assert not is_passed
    assert "**0/4 FAIL**" in lines[2]


def test_paired_differences(load: Any):
    difference = load("compare")._difference
    assert difference([(1.0, 2.0), (1.0, 4.0)]) == "+2 ± 1.41"
    assert difference([(None, 2.0)]) == "-"


def test_auc_counts_right_above_wrong(load: Any):
    pairs = load("pairs")

    def answer(score: float, rank: int | None) -> Any:
        return pairs.Answer(
            anchors="mixed", object="o", seed=0, i="i", j="j", overlap=0.2, gap_deg=30.0,
            kind="good", rotation_deg=0.0, translation_percent=0.0, score=score, evidence={},
            margin=1.0, observability=1.0, rank=rank, seconds=0.1,
        )  # fmt: skip

    answers = [answer(0.9, 1), answer(0.4, 1), answer(0.5, None), answer(0.1, None)]
    assert pairs.auc(answers) == pytest.approx(0.75)
    assert np.isnan(pairs.auc(answers[:2]))


def test_moved_scans_keep_their_truth(load: Any):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(12, 3))
    grid = np.arange(12).reshape(3, 4)
    scans = [RangeScan(name=name, points=points, grid=grid) for name in ("a", "b")]
    world = {name: Pose.exp(rng.normal(size=6)) for name in ("a", "b")}
    for any_rotation in (False, True):
        moved, poses = load("sets").moved_scans(scans, world, 3, any_rotation=any_rotation)
        for scan in moved:
            expected = world[scan.name].apply(points)
            np.testing.assert_allclose(poses[scan.name].apply(scan.points), expected, atol=1e-12)
        tilt = (world["a"].inverse() @ poses["a"]).rotation[2, 2]
        assert bool(tilt < 0.99) is any_rotation


def test_a_made_set_is_renamed_and_shuffled(load: Any, tmp_path: Path):
    folder = require_data("stanford-bunny")
    sets = load("sets")
    truth = sets.make_set(sets.SETS["bunny4"], 1, tmp_path, folder.parent)
    assert sorted(truth.poses) == [f"scan_{k:02d}" for k in range(1, 5)]
    assert list(truth.originals.values()) != list(sets.SETS["bunny4"].scans)
    assert truth.diameter == pytest.approx(0.27, abs=0.01)
    for name, original in truth.originals.items():
        made, source = read_scan(tmp_path / f"{name}.ply"), read_scan(folder / f"{original}.ply")
        np.testing.assert_array_equal(made.grid, source.grid)
        np.testing.assert_allclose(made.points.mean(axis=0), truth.centroids[name])
