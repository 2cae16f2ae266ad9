"""A run that is killed at any moment leaves what was there, and the next one goes on from it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.workspace import work_folder
from scanweld.io import write_scan_ply
from tests.scenes import creature_scene

NUM_KILLS = 5
MOST_KEPT = 14
"""Of five scans: their keypoints and all pairs but one are kept."""


def command(scans: Path, output: Path, *more: str) -> list[str]:
    start = "from scanweld.app.cli import main; main()"
    return [sys.executable, "-c", start, "run", str(scans), "-o", str(output), "-q", *more]


def contents(folder: Path) -> dict[str, bytes]:
    """Files of an output but for the report, which tells of times."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.name != "report.json"}


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scans")
    for scan in creature_scene(5, pixels=100.0).scans:
        write_scan_ply(folder / f"{scan.name}.ply", scan)
    return folder


def finished(output: Path) -> set[str]:
    """Names of the cached work of a run that makes an output."""
    return {p.name for p in work_folder(output).glob("cache/**/*") if p.is_file()}


@pytest.fixture(scope="module")
def undisturbed(scans: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of a run that nobody disturbs."""
    output = tmp_path_factory.mktemp("whole") / "model"
    subprocess.run(command(scans, output), check=False)
    return output


def test_killed_at_random_moments_the_old_output_is_whole_and_the_rerun_the_same(
    scans: Path, undisturbed: Path, tmp_path: Path
):
    """Each run goes on from what the one before it left, and none begins again."""
    output = tmp_path / "model"
    output.mkdir()
    (output / "old.txt").write_text("kept")
    kept: set[str] = set()
    for num_finished in np.sort(np.random.default_rng(4).permutation(MOST_KEPT)[:NUM_KILLS]) + 1:
        run = subprocess.Popen(command(scans, output, "--force"))
        while len(finished(output)) < num_finished:
            assert run.poll() is None, "the run ended before it could be killed"
            time.sleep(0.002)
        os.kill(run.pid, signal.SIGKILL)
        assert run.wait() == -signal.SIGKILL
        assert [p.name for p in output.iterdir()] == ["old.txt"]
        assert (output / "old.txt").read_text() == "kept"
        assert kept <= finished(output), "work that was finished is gone"
        kept = finished(output)
    stamps = {p: p.stat().st_mtime_ns for p in work_folder(output).glob("cache/**/*")}
    run = subprocess.Popen(command(scans, output, "--force"))
    redone = set()
    while run.poll() is None:
        for path, stamp in stamps.items():
            try:
                if path.is_file() and path.stat().st_mtime_ns != stamp:
                    redone.add(path.name)
            except FileNotFoundError:
                continue
        time.sleep(0.01)
    assert not redone, "finished work was done again"
    assert contents(output) == contents(undisturbed)
    assert not work_folder(output).exists()


def test_a_second_run_on_the_same_output_is_refused(scans: Path, tmp_path: Path):
    output = tmp_path / "model"
    first = subprocess.Popen(command(scans, output))
    try:
        while not (work_folder(output) / "lock").exists():
            assert first.poll() is None, "the first run ended before the second could start"
            time.sleep(0.02)
        second = subprocess.run(command(scans, output), capture_output=True, text=True, check=False)
        assert second.returncode == 1
        assert len(second.stderr.strip().splitlines()) == 1
        assert "another run" in second.stderr
    finally:
        first.wait()
    assert (output / "poses.json").is_file()
