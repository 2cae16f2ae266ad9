"""The examples do what they say."""

import re
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scanweld.app import job
from scanweld.evaluation.creature import creature
from scanweld.geometry.pose import Pose
from scanweld.io import read_poses
from tests.results import a_result

EXAMPLES = Path(__file__).parents[1] / "examples"


def output_of(name: str, capsys: pytest.CaptureFixture[str]) -> str:
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    return capsys.readouterr().out


def number(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    assert found is not None, text
    return float(found[1])


@pytest.mark.slow
def test_run_rendered(capsys: pytest.CaptureFixture[str]):
    text = output_of("00_run_rendered.py", capsys)
    assert text.startswith("good: 5 of 5 scans are placed")
    assert number(r"model.ply: (\d+) faces", text) > 5000


def test_one_pair(capsys: pytest.CaptureFixture[str]):
    text = output_of("01_one_pair.py", capsys)
    assert text.startswith("good: ")
    assert number(r"the best pose is (\S+) deg off", text) < 0.5


def test_own_format(capsys: pytest.CaptureFixture[str]):
    text = output_of("02_own_format.py", capsys)
    assert "viewpoint  given" in text and "viewpoint  estimated" in text


@pytest.mark.slow
def test_view_graph(capsys: pytest.CaptureFixture[str]):
    text = output_of("03_view_graph.py", capsys)
    assert len(re.findall(r"^scan_\d\d = scan_\d\d  good", text, re.MULTILINE)) >= 4
    assert len(re.findall(r"^component in the frame of ", text, re.MULTILINE)) == 1


def test_correct_and_resume(capsys: pytest.CaptureFixture[str]):
    text = output_of("04_correct_and_resume.py", capsys)
    assert re.match(r"first (good|doubtful): 4 scans are placed", text)
    assert number(r"(\d+) pieces of work were found again", text) == 4 + 6
    assert re.search(r"apart scan_\d\d scan_\d\d: contradicted", text)


def test_fuse_known_poses(capsys: pytest.CaptureFixture[str]):
    assert number(r"(\d+) faces", output_of("05_fuse_known_poses.py", capsys)) > 5000


def test_evaluate(capsys: pytest.CaptureFixture[str]):
    text = output_of("06_evaluate.py", capsys)
    assert "of 5 scans: 3 right, 1 wrong, 1 unplaced" in text


@pytest.mark.slow
@pytest.mark.parametrize(("off_deg", "code"), [(0.0, 0), (10.0, 3)])
def test_demo_succeeds_only_if_all_is_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, off_deg: float, code: int
):
    def run(*_: Any, **settings: Any) -> object:
        poses = dict(read_poses(tmp_path / "demo/scans/truth/poses.json").poses)
        poses["scan_03"] = poses["scan_03"] @ Pose.exp([off_deg / 57.3, 0, 0, 0, 0, 0])
        return replace(a_result(list(poses)), poses=poses)

    monkeypatch.setattr(job.pipeline, "run", run)
    demo = runpy.run_path(str(EXAMPLES / "demo.py"))["demo"]
    monkeypatch.setitem(demo.__globals__, "creature", lambda: creature(voxels=50))
    for _ in range(2 if code == 0 else 1):  # a second demo in the same folder replaces the first
        assert demo(tmp_path / "demo") == code
