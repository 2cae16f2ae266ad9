"""The command line where the system has neither flock, resource, fork nor a list of its cores."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.io.names import path_from
from tests.scenes import small_creature, write_scans

HIDDEN = """
import os, sys, warnings

sys.modules["fcntl"] = sys.modules["resource"] = None
for name in ("sched_getaffinity", "fork", "getuid", "O_NOFOLLOW"):
    if hasattr(os, name):
        delattr(os, name)
warnings.filterwarnings("ignore", "only soft file lock")
"""
COMMAND = HIDDEN + "from scanweld.app.cli import main; main(sys.argv[1:])"
SETTINGS = """
[prepare]
image_pixels = 64
[pairs]
keypoints = "even"
num_anchors = 8
num_turns = 8
num_survivors = [40, 10]
[fusion]
max_voxels_across = 50
"""


def elsewhere(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """A command on a machine that lacks all that is hidden."""
    command = [sys.executable, "-c", COMMAND, *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, encoding="utf-8", errors="replace", check=False
    )


@pytest.mark.slow
def test_commands_work_and_a_run_writes_a_model(tmp_path: Path):
    mesh = small_creature()
    for azimuth in (0, 25):
        view = view_of(mesh, azimuth, 20, pixels=60)
        scan = scan_mesh(mesh, view.camera, view.world_from_sensor, name=f"at_{azimuth}")
        write_scans(tmp_path / "scans", [scan])
    done = elsewhere("info", tmp_path / "scans" / "at_0.ply")
    assert done.returncode == 0 and "at_0" in done.stdout, done.stderr
    (tmp_path / "small.toml").write_text(SETTINGS, encoding="utf-8")
    output = tmp_path / "model"
    done = elsewhere("run", tmp_path / "scans", "-o", output, "--config", tmp_path / "small.toml")
    assert done.returncode in (0, 3), done.stderr
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    assert set(report["scans"]) == {"at_0", "at_25"}
    assert report["stages"]["pairs"]["peak_mb"] == 0
    assert (output / "report.html").is_file()
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [".scanweld-cache", "model", "scans", "small.toml"]


@pytest.mark.slow
def test_one_run_at_a_time(tmp_path: Path):
    program = f"""{HIDDEN}
from pathlib import Path
from scanweld.app.workspace import Workspace
from scanweld.errors import WriteError
with Workspace(Path(sys.argv[1])):
    try:
        Workspace(Path(sys.argv[1])).__enter__()
    except WriteError as error:
        print(error)
"""
    command = [sys.executable, "-c", program, str(tmp_path / "model")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "another run is at work" in done.stdout and "process" in done.stdout
    assert not list(tmp_path.iterdir())


def test_path_on_another_drive_is_told_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "scans" / "a.ply"
    assert path_from(tmp_path / "model", path) == "../scans/a.ply"

    def refuse(*_: object) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr("os.path.relpath", refuse)
    assert path_from(tmp_path / "model", path) == path.as_posix()
