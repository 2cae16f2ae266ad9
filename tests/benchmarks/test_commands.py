"""The commands of the benchmarks: their quick forms run without the data; floors, sets, seeds."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import depth, kept, model, pairs, run, trust
from benchmarks.blocks import rendered
from benchmarks.calibration import __main__ as calibration
from benchmarks.compare import difference
from benchmarks.judging import trial
from benchmarks.judging.page import seeds_of
from benchmarks.kept import Study, Unit, code_digest, warn_of_old_calibration
from benchmarks.results import ROOT, read_results, write_results
from benchmarks.seeds import FIRST_FRESH, PAGE, read_ledger, spent_among
from benchmarks.sets import SETS, make_set, moved_scans
from scanweld.confidence.model import read_calibration, stored_calibration
from scanweld.errors import InputError
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_scan
from tests.data import require_data

Command = Callable[..., Any]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Command:
    """Call a command with options, where there are no data; the result of its main function."""
    monkeypatch.setenv("SCANWELD_DATA", str(tmp_path / "no data"))

    def call(module: Any, *options: object) -> Any:
        monkeypatch.setattr("sys.argv", [module.__name__, *map(str, options)])
        return module.main()

    return call


def test_sets_run_quickly(command: Command, tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    out = tmp_path / "sets.json"
    assert command(run, "--quick", "--workers", 1, "--out", out) == 0
    (record,) = read_results(out)["records"]
    assert (record["right"], record["wrong"], len(record["scans"])) == (5, 0, 5)
    assert "| quick | 1 | 5/5 | 0 |" in capfd.readouterr().out


def test_pairs_run_quickly(command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out, plot = tmp_path / "pairs.json", tmp_path / "pairs.png"
    assert command(pairs, "--quick", "--workers", 1, "--out", out, "--plot", plot) == 0
    answers = read_results(out)["records"]
    assert len(answers) == 3 and sum(a["rank"] == 1 for a in answers) >= 2 and plot.exists()
    assert not any(a["kind"] == "good" and a["rank"] != 1 for a in answers)
    assert "| mixed | 0.15-1.00 |" in capsys.readouterr().out


def test_depth_runs_quickly(command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "depth.json"
    assert command(depth, "--quick", "--workers", 1, "--out", out) == 0
    (record,) = read_results(out)["records"]
    assert record["scans"] == 3 and record["good_and_wrong"] == 0 and record["iou"][0] > 0.93
    assert "| thing 0 | 3 |" in capsys.readouterr().out


def test_models_run_quickly(command: Command, tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    assert command(model, "--quick", "--workers", 1, "--out", tmp_path / "model.json") == 0
    records = read_results(tmp_path / "model.json")["records"]
    ours, single, right = (next(r for r in records if r.get(k) == v) for k, v in (
        ("model", "scanweld"), ("model", "single scans"), ("subject", "creature, true poses")
    ))  # fmt: skip
    assert ours["f_score"] > single["f_score"] and right["non_manifold"] == 0
    assert right["accuracy_90"] < model.FLOORS["virtual"]["accuracy_90"]
    assert "| creature | footprint |" in capfd.readouterr().out


def test_trust_runs_quickly_and_not_again(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    options = ("--quick", "--jobs", "1", "--out", tmp_path / "docs")
    command(trust, *options)
    page = (tmp_path / "docs/trust.md").read_text(encoding="utf-8")
    assert "| 64 pixels across | reported | 1 | 6 |" in page
    assert f"Seeds {FIRST_FRESH} to {FIRST_FRESH}: nothing was decided" in page
    assert page.count("Not measured yet.") == 2
    document = read_results(tmp_path / "docs/data/trust.json")
    assert document["code"] == code_digest(kept.TRUSTED)
    monkeypatch.setattr("benchmarks.judging.trial.try_out", lambda *_: pytest.fail("run again"))
    command(trust, *options)
    assert (tmp_path / "docs/trust.md").read_text(encoding="utf-8") == page
    # The same seeds for other code: they have been looked at.
    (tmp_path / "docs/data/trust.json").write_text(json.dumps({**document, "code": "other"}))
    with pytest.raises(InputError, match=f"seeds {FIRST_FRESH} to {FIRST_FRESH} were already"):
        command(trust, *options)


def test_calibration_runs_quickly(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    package = kept.CALIBRATION.read_bytes()
    command(calibration, "--quick", "--sets", 4, "--workers", 1, "--out", tmp_path / "docs")
    assert "4 sets of other objects" in capsys.readouterr().out
    learned = read_calibration((tmp_path / "docs/calibration.json").read_text(encoding="utf-8"))
    assert learned.made["code"] == code_digest(kept.CALIBRATED)
    assert not warn_of_old_calibration(learned)
    assert kept.CALIBRATION.read_bytes() == package


def test_an_old_calibration_is_told_of_in_one_line(caplog: pytest.LogCaptureFixture):
    text = json.loads(kept.CALIBRATION.read_text(encoding="utf-8"))
    text["made"] = {**stored_calibration().made, "code": "0123456789abcdef"}
    assert warn_of_old_calibration(read_calibration(json.dumps(text)))
    (record,) = caplog.records
    assert "older code" in record.message and "\n" not in record.message


def test_digests_know_of_all_code_and_of_the_calibration():
    for patterns in (kept.CALIBRATED, kept.COLLECTED, kept.COMPARED, kept.TRUSTED):
        assert code_digest(patterns)
    assert kept.CALIBRATION in {path for pattern in kept.TRUSTED for path in ROOT.glob(pattern)}
    with pytest.raises(ValueError, match="moved"):
        code_digest(("src/scanweld/moved/*.py",))


def test_a_recalibration_makes_kept_runs_stale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("benchmarks.results.ROOT", tmp_path)
    text = tmp_path / "src/scanweld/confidence/calibration.json"
    text.parent.mkdir(parents=True)
    (tmp_path / "src/scanweld/a.py").write_text("1")
    made: list[Unit] = []
    runs = trial.Runs(scenarios=("hand",), seeds=1)
    monkeypatch.setattr(trial.Runs, "measure", lambda self, unit: made.append(unit) or {})
    study = Study(
        out=tmp_path, work=tmp_path, workers=1, quick=False, command="", code=kept.TRUSTED[-1:]
    )
    for content, count in (("1", 1), ("1", 1), ("2", 2)):
        text.write_text(content)
        kept.measured(runs, study)
        assert len(made) == count


def test_results_say_what_measured_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("sys.argv", ["benchmarks/run.py", "--seeds", "3"])
    write_results(tmp_path / "a/b.json", [{"x": 1 / 3, "y": [None, 2]}])
    document = read_results(tmp_path / "a/b.json")
    assert document["records"] == [{"x": 0.333333, "y": [None, 2]}]
    assert document["command"] == "python -m benchmarks.run --seeds 3"
    assert "commit" in document


def test_the_ledger_has_what_was_spent():
    for seed in (0, 199, 511, 1011, 2000, 2999, 7000, 7001, 7101, 7102, 500_000, 500_199):
        assert spent_among([seed]), seed
    assert not spent_among([*range(FIRST_FRESH, FIRST_FRESH + 1000), 7002, 7100])
    told = rendered("trust-seeds", **seeds_of([2000, 2011]))
    assert "**They are spent**" in told and "41 of 48" in told and "1 of 422" in told
    with pytest.raises(ValueError, match="not a row"):
        read_ledger(PAGE.read_text(encoding="utf-8") + "\n| about 12 | tests | then | |\n")


def a_run(seed: int, **changes: Any) -> dict[str, Any]:
    told = {"set": "bunny4", "seed": seed, "right": 4, "wrong": 0, "verdict": "good"}
    errors = dict(rotation_mean=0.1, rotation_max=0.3, translation_mean=0.1, translation_max=0.2)
    return {**told, **errors, "seconds": 10.0, "cpu_seconds": 15.0, "peak_mb": 500.0, **changes}


def set_table(*runs: dict[str, Any]) -> str:
    return rendered("sets", **run.over_seeds(runs))


def test_one_bad_seed_fails_the_set():
    runs = a_run(0), a_run(1, rotation_max=0.4), a_run(2)
    assert all(SETS["bunny4"].is_met(each) for each in runs)
    table = set_table(*runs)
    assert "| bunny4 | 3 | 4/4 | 0 | 0.100 (0.5) | 0.400 (1) |" in table and "FAIL" not in table
    for change in ({"right": 3}, {"wrong": 1}, {"rotation_max": 1.1}, {"translation_max": 1.1}):
        bad = a_run(1, **change)
        assert not SETS["bunny4"].is_met(bad)
        assert set_table(a_run(0), bad, a_run(2)).count("FAIL") == 1
    failed = a_run(0, right=0, verdict="error", **dict.fromkeys(SETS["bunny4"].floors))
    assert not SETS["bunny4"].is_met(failed) and "**0/4 FAIL**" in set_table(failed)


def test_paired_differences():
    assert difference([(1.0, 2.0), (1.0, 4.0)]) == "+2 ± 1.41"
    assert difference([(None, 2.0)]) == "-"


def test_floors_of_pairs():
    def answer(score: float, rank: int | None) -> dict[str, Any]:
        errors = dict(rotation_deg=0.0, translation_percent=0.0, score=score, rank=rank)
        return {"anchors": "mixed", "overlap": 0.2, "kind": "good", "seconds": 0.1, **errors}

    answers = [answer(0.9, 1), answer(0.4, 1), answer(0.5, None), answer(0.1, None)]
    assert pairs.over_pairs(answers)["aucs"]["mixed"] == pytest.approx(0.75)
    assert np.isnan(pairs.over_pairs(answers[:2])["aucs"]["mixed"])
    good = [*(answer(0.9, 1) for _ in range(19)), answer(0.1, None)]
    assert pairs.are_floors_met(good)
    assert "FAIL" not in rendered("pairs-table", **pairs.over_pairs(good))
    for bad in ([*good, answer(0.1, None)], [*good[1:], answer(0.05, 1)]):
        assert not pairs.are_floors_met(bad)


def test_moved_scans_keep_their_truth():
    rng = np.random.default_rng(0)
    points, grid = rng.normal(size=(12, 3)), np.arange(12).reshape(3, 4)
    scans = [RangeScan(name=name, points=points, grid=grid) for name in ("a", "b")]
    world = {name: Pose.exp(rng.normal(size=6)) for name in ("a", "b")}
    for any_rotation in (False, True):
        moved, poses = moved_scans(scans, world, 3, any_rotation=any_rotation)
        for scan in moved:
            expected = world[scan.name].apply(points)
            np.testing.assert_allclose(poses[scan.name].apply(scan.points), expected, atol=1e-12)
        tilt = (world["a"].inverse() @ poses["a"]).rotation[2, 2]
        assert bool(tilt < 0.99) is any_rotation


def test_a_made_set_is_renamed_and_shuffled(tmp_path: Path):
    folder = require_data("stanford-bunny")
    truth = make_set(SETS["bunny4"], 1, tmp_path, folder.parent)
    assert sorted(truth.poses) == [f"scan_{k:02d}" for k in range(1, 5)]
    assert list(truth.originals.values()) != list(SETS["bunny4"].scans)
    assert truth.diameter == pytest.approx(0.27, abs=0.01)
    for name, original in truth.originals.items():
        made, source = read_scan(tmp_path / f"{name}.ply"), read_scan(folder / f"{original}.ply")
        np.testing.assert_array_equal(made.grid, source.grid)
        np.testing.assert_allclose(made.points.mean(axis=0), truth.centroids[name])
