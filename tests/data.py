"""Where tests find the Stanford scans, which are not part of the repository."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("SCANWELD_DATA", Path(__file__).parents[1] / ".." / "shared" / "data"))


def require_data(relative: str) -> Path:
    """The path of a data file or folder; skips the test, saying so, where it is missing."""
    path = (DATA / relative).resolve()
    if not path.exists():
        pytest.skip(f"needs {relative} (set SCANWELD_DATA to the folder of the Stanford data)")
    return path
