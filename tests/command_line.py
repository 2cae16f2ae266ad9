"""The command line as tests call it."""

from pathlib import Path

import pytest

from scanweld.app.cli import main

COARSE = "[fusion]\nmax_voxels_across = 60\n"
"""Settings for runs whose model is not looked at."""


def scanweld(*arguments: str | Path) -> int:
    """Run a command.

    Returns:
        Its exit code.
    """
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    assert isinstance(left.value.code, int)
    return left.value.code


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on stderr, after nothing on stdout."""
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("scanweld: error: ")
    return line
