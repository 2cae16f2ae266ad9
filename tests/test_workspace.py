"""The output folder is whole or not there, and an earlier one survives whatever happens."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from scanweld.app.workspace import Workspace, work_folder
from scanweld.errors import InputError, WriteError


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


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError, InputError])
def test_failure_keeps_the_old_output_and_leaves_nothing_else(
    old_output: Path, error: type[BaseException]
):
    with pytest.raises(error), Workspace(old_output, force=True) as workspace:
        (workspace.staging / "poses.json").write_text("half")
        raise error
    assert content(old_output) == {"poses.json": "old"}
    assert left_over(old_output) == ["model"]
    with pytest.raises(error), Workspace(old_output / "deep" / "down"):
        raise error
    assert content(old_output) == {"poses.json": "old"}


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
        monkeypatch.setattr(Path, "rename", fails_for_the_new)
        finish(workspace)
    assert content(old_output) == {"poses.json": "old"}
    assert left_over(old_output) == ["model"]


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
        output.mkdir()
        (output / "theirs").write_text("theirs")
        finish(workspace)
    assert content(output) == {"theirs": "theirs"}


def test_failure_to_open_keeps_an_old_output_that_is_aside(
    old_output: Path, monkeypatch: pytest.MonkeyPatch
):
    aside = work_folder(old_output) / "old"
    aside.parent.mkdir()
    old_output.rename(aside)

    def is_full(self: Path, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    for step in ("rename", "mkdir"):
        with monkeypatch.context() as context:
            context.setattr(Path, step, is_full)
            with pytest.raises(WriteError, match="No space left"):
                Workspace(old_output).__enter__()
    with pytest.raises(WriteError, match="not empty"), Workspace(old_output):
        pytest.fail("work began")
    assert content(old_output) == {"poses.json": "old"}


def test_second_run_on_the_same_output_is_refused(output: Path):
    with Workspace(output) as first:
        with pytest.raises(WriteError, match=r"another run.*process \d+"), Workspace(output):
            pytest.fail("two runs at once")
        finish(first)
    assert content(output) == {"poses.json": "new"}


def test_lock_of_a_killed_run_is_taken_over(output: Path):
    program = (
        "import os, signal, sys; from pathlib import Path\n"
        "from scanweld.app.workspace import Workspace\n"
        "with Workspace(Path(sys.argv[1])) as workspace:\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", program, output], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert (work_folder(output) / "lock").exists()
    with Workspace(output) as workspace:
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
