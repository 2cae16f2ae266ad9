"""Speed: what is measured, what is made of it, and that the page says it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import clear, speed
from benchmarks.kept import Record
from benchmarks.results import DOCS, read_results
from benchmarks.seeds import spent_among

QUICK_ONLY = {"good": True, "score": 0.5, "margin": 0.9, "right": True}


def a_run(scans: int, loop: float = 1.0) -> dict[str, Any]:
    """Pairs grow with the square, the start not at all; a slow machine is slow at all of it."""
    stages = {"start": 1.0 * loop, "pairs": scans**2 * loop, "features": 0.0}
    cost = {"cpu": sum(stages.values()), "poses": stages["pairs"], "loop": loop, "quick": 8 * scans}
    return {"kind": "many", "name": str(scans), "scans": scans, "stages": stages, **cost}


def test_exponents_do_not_depend_on_how_slow_the_machine_was():
    runs = [a_run(10), a_run(40, 1.3), a_run(80, 0.7), a_run(200, 2.0)]
    found = speed.exponents(runs)
    assert found["pairs"] == found["poses"] == pytest.approx(2.0)
    assert found["start"] == pytest.approx(0.0) and found["pairs searched"] == pytest.approx(1.0)
    assert "features" not in found  # Nothing was spent
    assert found["whole"] == pytest.approx(2.0, abs=0.01)
    assert "whole" not in speed.exponents(runs[:2])  # One point has no slope


def test_the_median_run_is_the_one_beside_the_loop():
    runs = [{"cpu": 9.0, "loop": 1.0}, {"cpu": 8.0, "loop": 0.5}, {"cpu": 10.0, "loop": 1.0}]
    assert speed._median(runs) == {**runs[2], "range": [9.0, 16.0]}
    assert speed._median([{"error": "open3d cannot be loaded", "loop": 1.0}])["error"]


def a_pair(score: float, margin: float, *, right: bool, same: bool = True, sure: bool = True):
    pair = {"good": True, "score": score, "margin": margin, "right": right}
    return {**pair, "same": same, "thorough": {"good": sure, "right": right}}


def test_limits_count_what_is_clear_and_wrong():
    pairs = [
        *(a_pair(0.5, 0.9, right=True), a_pair(0.06, 0.9, right=False, sure=False)),
        *(a_pair(0.5, 0.45, right=False, same=False), a_pair(0.5, 0.65, right=False)),
        {**a_pair(0.9, 1.0, right=False), "good": False},
    ]
    records = [Record(unit={"thorough": of}, result={"pairs": pairs}) for of in ("good", "all")]
    found = clear.over_limits(records)
    told = {(a["score"], a["margin"]): (a["clear"], a["wrong"]) for a in found["limits"]}
    assert told[1.0, 1.0] == (8, 6) and told[2.0, 1.0] == (6, 4)
    assert told[2.0, 1.5] == (4, 2) and told[2.0, 2.0] == (2, 0)
    # What the thorough search asserts as well is not the shortcut's fault.
    first = found["limits"][0]
    assert (first["wrong_by_both"], first["other_pose"], first["not_sure"]) == (2, 2, 2)
    assert (first["both"], first["wrong_of_both"]) == (8, 6)
    assert (found["pairs"], found["pairs_of_all"], found["sure"]) == (10, 5, 4)
    alone = clear.over_limits([Record(unit={"thorough": "none"}, result={"pairs": [QUICK_ONLY]})])
    assert (alone["limits"][0]["clear"], alone["limits"][0]["both"], alone["sure"]) == (1, 0, 0)
    assert (found["sure_wrong"], found["sure_and_clear"]) == (3, 2)


def test_quick_runs_tell_stages_and_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SCANWELD_DATA", str(tmp_path / "no data"))
    words = ["speed", "--quick", "--out", str(tmp_path), "--parts", "sets", "small"]
    monkeypatch.setattr("sys.argv", words)
    assert speed.main() == 0
    records = {r["name"]: r for r in read_results(tmp_path / "data/speed.json")["records"]}
    run = records["quick"]
    assert (run["right"], run["wrong"], run["quick"]) == (5, 0, 10)
    assert {"start", "read", "pairs", "fuse", "report", "rest"} <= set(run["stages"])
    assert sum(run["stages"].values()) == pytest.approx(run["cpu"], rel=1e-4)
    assert min(run["stages"].values()) >= 0 and 0 < run["poses_mb"] <= run["peak_mb"]
    text = (tmp_path / "performance.md").read_text(encoding="utf-8")
    assert "| quick | 5 |" in text and "`scanweld --help`" in text
    assert "Open3D's multiway" not in text and "## What makes a pair clear" not in text


def test_the_page_is_that_of_its_results():
    document = read_results(DOCS / "data/speed.json")
    committed = (DOCS / "performance.md").read_text(encoding="utf-8")
    assert committed == speed.page(document), "run python -m benchmarks.speed --pages"
    assert np.isfinite([r["loop"] for r in document["records"] if "loop" in r]).all()
    assert json.dumps(document).count("/tmp") == 0


def test_the_seeds_of_clear_pairs_are_in_the_ledger():
    sets = {unit["seed"] for unit in clear.ClearPairs().units(quick=False)}
    assert all(spent_among([seed]) for seed in sets | {seed + 500_000 for seed in sets})
