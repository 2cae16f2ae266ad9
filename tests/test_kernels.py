"""Compiled kernels: never stale, not compiled twice, and kept in a folder that can be written."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from numba.core import config

import scanweld
from scanweld.app import first_run
from scanweld.compiled import kernels, source
from scanweld.compiled.kernels import provide_cache
from scanweld.work.progress import StageStarted, silent

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

CALLER = """
from numba import njit
from scanweld.callee import twice
from scanweld.constants import START

@njit(cache=True)
def total(x):
    return START + twice(x)
"""

CALLEE = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2 * x
"""

ASK = """
import scanweld.compiled.kernels
from scanweld.caller import total
print(total(10), len(total.stats.cache_hits), len(total.stats.cache_misses))
"""


RUN = """
import sys
from scanweld.app import cli, first_run
try:
    cli.main(["run", sys.argv[1], "-o", sys.argv[1] + "/model", "--quiet", "--workers", "1"])
except SystemExit:
    pass
for name in first_run.KERNELS:
    if others := set(first_run.kernel(name).overloads) - {first_run.argument_types(name)}:
        print(name, others)
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with our way to keep kernels, and two kernels in two files."""
    package = tmp_path / "scanweld"
    (package / "compiled").mkdir(parents=True)
    for name in ("__init__.py", "kernels.py", "source.py"):
        shutil.copy(source.PACKAGE / "compiled" / name, package / "compiled")
    (package / "__init__.py").touch()
    (package / "caller.py").write_text(CALLER, encoding="utf-8")
    (package / "callee.py").write_text(CALLEE, encoding="utf-8")
    (package / "constants.py").write_text("START = 1\n", encoding="utf-8")
    return package


def ask(package: Path) -> tuple[int, int, int]:
    """What the kernel gives in a new process, how often it was found, and how often compiled."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(package.parent),
        "NUMBA_CACHE_DIR": str(package.parent / "chosen"),
    }
    done = subprocess.run(
        [sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True
    )
    result, hits, misses = map(int, done.stdout.split())
    return result, hits, misses


def test_a_kernel_follows_the_kernels_and_constants_of_other_files(package: Path):
    assert ask(package) == (21, 0, 1)
    assert ask(package) == (21, 1, 0), "nothing is compiled on the second run"
    (package / "callee.py").write_text(CALLEE.replace("2 * x", "3 * x"), encoding="utf-8")
    assert ask(package) == (31, 0, 1)
    (package / "constants.py").write_text("START = 5\n", encoding="utf-8")
    assert ask(package) == (35, 0, 1)
    kept = list((package.parent / "chosen" / "scanweld").iterdir())
    assert len(kept) == 3 and all(path.name.startswith(kernels.PREFIX) for path in kept)


def test_the_digest_covers_what_kernels_import_and_nothing_else():
    found = {path.relative_to(source.PACKAGE).as_posix() for path in source.kernel_files()}
    assert {"evidence/step.py", "evidence/icp.py", "geometry/arrays.py"} <= found
    assert not any(name.startswith(("app/", "pipeline/")) for name in found)


@pytest.mark.parametrize(
    "code", ["import scanweld", "from scanweld.app.cli import main; main(['--help'])"]
)
def test_nothing_heavy_is_imported_before_it_is_needed(code: str):
    tell = f"import atexit, sys; atexit.register(lambda: print(*sys.modules)); {code}"
    done = subprocess.run([sys.executable, "-c", tell], capture_output=True, text=True)
    assert not {"numba", "scipy", "numpy", "pydantic", "rich"} & set(done.stdout.split())


def test_all_kernels_are_made_where_it_is_known_in_which_folder_they_are_kept():
    named = [path for path in source.PACKAGE.rglob("*.py") if b"from numba" in path.read_bytes()]
    assert named == [source.PACKAGE / "compiled/kernels.py"]


def test_all_that_is_public_is_there():
    assert {name for name in scanweld.__all__ if not hasattr(scanweld, name)} == set()
    named = [name for names in vars(scanweld)["_MODULES"].values() for name in names.split()]
    assert sorted(named) == scanweld.__all__ and set(named) < set(dir(scanweld))
    assert scanweld.__version__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        scanweld.nothing  # noqa: B018


def test_scanweld_can_be_imported_where_kernels_cannot_be_kept():
    code = READ_ONLY + "import scanweld.io, numba; print(numba.config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "NUMBA_CACHE_DIR" in done.stderr
    folder = Path(done.stdout.strip())
    assert folder.name.startswith("scanweld-kernels-") and not folder.exists()


def test_folders_of_earlier_states_go_when_they_are_old(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr(config, "CACHE_DIR", "")
    now, week = time.time(), 7 * 24 * 3600
    for age in range(6):
        folder = tmp_path / "scanweld" / f"{kernels.PREFIX}{age}"
        folder.mkdir(parents=True)
        os.utime(folder, (now, now - age * week))
    own = provide_cache(str(tmp_path))
    assert str(own) == vars(config)["CACHE_DIR"]
    kept = {path.name.removeprefix(kernels.PREFIX) for path in own.parent.iterdir() if path != own}
    assert kept == {"0", "1", "2"} and own.is_dir()
    assert not caplog.records


def test_a_run_calls_kernels_with_what_they_are_compiled_for_ahead(tmp_path: Path):
    scanweld.simulate(scanweld.creature(0), tmp_path, num_scans=6, pixels=80)
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path)], capture_output=True, text=True, check=True
    )
    told = [line for line in done.stdout.splitlines() if line.split(" ")[0] in first_run.KERNELS]
    assert told == []
    assert (tmp_path / "model" / "model.ply").exists(), "it got as far as the fusion"


def test_all_kernels_that_are_compiled_ahead_are_there_with_as_many_arguments():
    called = {**first_run.VIDEO_KERNELS, **first_run.KERNELS}
    for name in called:
        code = first_run.kernel(name).py_func.__code__
        assert len(first_run.argument_types(name)) == code.co_argcount, name
    missing = first_run.missing_kernels(of_video=True)
    assert set(missing) - set(first_run.missing_kernels()) <= set(first_run.VIDEO_KERNELS)


def test_another_process_compiles_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    one = "geometry.mesh.connected"
    assert set(first_run.KERNELS) >= set(first_run.missing_kernels())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(first_run, "missing_kernels", lambda **_: [one])
    with first_run.compiling_ahead(print, workers=2) as starting:
        progress = starting(silent)
        progress(StageStarted(stage="read"))
        assert not capsys.readouterr().out, "what is read may yet be refused"
        progress(StageStarted(stage="prepare"))
        until = time.monotonic() + 60
        while not list(tmp_path.rglob("mesh.connected-*.nbc")) and time.monotonic() < until:
            time.sleep(0.1)
    assert list(tmp_path.rglob("mesh.connected-*.nbi"))
    assert "first run: 1 kernel is compiled, once" in capsys.readouterr().out
    monkeypatch.setattr(first_run, "missing_kernels", lambda **_: [])
    with first_run.compiling_ahead(print) as starting:
        starting(silent)(StageStarted(stage="prepare"))
        assert not capsys.readouterr().out, "nothing is said where nothing is missing"
