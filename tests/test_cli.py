"""The command line as users meet it: exit codes, streams, and what is left on disk."""

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scanweld.app import job
from scanweld.app.cache import cache_folder
from scanweld.app.cli import main
from scanweld.app.options import takes
from scanweld.app.workspace import work_folder
from scanweld.errors import InputError
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet, write_mesh_ply, write_poses
from scanweld.io.ply_write import write_scan_ply
from tests.command_line import error_line, scanweld
from tests.results import a_result, stub_run, turned
from tests.scenes import PRIMITIVES

PAGE = "report.html"


@pytest.fixture(autouse=True)
def seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """Neither the pipeline nor the page take their time; what the pipeline was asked for."""
    settings: dict[str, Any] = {}

    def run(*arguments: Any, **given: Any) -> object:
        settings.update(given)
        return stub_run(*arguments, **given)

    monkeypatch.setattr(job.pipeline, "run", run)
    monkeypatch.setattr(job, "write_html_report", lambda folder, *_: (folder / PAGE).touch())
    monkeypatch.chdir(tmp_path)
    return settings


@pytest.fixture(scope="module")
def scan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    mesh = PRIMITIVES["box"]()
    view = view_of(mesh, 30, 25, pixels=40)
    path = tmp_path_factory.mktemp("scan") / "box.ply"
    write_scan_ply(path, scan_mesh(mesh, view.camera, view.world_from_sensor))
    return path


@pytest.fixture
def scans(scan_file: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    folder.mkdir()
    for name in ("a", "b", "c"):
        shutil.copy(scan_file, folder / f"{name}.ply")
    return folder


def report() -> Any:
    """The report of the output that tests write most."""
    return json.loads(Path("model/report.json").read_text(encoding="utf-8"))


def fail_with(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*arguments: Any, **settings: Any) -> None:
        stub_run(*arguments, **settings)
        raise error

    monkeypatch.setattr(job.pipeline, "run", run)


def test_run_writes_the_output_and_a_summary(scans: Path, capsys: pytest.CaptureFixture[str]):
    assert scanweld("run", scans, "-o", "model") == 0
    out, err = capsys.readouterr()
    assert out.startswith("good: all 3 scans are placed") and "model.ply" in out
    assert "error" not in err
    names = {"config.toml", "graph.json", "model.ply", "poses.json", "report.html", "report.json"}
    assert {path.name for path in Path("model").iterdir()} == names
    assert not work_folder(Path("model")).exists()


def test_files_patterns_and_folders_are_the_same(scans: Path):
    files = [scans / f"{name}.ply" for name in "cab"]
    for k, inputs in enumerate(([scans], files, [scans / "*.ply"], [scans, files[0]])):
        assert scanweld("run", *inputs, "-o", f"m{k}") == 0
        assert Path(f"m{k}/poses.json").read_bytes() == Path("m0/poses.json").read_bytes()


def test_options_reach_the_settings(scans: Path, seen: dict[str, Any]):
    Path("my.toml").write_text("[pairs]\nnum_turns = 36\n[fusion]\nsmooth = 7\n")
    options = ["--config", "my.toml", "--unit", "mm", "--workers", "2"]
    options += ["--holes", "carve", "--component", "largest", "--watertight", "--faces", "500"]
    assert scanweld("run", scans, "-o", "model", *options) == 0
    settings = report()["settings"]
    assert (settings["unit"], settings["pairs"]["num_turns"]) == ("mm", 36)
    fusion = {"holes": "carve", "component": "largest", "watertight": True, "faces": 500}
    assert {**fusion, "smooth": 7}.items() <= settings["fusion"].items()
    assert seen["workers"] == 2


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["run"],
        ["run", "scans"],
        ["run", "-o", "model"],
        ["run", "scans", "-o", "model", "--nonsense"],
        ["run", "scans", "-o", "model", "--workers", "0"],
        ["run", "scans", "-o", "model", "--workers", "two"],
        ["run", "scans", "-o", "model", "--seed", "5"],  # a run has nothing random
        ["simulate", "mesh.ply", "-o", "out", "--seed", "-1"],
        ["run", "scans", "-o", "model", "--unit", "foo"],
        ["run", "scans", "-o", "model", "--method", "nonsense"],
        ["run", "scans", "-o", "model", "--holes", "some"],
        ["run", "scans", "-o", "model", "--faces", "3"],
        ["nonsense"],
        ["info"],
        ["simulate", "mesh.ply"],
        ["simulate", "mesh.ply", "-o", "out", "--camera", "fisheye"],
        ["simulate", "mesh.ply", "-o", "out", "--num-scans", "1"],
        ["evaluate", "poses.json"],
    ],
)
def test_usage_errors_exit_with_2(
    scans: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
):
    assert scanweld(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and "Error" in err and "Traceback" not in err
    if "--method" in arguments:
        assert "robust" in err and "paper" in err  # the two there are
    assert [path.name for path in Path().iterdir()] == ["scans"]


def test_the_method_may_come_from_the_settings_or_the_command(scans: Path):
    Path("my.toml").write_text("method = 'paper'\n")
    for method, options in (
        ("paper", ["--config", "my.toml"]),
        ("paper", ["--method", "paper"]),
        ("robust", ["--config", "my.toml", "--method", "robust"]),
    ):
        assert scanweld("run", scans, "-o", "model", "--force", *options) == 0
        assert report()["settings"]["method"] == method


def test_facts_reach_the_run(scans: Path, seen: dict[str, Any]):
    Path("facts.json").write_text('{"apart": [["c", "b"]], "fix": ["c"]}')
    write_poses("p.json", PoseSet(poses={"a": turned(1)}, components=(("a",),)))
    together = ["--together", "b", "a", "--together", "c", "a"]
    options = ["--fix", "a", "--start", "p.json", *together, "--turntable"]
    assert scanweld("run", *options, scans, "-o", "model", "--knowledge", "facts.json") == 0
    known = seen["knowledge"]
    assert known.fix == ("c", "a") and known.turntable
    assert known.together == (("a", "b"), ("a", "c")) and known.apart == (("b", "c"),)
    assert np.array_equal(known.start.poses["a"].matrix(), turned(1).matrix())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--fix", "d"], "fix: no scan is called d; there are a, b, c"),
        (["--together", "a", "d"], "together: no scan is called d"),
        (["--together", "a", "b", "--apart", "b", "a"], "both together and apart"),
        (["--apart", "a", "a"], "a is named twice"),
        (["--together", "a", "--quiet"], "--together takes the names of two scans, not just a"),
        (["--start", "p.json"], "start: has a pose for none of the scans"),
        (["--knowledge", "p.json"], "p.json: format: no such fact"),
    ],
)
def test_facts_that_cannot_be_meant_exit_with_2(
    scans: Path, options: list[str], says: str, capsys: pytest.CaptureFixture[str]
):
    write_poses("p.json", PoseSet(poses={"x": turned(1)}, components=(("x",),)))
    assert scanweld("run", scans, "-o", "model", *options) == 2
    assert says in error_line(capsys)
    assert not Path("model").exists() and not work_folder(Path("model")).exists()


def test_version_and_help(capsys: pytest.CaptureFixture[str]):
    assert scanweld("--version") == 0
    assert capsys.readouterr().out.startswith("scanweld 0.")
    assert scanweld("run", "--help") == 0
    assert "--force" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("inputs", "says"),
    [
        (["scans", "missing.ply"], r"missing.ply: there is no such file"),
        (["empty"], r"empty: the folder holds no scans"),
        (["scans/*.xyz"], r"scans.\*.xyz: the pattern holds no scans"),
        (["notes.md"], r"notes.md: unknown format"),
        (["scans/a.ply"], r"only 1 of the scans"),
        (["scans/a.ply", "broken.ply"], r"only 1 of the scans"),
        (["scans", "--config", "missing.toml"], r"missing.toml: cannot be read"),
        (["scans", "--config", "bad.toml"], r"bad.toml: pairs.num_turn: no such setting"),
        (["scans", "--config", "odd.toml"], r"odd.toml: unit: "),
        (["scans", "-o", "scans"], r"scans: (is not empty|holds the input)"),
        (["scans", "-o", "scans", "--force"], r"scans: holds the input a.ply"),
        (["scans", "-o", "notes.md"], r"notes.md: is not a folder"),
        (["scans", "-o", "full"], r"full: is not empty.*--force"),
        (["scans", "-o", f"{'m' * 300}"], r"m: cannot be written"),
    ],
)
def test_bad_input_exits_with_1_one_line_and_nothing_written(
    scans: Path, inputs: list[str], says: str, capsys: pytest.CaptureFixture[str]
):
    for folder in ("empty", "full"):
        Path(folder).mkdir()
    for name in ("notes.md", "broken.ply", "full/file"):
        Path(name).write_text("not a scan")
    Path("bad.toml").write_text("[pairs]\nnum_turn = 3\n")
    Path("odd.toml").write_text("unit = 'foo'\n")
    before = sorted(Path().rglob("*"))
    output = [] if "-o" in inputs else ["-o", "model"]
    assert scanweld("run", "-q", *inputs, *output) == 1
    assert re.search(says, error_line(capsys))
    assert sorted(Path().rglob("*")) == before


@pytest.mark.parametrize("command", ["info", "report", "fuse scans -o x --poses", "evaluate"])
def test_names_that_are_too_long_are_one_line(
    scans: Path, command: str, capsys: pytest.CaptureFixture[str]
):
    names = ["m" * 300 + ".json"] * (1 + (command == "evaluate"))
    assert scanweld(*command.split(), *names) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("scanweld: error: ") and "m.json" in line


def test_unreadable_files_are_named_while_the_rest_goes_on(
    scans: Path, capsys: pytest.CaptureFixture[str]
):
    whole = (scans / "a.ply").read_bytes()
    (scans / "empty.ply").write_bytes(b"")
    (scans / "text.ply").write_text("dear diary")
    (scans / "truncated.ply").write_bytes(whole[: len(whole) // 2])
    assert scanweld("run", scans, "-o", "model") == 3
    out = capsys.readouterr().out
    poses = json.loads(Path("model/poses.json").read_text(encoding="utf-8"))
    assert list(poses["scans"]) == ["a", "b", "c"]
    assert list(poses["unplaced"]) == ["empty", "text", "truncated"]
    for name, reason in poses["unplaced"].items():
        assert f"unplaced {name}: {reason}" in out
    assert (report()["verdict"], report()["exit_code"]) == ("partial", 3)


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names of files are text there")
def test_file_names_that_are_no_utf8_are_spelled_out(scans: Path):
    shutil.move(scans / "a.ply", os.fsdecode(os.fsencode(scans) + b"/\xff.ply"))
    Path(os.fsdecode(os.fsencode(scans) + b"/\xfe.ply")).write_text("broken")
    assert scanweld("run", scans, "-o", "model") == 3
    poses = json.loads(Path("model/poses.json").read_text(encoding="utf-8"))
    assert list(poses["scans"]) == ["\\xff", "b", "c"]
    assert "\\xfe.ply: not a PLY" in poses["unplaced"]["\\xfe"]


def test_force_replaces_and_failing_runs_leave_an_earlier_output_whole(
    scans: Path, monkeypatch: pytest.MonkeyPatch
):
    assert scanweld("run", scans, "-o", "model") == 0
    Path("model/old").write_text("old")
    assert scanweld("run", scans, "-o", "model") == 1
    assert Path("model/old").exists()
    assert scanweld("run", scans, "-o", "model", "--force") == 0
    assert not Path("model/old").exists()
    before = {path.name: path.read_bytes() for path in Path("model").iterdir()}
    for error, code in ((InputError("too little"), 1), (KeyboardInterrupt(), 130)):
        fail_with(error, monkeypatch)
        assert scanweld("run", scans, "-o", "model", "--force") == code
        assert {path.name: path.read_bytes() for path in Path("model").iterdir()} == before
    fail_with(ZeroDivisionError("a bug"), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        main(["run", str(scans), "-o", "other"])
    assert not Path("other").exists()


def test_interruption_exits_with_130_and_a_rerun_continues(
    scans: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    fail_with(KeyboardInterrupt(), monkeypatch)
    assert scanweld("run", scans, "-o", "model", "-q") == 130
    err = capsys.readouterr().err
    assert err.startswith("scanweld: interrupted; the same command goes on from ")
    assert len(err.splitlines()) == 1
    assert not Path("model").exists() and cache_folder(Path("model")).exists()
    monkeypatch.setattr(job.pipeline, "run", stub_run)
    assert scanweld("run", scans, "-o", "model") == 0
    assert not work_folder(Path("model")).exists()


def test_without_a_cache_nothing_is_kept(
    scans: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    assert scanweld("run", scans, "-o", "model", "--no-cache", "-q") == 0
    assert not cache_folder(Path("model")).exists()
    capsys.readouterr()
    fail_with(KeyboardInterrupt(), monkeypatch)
    assert scanweld("run", scans, "-o", "other", "--no-cache", "-q") == 130
    assert capsys.readouterr().err == "scanweld: interrupted; nothing was written\n"


def test_info_shows_what_was_read_and_names_the_broken_file(
    scans: Path, capsys: pytest.CaptureFixture[str]
):
    assert scanweld("info", scans / "a.ply", scans / "b.ply") == 0
    out = capsys.readouterr().out
    for word in ("a\n", "b\n", "points", "grid", "camera     pinhole", "viewpoint  given"):
        assert word in out
    assert "resolution" in out and "diameter" in out
    (scans / "broken.ply").write_text("not a scan")
    assert scanweld("info", scans) == 1
    out, err = capsys.readouterr()
    assert [line for line in out.splitlines() if not line.startswith(" ")] == ["a", "b", "c"]
    assert err.startswith("scanweld: error: ") and "broken.ply" in err
    assert len(err.splitlines()) == 1


def test_simulate_then_evaluate(capsys: pytest.CaptureFixture[str]):
    write_mesh_ply("box.ply", PRIMITIVES["box"]())
    options = ["--num-scans", "3", "--pixels", "40", "--noise", "0", "--camera", "orthographic"]
    assert scanweld("simulate", "box.ply", "-o", "sim", *options) == 0
    names = {"scan_01.ply", "scan_02.ply", "scan_03.ply"}
    assert {path.name for path in Path("sim").glob("*.ply")} == names
    truth = Path("sim/truth/poses.json")
    capsys.readouterr()
    assert scanweld("evaluate", truth, truth, "--scans", "sim") == 0
    out = capsys.readouterr().out
    assert "of 3 scans: 3 right, 0 wrong, 0 unplaced" in out
    assert "translation error, mean / max: 0.000 / 0.000 % of the diameter" in out
    assert scanweld("simulate", "box.ply", "-o", "sim", *options) == 1


def test_evaluate_finds_what_is_wrong_and_needs_every_placed_scan(
    capsys: pytest.CaptureFixture[str], scans: Path
):
    truth = {name: turned(k) for k, name in enumerate(("a", "b", "c"))}
    off = Pose.exp([0, 0, np.radians(10), 0, 0, 0])
    found = {"a": truth["a"], "b": truth["b"] @ off}
    Path("truth.json").write_text(
        json.dumps({name: pose.matrix().tolist() for name, pose in truth.items()})
    )
    estimate = PoseSet(poses=found, components=(("a", "b"),), unplaced={"c": "fits nowhere"})
    write_poses("poses.json", estimate)
    assert scanweld("evaluate", "poses.json", "truth.json") == 3
    out = capsys.readouterr().out
    assert "of 3 scans: 1 right, 1 wrong, 1 unplaced" in out and "/ 10.000 deg" in out
    assert scanweld("evaluate", "poses.json", "missing.json") == 1
    assert "missing.json" in error_line(capsys)
    poses = a_result(["a", "elsewhere"]).poses
    write_poses("more.json", PoseSet(poses=dict(poses), components=(tuple(poses),)))
    assert scanweld("evaluate", "more.json", "more.json", "--scans", scans) == 1
    assert "elsewhere" in error_line(capsys)


@pytest.mark.slow
def test_the_package_runs_as_a_module_and_leaves_with_its_exit_code():
    command = [sys.executable, "-m", "scanweld", "run", "nowhere", "-o", "model"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "scanweld: error: nowhere: there is no such file; check the path\n"


def test_a_command_of_a_record_has_the_fields_as_options():
    @dataclass(frozen=True, kw_only=True)
    class Inner:
        small: bool = False

    @dataclass(frozen=True, kw_only=True)
    class Outer:
        name: str
        inner: Inner
        words: list[str] = field(default_factory=list)

    found: list[Outer] = []

    @takes(Outer)
    def command(options: Outer) -> None:
        """What it does."""
        found.append(options)

    parameters = inspect.signature(command).parameters
    assert [(each.name, each.default) for each in parameters.values()] == [
        ("name", inspect.Parameter.empty),
        ("small", False),
        ("words", []),
    ]
    assert command.__doc__ == "What it does."
    command(name="a", small=True, words=["b"])
    assert found == [Outer(name="a", inner=Inner(small=True), words=["b"])]
