"""Kernels where they cannot be kept: a read-only installation and no home."""

import logging
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core import config

from scanweld.work.kernels import provide_cache

# Numba tries a folder by a temporary file in it; here all but our own are read-only.
READ_ONLY = """
import tempfile
open_file = tempfile.TemporaryFile

def try_folder(*arguments, dir=None, **options):
    if "scanweld-kernels-" not in str(dir):
        raise PermissionError(dir)
    return open_file(*arguments, dir=dir, **options)

tempfile.TemporaryFile = try_folder
"""


def test_scanweld_can_be_imported_where_kernels_cannot_be_kept():
    code = READ_ONLY + "import scanweld, numba; print(numba.config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "NUMBA_CACHE_DIR" in done.stderr
    folder = Path(done.stdout.strip())
    assert folder.name.startswith("scanweld-kernels-") and not folder.exists()


def test_where_kernels_can_be_kept_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        assert provide_cache() is None
    assert not caplog.records
