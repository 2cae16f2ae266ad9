"""Superscripts are digits to Python and no numbers: files with them are refused in one line."""

from pathlib import Path

import pytest

from scanweld.errors import ReadError
from scanweld.io import read_scan

HEADER = "ply\nformat ascii 1.0\n{}element vertex {}\n"
BODY = "property float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n"


def test_a_superscript_counts_no_vertices(tmp_path: Path):
    path = tmp_path / "scan.ply"
    path.write_text(HEADER.format("", "3²") + BODY, encoding="utf-8")
    with pytest.raises(ReadError, match="is not 'element NAME COUNT'"):
        read_scan(path, "scan")
