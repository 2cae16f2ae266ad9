"""The output folder is whole or not there, and an earlier one survives whatever happens."""

import hashlib
import io
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.cache import FileCache
from scanweld.app.workspace import Workspace, work_folder
from scanweld.errors import InputError, WriteError
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.work.records import Records


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "model"


@pytest.fixture
def old_output(output: Path) -> Path:
    output.mkdir()
    (output / "poses.json").write_text("old")
    return output


def finish(workspace: Workspace, text: str = "new") -> None:
    (workspace.staging / "poses.json").write_text(text)
    workspace.publish()


def content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def left_over(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.parent.iterdir())


def test_output_appears_when_whole_and_the_workspace_goes(output: Path):
    with Workspace(output) as workspace:
        workspace.cache.put("ab", 1)
        assert not output.exists()
        finish(workspace)
    assert content(output) == {"poses.json": "new"}
    assert left_over(output) == ["model"]


def test_empty_folder_is_filled(output: Path):
    output.mkdir()
    with Workspace(output) as workspace:
        finish(workspace)
    assert content(output) == {"poses.json": "new"}


def test_full_folder_is_refused_before_any_work(old_output: Path):
    with pytest.raises(WriteError, match=r"not empty.*--force"), Workspace(old_output):
        pytest.fail("work began")
    assert content(old_output) == {"poses.json": "old"}
    assert left_over(old_output) == ["model"]


def test_force_replaces_an_old_output(old_output: Path):
    with Workspace(old_output, force=True) as workspace:
        finish(workspace)
    assert content(old_output) == {"poses.json": "new"}
    assert left_over(old_output) == ["model"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_interruption_keeps_old_output_and_finished_work(
    old_output: Path, error: type[BaseException]
):
    with pytest.raises(error), Workspace(old_output, force=True) as workspace:
        workspace.cache.put("ab", "finished")
        (workspace.staging / "poses.json").write_text("half")
        raise error
    assert content(old_output) == {"poses.json": "old"}
    with Workspace(old_output, force=True) as workspace:
        assert workspace.cache.get("ab") == "finished"
        assert not list(workspace.staging.iterdir())
        finish(workspace)
    assert content(old_output) == {"poses.json": "new"}
    assert left_over(old_output) == ["model"]


def test_interruption_before_anything_is_finished_leaves_nothing(output: Path):
    with pytest.raises(KeyboardInterrupt), Workspace(output):
        raise KeyboardInterrupt
    assert left_over(output) == []


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_failure_between_the_two_moves_brings_the_old_output_back(
    old_output: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException] | OSError
):
    move = Path.rename

    def fails_for_the_new(self: Path, target: Path) -> Path:
        if self.name == "output":
            raise error
        return move(self, target)

    workspace = Workspace(old_output, force=True)
    with pytest.raises((KeyboardInterrupt, WriteError)), workspace:
        workspace.cache.put("ab", "finished")
        monkeypatch.setattr(Path, "rename", fails_for_the_new)
        finish(workspace)
    assert content(old_output) == {"poses.json": "old"}
    assert workspace.cache.get("ab") == "finished"


def test_old_output_comes_back_after_a_kill_between_the_two_moves(old_output: Path):
    aside = work_folder(old_output) / "old"
    aside.parent.mkdir()
    old_output.rename(aside)
    with pytest.raises(WriteError, match="not empty"), Workspace(old_output):
        pytest.fail("work began")
    assert content(old_output) == {"poses.json": "old"}
    with Workspace(old_output, force=True) as workspace:
        finish(workspace)
    assert content(old_output) == {"poses.json": "new"}


def test_old_output_goes_after_a_kill_before_it_was_deleted(old_output: Path):
    aside = work_folder(old_output) / "old"
    aside.mkdir(parents=True)
    (aside / "poses.json").write_text("older")
    with Workspace(old_output, force=True) as workspace:
        finish(workspace)
    assert content(old_output) == {"poses.json": "new"}
    assert left_over(old_output) == ["model"]


def test_output_that_somebody_filled_meanwhile_stays(output: Path):
    workspace = Workspace(output)
    with pytest.raises(WriteError, match="cannot be moved"), workspace:
        workspace.cache.put("ab", "finished")
        output.mkdir()
        (output / "theirs").write_text("theirs")
        finish(workspace)
    assert content(output) == {"theirs": "theirs"}
    assert workspace.cache.get("ab") == "finished"


def test_bad_input_leaves_nothing(output: Path):
    with pytest.raises(InputError), Workspace(output / "deep" / "down") as workspace:
        workspace.cache.put("ab", 1)
        raise InputError("too little")
    assert left_over(output) == []


def test_bad_input_keeps_what_an_earlier_run_finished(output: Path):
    for error in (KeyboardInterrupt, InputError):
        with pytest.raises(error), Workspace(output) as workspace:
            workspace.cache.put("ab", 1)
            raise error
    with Workspace(output) as workspace:
        assert workspace.cache.get("ab") == 1


def test_failure_to_open_keeps_what_an_earlier_run_finished(
    output: Path, monkeypatch: pytest.MonkeyPatch
):
    with pytest.raises(KeyboardInterrupt), Workspace(output) as workspace:
        workspace.cache.put("ab", 1)
        raise KeyboardInterrupt

    def is_full(self: Path, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as context:
        context.setattr(Path, "mkdir", is_full)
        with pytest.raises(WriteError, match="No space left"):
            Workspace(output).__enter__()
    with Workspace(output) as workspace:
        assert workspace.cache.get("ab") == 1


def test_second_run_on_the_same_output_is_refused(output: Path):
    with Workspace(output) as first:
        with pytest.raises(WriteError, match=r"another run.*process \d+"), Workspace(output):
            pytest.fail("two runs at once")
        finish(first)
    assert content(output) == {"poses.json": "new"}


def test_lock_and_work_of_a_killed_run_are_taken_over(output: Path):
    program = (
        "import os, signal, sys; from pathlib import Path\n"
        "from scanweld.app.workspace import Workspace\n"
        "with Workspace(Path(sys.argv[1])) as workspace:\n"
        "    workspace.cache.put('ab', 'finished')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", program, output], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert (work_folder(output) / "lock").exists()
    with Workspace(output) as workspace:
        assert workspace.cache.get("ab") == "finished"
        finish(workspace)
    assert left_over(output) == ["model"]


def test_file_in_the_outputs_place_is_refused_even_with_force(output: Path):
    output.write_text("mine")
    for place in (output, output / "inside"):
        with pytest.raises(WriteError, match="not a folder"), Workspace(place, force=True):
            pytest.fail("work began")
    assert output.read_text() == "mine"


def test_output_that_holds_an_input_is_refused_even_with_force(old_output: Path):
    inputs = [old_output / "poses.json"]
    with pytest.raises(WriteError, match="holds the input"):
        Workspace(old_output, inputs=inputs, force=True).__enter__()
    assert content(old_output) == {"poses.json": "old"}


def test_current_folder_is_refused_even_with_force(
    old_output: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(old_output)
    for place in (Path(), Path("..")):
        with pytest.raises(WriteError, match="name a folder inside"), Workspace(place, force=True):
            pytest.fail("work began")
    assert content(old_output) == {"poses.json": "old"}


def test_unwritable_place_is_refused():
    with pytest.raises(WriteError, match="cannot be written"), Workspace(Path("/proc/model")):
        pytest.fail("work began")


def test_too_long_a_name_is_refused(tmp_path: Path):
    with pytest.raises(WriteError, match="cannot be written"), Workspace(tmp_path / ("m" * 300)):
        pytest.fail("work began")


def test_output_behind_a_link_is_replaced_and_the_link_stays(old_output: Path):
    link = old_output.with_name("link")
    link.symlink_to(old_output)
    with Workspace(link, force=True) as workspace:
        finish(workspace)
    assert link.is_symlink() and content(old_output) == {"poses.json": "new"}


def test_cached_scan_comes_back_equal_and_frozen(tmp_path: Path):
    scan = RangeScan(name="a", points=np.arange(12.0).reshape(4, 3))
    cache = FileCache(tmp_path, Records(RangeScan))
    assert cache.get("ab") is None and cache.is_empty()
    cache.put("ab", (scan, Pose.identity()))
    kept = cache.get("ab")
    assert isinstance(kept, tuple)
    assert kept[0].content_hash() == scan.content_hash()
    assert not kept[0].points.flags.writeable and not kept[1].rotation.flags.writeable
    assert [path.name for path in tmp_path.iterdir()] == ["ab.record"]


@pytest.mark.parametrize("length", [0, 1, 31, 32, 33, -1])
def test_truncated_entry_counts_as_absent(tmp_path: Path, length: int):
    cache = FileCache(tmp_path)
    cache.put("ab", tuple(range(100)))
    whole = (tmp_path / "ab.record").read_bytes()
    (tmp_path / "ab.record").write_bytes(whole[:length])
    assert cache.get("ab") is None
    cache.put("ab", "again")
    assert cache.get("ab") == "again"


def test_damaged_entry_counts_as_absent(tmp_path: Path):
    cache = FileCache(tmp_path)
    cache.put("ab", "value")
    data = bytearray((tmp_path / "ab.record").read_bytes())
    data[-5] ^= 1
    (tmp_path / "ab.record").write_bytes(data)
    assert cache.get("ab") is None


class Evil:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (pytest.fail, ("code of the cache was run",))


@pytest.mark.parametrize("suffix", ["record", "pkl"])
def test_a_folder_from_elsewhere_cannot_run_code(tmp_path: Path, suffix: str):
    objects = io.BytesIO()
    np.savez(objects, tree=np.array([Evil()], dtype=object))
    for body in (pickle.dumps(Evil()), objects.getvalue()):
        (tmp_path / f"ab.{suffix}").write_bytes(hashlib.sha256(body).digest() + body)
        assert FileCache(tmp_path).get("ab") is None


def test_keys_stay_inside_the_folder(tmp_path: Path):
    with pytest.raises(ValueError, match="hex"):
        FileCache(tmp_path / "cache").put("../ab", 1)
    assert not list(tmp_path.iterdir())
