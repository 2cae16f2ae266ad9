"""A run on whole frames: cut, noted, shown; and the commands that read its model again."""

import json
from pathlib import Path

import pytest

from scanweld.cut import mask_of
from scanweld.evaluation.turntable import DepthSensor, Shots, turntable
from scanweld.io import read_scan, write_scan_ply
from tests.command_line import COARSE, error_line, scanweld
from tests.html_pages import Page
from tests.scenes import small_creature
from tests.turntables import iou

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made() -> Shots:
    return turntable(small_creature(), (0.0, 25.0, 50.0), sensor=DepthSensor(wave=0.002, eaten=1.0))


@pytest.fixture(scope="module")
def frames(made: Shots, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    (folder / "frames").mkdir()
    for scan in made.scans:
        write_scan_ply(folder / "frames" / f"{scan.name}.ply", scan)
    (folder / "coarse.toml").write_text(COARSE)
    return folder / "frames"


@pytest.fixture(scope="module")
def model(frames: Path) -> Path:
    out, coarse = frames.parent / "model", frames.parent / "coarse.toml"
    assert scanweld("run", frames, "-o", out, "-q", "--config", coarse, "--no-cache") in (0, 3)
    return out


def test_each_scan_tells_what_was_kept_of_it(made: Shots, model: Path):
    report = json.loads((model / "report.json").read_text())
    assert report["stages"]["cut"]["cut"] == 3
    for scan, mask in zip(made.scans, made.masks, strict=True):
        told = report["scans"][scan.name]
        assert any(note.startswith("cut: table and background") for note in told["notes"])
        assert iou(mask_of(told["kept"]), mask) > 0.85
        assert told["num_points"] == mask_of(told["kept"]).sum()


def test_the_report_shows_it_and_comes_out_the_same_again(model: Path):
    before = (model / "report.html").read_bytes()
    page = Page(before.decode())
    shown = [found["alt"] for tag, found in page.elements if tag == "img"]
    assert [alt for alt in shown if alt.startswith("What was kept")] == [
        f"What was kept of {k:03d}" for k in range(3)
    ]
    assert scanweld("report", model) == 0
    assert (model / "report.html").read_bytes() == before


def test_exported_points_are_those_of_the_object(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    poses = json.loads((model / "poses.json").read_text())
    report = json.loads((model / "report.json").read_text())
    if len(poses["components"][0]) < 2:
        pytest.skip("no component to be exported")
    assert scanweld("export", model, "--points", "all.ply", "-o", "out") == 0
    points = read_scan(tmp_path / "out" / "all.ply").points
    names = poses["components"][0]
    assert len(points) == sum(report["scans"][name]["num_points"] for name in names)


def test_a_mask_that_does_not_fit_is_told(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    report = json.loads((model / "report.json").read_text())
    for text, told in (("3x3 4,1", "run scanweld again"), ("3x3 4,5", "give the same files")):
        for scan in report["scans"].values():
            scan["kept"] = text
        broken = tmp_path / f"model{len(text)}{told[0]}"
        broken.mkdir()
        for path in model.iterdir():
            (broken / path.name).write_bytes(path.read_bytes())
        (broken / "report.json").write_text(json.dumps(report))
        assert scanweld("report", broken, "--scans", model.parent / "frames") != 0
        assert told in error_line(capsys)


def test_moving_is_refused_in_one_line_and_nothing_is_written(
    frames: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    still = turntable(small_creature(), (0.0,) * 3)
    for scan in still.scans:
        write_scan_ply(tmp_path / f"{scan.name}.ply", scan)
    inputs = sorted(tmp_path.glob("*.ply"))
    code = scanweld("run", *inputs, "-o", tmp_path / "out", "--object", "moving", "-q")
    assert code == 1
    assert "nothing moved between the frames" in error_line(capsys)
    assert not (tmp_path / "out").exists()


def test_other_words_are_refused(frames: Path, tmp_path: Path):
    assert scanweld("run", frames, "-o", tmp_path / "out", "--object", "some") == 2
    assert not (tmp_path / "out").exists()
