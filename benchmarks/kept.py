"""Trust and calibration: units of work that are kept when done, and the code that they are of."""

import argparse
import hashlib
import logging
import os
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks.results import DOCS, ROOT, command_line
from benchmarks.study.study import Record, Result, Study, Table, Unit, read_records
from scanweld.confidence.model import Calibration, stored_calibration
from scanweld.work.threads import num_workers, single_threaded_algebra

__all__ = ["Kept", "Record", "Result", "Study", "Unit", "measured", "read_records"]

CALIBRATION = ROOT / "src/scanweld/confidence/calibration.json"
_JUDGING = (f"benchmarks/judging/{name}.py" for name in ("outcomes", "trial"))
_SCENES = ("src/scanweld/**/*.py", "benchmarks/virtual/*.py", *_JUDGING)
COLLECTED = (*_SCENES, *(f"benchmarks/calibration/{n}.py" for n in ("solids", "scenes", "collect")))
"""The code that makes, registers and judges the sets of the calibration."""
CALIBRATED = (*COLLECTED, *(f"benchmarks/calibration/{name}.py" for name in ("fit", "learn")))
"""The same, and what learns from them."""
TRUSTED = (*_SCENES, "src/scanweld/**/*.json")
"""The code that makes, registers and judges the runs of trust, and the calibration it has."""
COMPARED = (
    *(*_SCENES, "benchmarks/judging/other_tools.py"),
    "benchmarks/paper/baselines/**/*.py",
)
"""The code that has other tools register the same pairs."""
NOT_MEASURED = ("src/scanweld/app/", "src/scanweld/fusion/")
COLUMNS = (
    TextColumn("{task.description}"),
    *(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()),
)

_log = logging.getLogger(__name__)


class Kept:
    """A table of units whose page is written by its blocks."""

    def page(self, records: Sequence[Record], out: Path) -> str:
        """Nothing."""
        return ""


def add_options(
    parser: argparse.ArgumentParser, processes: str, name: str
) -> argparse.ArgumentParser:
    """The options of a command that keeps what it has done, its processes under this name."""
    add = parser.add_argument
    add("--quick", action="store_true", help="a handful, to see that it works")
    add("--out", type=Path, default=DOCS, help="folder of page and pictures, and of data/ (docs)")
    add("--work", type=Path, help=f"what is finished (default: .{name}.work beside out)")
    add(processes, dest="processes", type=int, help="processes (default: one a core)")
    return parser


def study(options: argparse.Namespace, name: str, code: tuple[str, ...]) -> Study:
    """Where a command keeps what it has done, as its options say, and what code that is of."""
    return Study(
        out=options.out,
        work=options.work or options.out.parent / f".{name}.work",
        workers=num_workers(options.processes),
        quick=options.quick,
        command=command_line(f"benchmarks.{name}"),
        code=code,
    )


def measured(table: Table, study: Study, *, is_written: bool = False) -> list[Record]:
    """Measure what is not measured yet, in processes of one core each, and show how far it is."""
    # Inherited by the processes, which import their algebra anew.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with single_threaded_algebra(), Progress(*COLUMNS, console=Console(stderr=True)) as progress:
        task = progress.add_task(table.NAME, total=None)
        records = study.records(
            table, lambda done, total: progress.update(task, completed=done, total=total)
        )
    if is_written:
        study.write(table, records)
    return records


def code_digest(patterns: Sequence[str]) -> str:
    """Of the files of the project that some patterns name.

    Raises:
        ValueError: If a pattern names none: a folder has got another name.
    """
    digest, paths = hashlib.sha256(), set[Path]()
    for pattern in patterns:
        found = set(ROOT.glob(pattern))
        if not found:
            raise ValueError(f"{pattern}: no such file; say where that code is now")
        paths |= found
    for path in sorted(paths):
        name = path.relative_to(ROOT).as_posix()
        if not name.startswith(NOT_MEASURED):
            digest.update(name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def warn_of_old_calibration(calibration: Calibration | None = None) -> bool:
    """Say in one line if the calibration was made with other code than this; whether it was."""
    made, now = (calibration or stored_calibration()).made, code_digest(CALIBRATED)
    if made.get("code") == now:
        return False
    _log.warning(
        "calibration.json is of older code (%s, the code is %s now): confidences may be off until "
        "python -m benchmarks.calibration has run",
        made.get("code", "made before digests were kept"),
        now,
    )
    return True
