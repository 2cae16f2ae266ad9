"""What a run tells as it goes on: events, bars, lines, and JSON for programs."""

import io
import json
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import pytest
from rich.console import Console

import scanweld
from scanweld.app.json_lines import EVENTS, event_line
from scanweld.app.progress import Drawing, bars_on
from scanweld.config import Config, FusionConfig
from scanweld.evaluation.primitives import box
from scanweld.evaluation.views import view_of
from scanweld.geometry.scan import RangeScan
from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import (
    Event,
    ScanRefused,
    StageAdvanced,
    StageFinished,
    StageStarted,
    telling,
)
from tests.command_line import COARSE
from tests.command_line import scanweld as command
from tests.scenes import creature_scene, scene_of, write_scans

ESCAPE = "\x1b"
Told = list[dict[str, object]]


def coarse_scans() -> list[RangeScan]:
    """Three neighbouring scans, one in another unit, the first once more, and another object."""
    scans = list(creature_scene(8, pixels=80.0).scans[:3])
    other = box()
    stranger = scene_of(other, [view_of(other, 30, 25, pixels=60)]).scans[0]
    return [
        *scans,
        replace(scans[0], name="large", points=1000 * scans[0].points),
        replace(scans[0], name="twice"),
        replace(stranger, name="zz_stranger"),
    ]


@pytest.fixture(scope="module")
def told_run() -> tuple[list[Event], Reconstruction]:
    """What a run told, and what came out."""
    told: list[Event] = []
    config = Config(fusion=FusionConfig(max_voxels_across=60))
    result = scanweld.run(coarse_scans(), config, workers=1, progress=told.append)
    return told, result


def refused(events: Sequence[Event]) -> dict[str, str]:
    return {event.scan: event.reason for event in events if isinstance(event, ScanRefused)}


@pytest.mark.slow
def test_stages_start_and_finish_in_turn_and_scans_are_refused_as_it_happens(
    told_run: tuple[list[Event], Reconstruction],
):
    events, result = told_run
    current, done, finished = "", 0, []
    for event in events:
        match event:
            case StageStarted():
                assert not current
                current, done = event.stage, 0
            case StageAdvanced():
                assert event.stage == current and event.done == done + 1 <= event.total
                done = event.done % event.total
            case StageFinished():
                assert event.stage == current and done == 0 and event.seconds >= 0
                finished.append(event.stage)
                current = ""
            case ScanRefused():
                pass
    found = "prepare", "lay out", "pairs", "features", "search", "sensor", "graph", "refine"
    assert tuple(finished) == (*found, "confidence", "fuse")
    pairs = next(e for e in events if isinstance(e, StageFinished) and e.stage == "pairs")
    assert pairs.counts == {"pairs": 6, "placed": 3}
    told = refused(events)
    assert told == dict(result.unplaced) and {"large", "twice"} <= set(told)
    assert sum(isinstance(event, ScanRefused) for event in events) == len(told)
    prepared = next(k for k, e in enumerate(events) if isinstance(e, StageFinished))
    assert {"large", "twice"} <= set(refused(events[:prepared]))


def test_the_library_says_nothing_itself(capsys: pytest.CaptureFixture[str]):
    scanweld.run(coarse_scans()[:2], Config(), workers=1, progress=lambda event: None)
    assert capsys.readouterr() == ("", "")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Scans, one of them broken, and settings for a coarse model of the others."""
    monkeypatch.chdir(tmp_path)
    folder = write_scans(tmp_path / "scans", coarse_scans()[:2])
    (folder / "broken.ply").write_text("not a scan")
    Path("coarse.toml").write_text(COARSE)
    return folder


@pytest.mark.slow
def test_json_is_one_object_a_line_and_ends_with_the_verdict(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    coarse = "--workers", "1", "--config", "coarse.toml"
    code = command("run", folder, "-o", "model", "--json", *coarse)
    out, err = capsys.readouterr()
    lines: Told = [json.loads(line) for line in out.splitlines()]
    assert err == "" and lines[0] == {"event": "stage_started", "stage": "read"}
    end = lines.pop()
    report = json.loads(Path("model/report.json").read_text(encoding="utf-8"))
    assert end["event"] == "finished" and end["exit_code"] == code == 3
    assert all(end[key] == report[key] for key in ("verdict", "exit_code", "reasons"))
    assert (end["scans"], end["output"]) == (3, "model")
    assert {line["event"] for line in lines} == set(EVENTS.values())
    names = [line["stage"] for line in lines if line["event"] == "stage_finished"]
    assert names[0] == "read" and names[-1] == "report"
    (told,) = (line for line in lines if line.get("scan") == "broken")
    assert "broken.ply" in str(told["reason"])
    assert lines.index(told) < lines.index({"event": "stage_started", "stage": "prepare"})
    # The poses that were found, fused: the same words.
    fuse = "fuse", folder, "--poses", "model/poses.json", "--config", "coarse.toml"
    assert command(*fuse, "-o", "fused", "--json") == 3
    again = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert again[-1]["event"] == "finished" and again[-1]["verdict"] == "partial"
    assert "broken" in {line.get("scan") for line in again}
    # And told to nobody.
    kept = sorted(Path(".scanweld-cache").iterdir())
    assert command(*fuse, "-o", "quiet", "-q") == 3
    assert capsys.readouterr().err == ""
    # From what was kept, which gives the same model.
    assert sorted(Path(".scanweld-cache").iterdir()) == kept
    assert Path("quiet/model.ply").read_bytes() == Path("fused/model.ply").read_bytes()


def test_an_error_is_a_line_on_stderr_and_no_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "scans").mkdir()
    for name in "ab":
        (tmp_path / "scans" / f"{name}.ply").write_text("not a scan")
    assert command("run", tmp_path / "scans", "-o", tmp_path / "model", "--json") == 1
    out, err = capsys.readouterr()
    events = [json.loads(line)["event"] for line in out.splitlines()]
    assert "finished" not in events and events.count("scan_refused") == 2
    assert err.startswith("scanweld: error: ") and err.count("\n") == 1


@pytest.mark.slow
def test_without_a_terminal_there_are_plain_lines(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert command("run", folder, "-o", "model", "--workers", "1", "--config", "coarse.toml") == 3
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert ESCAPE not in out + err and all(line.startswith("scanweld: ") for line in lines)
    assert [line for line in lines if "refused broken" in line] == lines[:1]
    assert any(line.startswith("scanweld: pairs: pairs 1, placed ") for line in lines)


def test_on_a_terminal_there_is_a_bar_for_each_stage():
    paper = io.StringIO()
    console = Console(file=paper, force_terminal=True, width=100, color_system=None)
    with bars_on(console) as bars:
        draw = Drawing(bars)
        draw(StageStarted(stage="pairs"))
        draw(StageAdvanced(stage="pairs", done=3, total=45))
        bars.refresh()
        assert "pairs" in paper.getvalue() and "3/45" in paper.getvalue()
        draw(ScanRefused(scan="[b]x", reason="[red]no[/red] surface"))
        draw(StageFinished(stage="pairs", seconds=2.0, counts={"pairs": 45}))
        draw(StageStarted(stage="graph"))
    text = paper.getvalue()
    assert "refused [b]x: [red]no[/red] surface\n" in text
    last = text[text.rindex("refused") :]
    assert "pairs 45" in last and "graph" in last


def test_every_event_is_documented():
    told = (Path(__file__).parents[1] / "docs/report.md").read_text(encoding="utf-8")
    rows = {row.split("|")[1].strip(): row for row in told.splitlines() if row.startswith("|")}
    for kind, name in EVENTS.items():
        row = rows[f"`{name}`"]
        assert all(f"`{field.name}`" in row for field in fields(kind))


def test_names_of_any_kind_are_json():
    name = "a\nb\udcff\u2028"
    line = event_line(ScanRefused(scan=name, reason='"no"'))
    assert "\n" not in line and line.isascii()
    assert json.loads(line) == {"event": "scan_refused", "scan": name, "reason": '"no"'}


def test_a_stage_that_fails_is_told_to_be_over():
    events: list[Event] = []
    with pytest.raises(RuntimeError), telling(events.append, "fuse"):
        raise RuntimeError
    assert [type(event) for event in events] == [StageStarted, StageFinished]
