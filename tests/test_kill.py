"""A run that is killed at any moment leaves what was there, and the next one goes on from it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.workspace import Workspace, work_folder
from tests.scenes import creature_scene, primitive_scene, write_scans

pytestmark = pytest.mark.slow

NUM_KILLS = 3
KILLED = 9
PROGRAM = """
import os, sys, threading, time
from scanweld.app.cache import FileCache
from scanweld.app.job import Limits, run_job
from scanweld.config import Config, FusionConfig, PairsConfig

scans, output, journal, moment, delay = sys.argv[1:]
put, calls = FileCache.put, 0


def put_and_tell(self, key, value):
    put(self, key, value)
    with open(journal, "a") as file:
        file.write(key + "\\n")


def die():
    time.sleep(float(delay))
    os._exit(9)


def progress(event):
    global calls
    calls += 1
    if calls == int(moment):
        threading.Thread(target=die).start()


FileCache.put = put_and_tell
pairs = PairsConfig(num_anchors=8, num_turns=8, num_survivors=(40, 10))
config = Config(pairs=pairs, fusion=FusionConfig(max_voxels_across=60))
run_job([scans], output, config, limits=Limits(workers=1), force=True, progress=progress)
print(calls)
"""
"""A run that tells what it finishes, and dies a while after so many steps (never, if it is 0).

It ends as if killed, which not all systems know: at once, with nothing tidied up.
"""


def run(
    scans: Path, output: Path, journal: Path, moment: int = 0, delay: float = 0.0
) -> subprocess.CompletedProcess[str]:
    arguments = map(str, (scans, output, journal, moment, delay))
    command = [sys.executable, "-c", PROGRAM, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def contents(folder: Path) -> dict[str, bytes]:
    """All files of an output, without what tells of times: the stages, and the page made of all."""
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    report = json.loads(files.pop("report.json"))
    del report["stages"], files["report.html"]
    return {**files, "report": json.dumps(report).encode()}


def test_killed_at_random_moments_the_old_output_is_whole_and_the_rerun_the_same(tmp_path: Path):
    """Moments are spread over all of a run; each goes on from what the one before it left."""
    scans = write_scans(tmp_path / "scans", creature_scene(4, pixels=60.0).scans)
    undisturbed, journal = tmp_path / "apart" / "undisturbed", tmp_path / "journal"
    whole = run(scans, undisturbed, journal)
    assert whole.returncode == 0, whole.stderr
    num_steps, finished = int(whole.stdout), journal.read_text(encoding="utf-8").split()
    journal.unlink()

    output = tmp_path / "here" / "model"
    output.mkdir(parents=True)
    old = {"mine.txt": b"old", "poses.json": b"{}"}
    for name, content in old.items():
        (output / name).write_bytes(content)
    rng = np.random.default_rng(7)
    moments = (np.arange(NUM_KILLS) + rng.random(NUM_KILLS)) / NUM_KILLS * num_steps
    for moment in moments:
        killed = run(scans, output, journal, 1 + int(moment), rng.uniform(0, 0.05))
        assert killed.returncode == KILLED, killed.stderr
        assert {path.name: path.read_bytes() for path in output.iterdir()} == old

    last = run(scans, output, journal)
    assert last.returncode == 0, last.stderr
    assert contents(output) == contents(undisturbed)
    # No piece of work was finished twice; a run may have died just before it told of one.
    told = journal.read_text(encoding="utf-8").split()
    assert len(set(told)) == len(told) >= len(finished) - NUM_KILLS >= 5
    assert set(told) <= set(finished)
    assert not work_folder(output).exists()


def test_a_second_run_on_the_same_output_is_refused(tmp_path: Path):
    """By another process, before it so much as reads the scans."""
    output = tmp_path / "model"
    scans = write_scans(tmp_path / "scans", primitive_scene("box", 2, pixels=30.0).scans)
    command = [sys.executable, "-m", "scanweld", "run", str(scans), "-o", str(output), "-q"]
    with Workspace(output) as first:
        second = subprocess.run(command, capture_output=True, text=True, check=False)
        assert second.returncode == 1
        assert len(second.stderr.strip().splitlines()) == 1
        assert "another run" in second.stderr and f"process {os.getpid()}" in second.stderr
        (first.staging / "poses.json").write_text("{}")
        first.publish()
    assert [path.name for path in output.iterdir()] == ["poses.json"]
