"""The output folder is whole or not there, and an earlier one survives whatever happens."""

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


def finish(workspace: Workspace) -> None:
    (workspace.staging / "poses.json").write_text("new")
    workspace.publish()


def assert_left(folder: Path, content: str) -> None:
    """The output holds this, and nothing lies beside it."""
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"poses.json": content}
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def put_aside(old_output: Path) -> Path:
    """As a run leaves it that is killed between its two moves."""
    aside = work_folder(old_output) / "old"
    aside.parent.mkdir(exist_ok=True)
    return old_output.rename(aside)


@pytest.mark.parametrize("is_there", [False, True])
def test_output_appears_when_whole_and_the_workspace_goes(output: Path, is_there: bool):
    if is_there:
        output.mkdir()
    with Workspace(output) as workspace:
        assert not output.exists() or not list(output.iterdir())
        finish(workspace)
    assert_left(output, "new")


@pytest.mark.parametrize("is_linked", [False, True])
def test_force_replaces_an_old_output_and_a_link_to_it_stays(old_output: Path, is_linked: bool):
    with pytest.raises(WriteError, match=r"not empty.*--force"), Workspace(old_output):
        pytest.fail("work began")
    assert_left(old_output, "old")
    link = old_output.with_name("link")
    if is_linked:
        link.symlink_to(old_output)
    with Workspace(link if is_linked else old_output, force=True) as workspace:
        finish(workspace)
    assert link.is_symlink() is is_linked
    link.unlink(missing_ok=True)
    assert_left(old_output, "new")


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError, InputError])
def test_failure_keeps_the_old_output_and_leaves_nothing_else(
    old_output: Path, error: type[BaseException]
):
    with pytest.raises(error), Workspace(old_output, force=True) as workspace:
        (workspace.staging / "poses.json").write_text("half")
        raise error
    with pytest.raises(error), Workspace(old_output / "deep" / "down"):
        raise error
    assert_left(old_output, "old")


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
    assert_left(old_output, "old")


def test_old_output_comes_back_after_a_kill_between_the_two_moves(
    old_output: Path, monkeypatch: pytest.MonkeyPatch
):
    """Not before there is room for it; and what a kill left to be deleted goes."""
    put_aside(old_output)

    def is_full(self: Path, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    for step in ("rename", "mkdir"):
        with monkeypatch.context() as context:
            context.setattr(Path, step, is_full)
            with pytest.raises(WriteError, match="No space left"):
                Workspace(old_output).__enter__()
    with pytest.raises(WriteError, match="not empty"), Workspace(old_output):
        pytest.fail("work began")
    assert (old_output / "poses.json").read_text() == "old"
    put_aside(old_output)
    old_output.mkdir()
    (old_output / "poses.json").write_text("newer, of the killed run")
    with Workspace(old_output, force=True) as workspace:
        finish(workspace)
    assert_left(old_output, "new")


def test_output_that_somebody_filled_meanwhile_stays(output: Path):
    workspace = Workspace(output)
    with pytest.raises(WriteError, match="cannot be moved"), workspace:
        output.mkdir()
        (output / "poses.json").write_text("theirs")
        finish(workspace)
    assert_left(output, "theirs")


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("poses.json", "not a folder"),
        ("poses.json/inside", "not a folder"),
        (".", "name a folder inside"),
        ("..", "name a folder inside"),
        ("/proc/model", "cannot be written"),
    ],
)
def test_places_for_no_output_are_refused_even_with_force(
    old_output: Path, monkeypatch: pytest.MonkeyPatch, place: str, says: str
):
    monkeypatch.chdir(old_output)
    with pytest.raises(WriteError, match=says), Workspace(Path(place), force=True):
        pytest.fail("work began")
    assert_left(old_output, "old")


def test_second_run_on_the_same_output_is_refused(output: Path):
    with Workspace(output) as first:
        with pytest.raises(WriteError, match=r"another run.*process \d+"), Workspace(output):
            pytest.fail("two runs at once")
        finish(first)
    assert_left(output, "new")
