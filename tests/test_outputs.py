"""What a run writes is what the documents promise: strict JSON, stable bytes, every name once."""

import dataclasses
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scanweld.app.json_text import json_text
from scanweld.app.outputs import graph_json, report_json, write_outputs
from scanweld.app.summary import summary
from scanweld.config import Config
from scanweld.errors import WriteError
from scanweld.io import read_mesh, read_poses
from scanweld.reconstruction import Reconstruction, Verdict
from tests.results import EVIDENCE, a_result, no_pair, turned

NAMES = ["scan_1", "scan_2", "scan_10"]


@pytest.fixture
def result() -> Reconstruction:
    result = a_result(NAMES, {"überzählig": "of another object", "a": "empty"}, Config(unit="mm"))
    return dataclasses.replace(result, pairs=(*result.pairs, no_pair("scan_10", "überzählig")))


def load(path: Path) -> Any:
    def refuse(word: str) -> None:
        pytest.fail(f"{path.name} holds {word}")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def test_all_files_are_there_and_strict(tmp_path: Path, result: Reconstruction):
    write_outputs(result, tmp_path)
    names = {"poses.json", "graph.json", "report.json", "config.toml", "model.ply"}
    assert {path.name for path in tmp_path.iterdir()} == names
    for name in ("poses.json", "graph.json", "report.json"):
        assert load(tmp_path / name)["format"] == 1
    assert (
        Config(**tomllib.loads((tmp_path / "config.toml").read_text(encoding="utf-8")))
        == result.config
    )
    assert np.array_equal(read_mesh(tmp_path / "model.ply").vertices, np.eye(3))


def test_poses(tmp_path: Path, result: Reconstruction):
    write_outputs(result, tmp_path)
    poses = load(tmp_path / "poses.json")
    assert set(poses) == {"format", "convention", "scans", "components", "unplaced"}
    assert "x_world = M x_scan" in poses["convention"]
    assert list(poses["scans"]) == NAMES
    assert poses["components"] == [NAMES]
    assert poses["unplaced"] == {"a": "empty", "überzählig": "of another object"}
    assert np.array_equal(poses["scans"]["scan_10"], turned(2).matrix())
    assert read_poses(tmp_path / "poses.json").components == (tuple(NAMES),)


def test_graph(result: Reconstruction):
    pairs = graph_json(result)["pairs"]
    keys = "i j kind accepted reason i_from_j score overlap evidence margin observability sliding "
    keys += "searched"
    for pair in pairs:
        assert set(pair) == {*keys.split(), "confidence", "grounds", "alternatives", "passed_over"}
    named = [("scan_1", "scan_2"), ("scan_1", "scan_10"), ("scan_10", "überzählig")]
    assert [(pair["i"], pair["j"]) for pair in pairs] == named
    assert pairs[0]["evidence"] == dataclasses.asdict(EVIDENCE)
    rival = {"i_from_j": turned(2).matrix().tolist(), "score": 0.1, "weight": 0.25}
    assert pairs[0]["alternatives"][1] == rival
    nothing = pairs[2]
    assert nothing["kind"] == "no overlap" and not nothing["accepted"]
    assert nothing["i_from_j"] is nothing["score"] is nothing["evidence"] is None


def test_report(result: Reconstruction):
    report = report_json(result)
    assert (report["verdict"], report["exit_code"]) == ("partial", 3)
    assert report["reasons"] == ["überzählig is not placed", "a is not placed"]
    assert list(report["scans"]) == ["a", *NAMES, "überzählig"]
    assert report["scans"]["a"]["verdict"] == "unplaced" and report["scans"]["a"]["reason"]
    assert report["stages"] == {"pairs": {"seconds": 1.235, "peak_mb": 100.1, "pairs": 3}}
    assert report["settings"]["unit"] == "mm" and report["settings"]["pairs"]["num_turns"] == 24


@pytest.mark.parametrize("verdict", Verdict)
def test_only_good_and_given_exit_with_zero(result: Reconstruction, verdict: Verdict):
    report = report_json(dataclasses.replace(result, verdict=verdict))
    assert report["exit_code"] == (0 if verdict in ("good", "given") else 3)


def test_numbers_that_are_not_finite_become_null(tmp_path: Path, result: Reconstruction):
    write_outputs(result, tmp_path)
    pair = load(tmp_path / "graph.json")["pairs"][2]
    assert pair["margin"] is None and pair["observability"] is None
    assert load(tmp_path / "report.json")["scans"]["scan_1"]["rms"] is None


def test_nothing_placed_gives_no_model(tmp_path: Path):
    write_outputs(a_result([], {"a": "x", "b": "y"}), tmp_path)
    assert not (tmp_path / "model.ply").exists()
    assert load(tmp_path / "poses.json")["scans"] == {}
    assert load(tmp_path / "report.json")["verdict"] == "nothing"


def test_order_of_the_records_does_not_change_the_bytes_and_a_folder_must_be_there(
    tmp_path: Path, result: Reconstruction
):
    backwards = dataclasses.replace(
        result,
        poses=dict(reversed(list(result.poses.items()))),
        unplaced=dict(reversed(list(result.unplaced.items()))),
        scans=dict(reversed(list(result.scans.items()))),
    )
    for folder, each in ((tmp_path / "a", result), (tmp_path / "b", backwards)):
        folder.mkdir()
        write_outputs(each, folder)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
    with pytest.raises(WriteError, match="cannot be written"):
        write_outputs(result, tmp_path / "missing")


def test_every_key_and_the_score_are_explained(result: Reconstruction):
    text = (Path(__file__).parents[1] / "docs/report.md").read_text(encoding="utf-8")
    report, pair = report_json(result), graph_json(result)["pairs"][0]
    for key in {*report, *report["scans"]["a"], *pair, *pair["evidence"]} - {"format", "i", "j"}:
        assert f"`{key}`" in text or key in ("scans", "stages"), key
    formula = re.search(r"\*\*Score\*\*: `([^`]*)`", text)
    assert formula is not None
    assert eval(formula[1], dataclasses.asdict(EVIDENCE)) == pytest.approx(EVIDENCE.score)


def test_json_text_is_readable_and_exact():
    value = {"a": [[1.0, 0.1 + 0.2], [-0.0, float("nan")]], "b": {}, "c": ['[ 1,  "2" ]'], "d": []}
    text = json_text(value)
    assert text == (
        '{\n "a": [\n  [1.0, 0.30000000000000004],\n  [0.0, null]\n ],\n "b": {},\n'
        ' "c": ["[ 1,  \\"2\\" ]"],\n "d": []\n}\n'
    )
    assert json.loads(text)["c"] == value["c"]


def test_summary_says_verdict_reasons_and_files(result: Reconstruction):
    lines = summary(result, Path("model")).splitlines()
    assert lines[0] == "partial: 3 of 5 scans are placed"
    assert "  unplaced a: empty" in lines and "  unplaced überzählig: of another object" in lines
    assert lines[-1].startswith("  model: model.ply (3 vertices), report.html")
    result = dataclasses.replace(a_result(NAMES), components=(("scan_1", "scan_2"), ("scan_10",)))
    lines = summary(result, Path("model")).splitlines()
    assert lines[0].endswith("in 2 separate components")
    assert "  component 2: scan_10" in lines
    text = summary(a_result([], {"a": "x", "b": "y"}), Path("model"))
    assert text.startswith("nothing: no two of the 2 scans") and "model.ply" not in text


def test_a_model_far_off_says_about_what_it_is_written(tmp_path: Path, result: Reconstruction):
    assert result.mesh is not None and "shift" not in report_json(result)
    far = result.mesh.vertices + np.array([450_000.0, 0.0, 0.0])
    away = dataclasses.replace(result, mesh=dataclasses.replace(result.mesh, vertices=far))
    write_outputs(away, tmp_path)
    assert np.array_equal(read_mesh(tmp_path / "model.ply").vertices, far)
    x, y, z = load(tmp_path / "report.json")["shift"]
    assert f"comment scanweld_shift {x:.0f} {y:.0f} {z:.0f}" in (
        (tmp_path / "model.ply").read_bytes().split(b"end_header")[0].decode()
    )
    assert f"model.ply is about a local origin, for the world lies far off: add {x:.0f} " in (
        summary(away, Path("model"))
    )


def test_no_confidence_at_all_is_the_least(tmp_path: Path):
    result = a_result(["a", "b"])
    scans = {
        name: dataclasses.replace(result.scans[name], confidence=confidence)
        for name, confidence in (("a", 0.5), ("b", 0.0))
    }
    text = summary(dataclasses.replace(result, scans=scans), tmp_path)
    assert "least sure b: confidence 0.000" in text
