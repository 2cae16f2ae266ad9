"""Commands that keep what they have done: their options, and the code that theirs is of."""

import argparse
import logging
from pathlib import Path

from benchmarks.results import DOCS, ROOT, command_line
from benchmarks.study.study import (
    Record,
    Result,
    Study,
    Table,
    Unit,
    code_digest,
    measured,
    read_records,
)
from scanweld.confidence.model import Calibration, stored_calibration
from scanweld.work.threads import num_workers

__all__ = ["Record", "Result", "Study", "Table", "Unit", "code_digest", "measured", "read_records"]

CALIBRATION = ROOT / "src/scanweld/confidence/calibration.json"
_JUDGING = (f"benchmarks/judging/{name}.py" for name in ("outcomes", "trial"))
_SCENES = ("src/scanweld/**/*.py", "benchmarks/virtual/*.py", *_JUDGING)
COLLECTED = (*_SCENES, *(f"benchmarks/calibration/{n}.py" for n in ("solids", "scenes", "collect")))
"""The code that makes, registers and judges the sets of the calibration."""
CALIBRATED = (
    *COLLECTED,
    *(f"benchmarks/calibration/{name}.py" for name in ("bounds", "fit", "learn")),
)
"""The same, and what learns from them."""
TRUSTED = (*_SCENES, "src/scanweld/**/*.json")
"""The code that makes, registers and judges the runs of trust, and the calibration it has."""
COMPARED = (
    *(*_SCENES, "benchmarks/judging/other_tools.py"),
    "benchmarks/paper/baselines/**/*.py",
)
"""The code that has other tools register the same pairs."""

_log = logging.getLogger(__name__)


def add_options(
    parser: argparse.ArgumentParser, processes: str, name: str
) -> argparse.ArgumentParser:
    """The options of a command that keeps what it has done, its processes under this name."""
    add = parser.add_argument
    add("--quick", action="store_true", help="a handful, without the data, to see that it works")
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
