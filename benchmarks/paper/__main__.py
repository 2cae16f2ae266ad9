"""Measure the paper's tables and figures, and write their pages.

    python -m benchmarks.paper                          everything, into docs/paper
    python -m benchmarks.paper --only table1 features   some of it
    python -m benchmarks.paper --quick --out DIR        a handful of units, on a made object
    python -m benchmarks.paper --pages                  the pages anew, from the JSON that stands

Without --only or --quick it writes method.md beside the folder of the pages, too.

Finished units are kept: an interrupted study goes on where it stopped. Change the code that
measures and they are measured again.
"""

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.paper.method import write_method
from benchmarks.paper.pages import write_index, write_page
from benchmarks.study.study import PACKAGE, Study, Table, measured, measured_by, read_records
from scanweld.errors import InputError, ScanweldError
from scanweld.work.threads import num_workers

TABLES = ("table1", "table2", "real_pairs", "features", "ablations", "basins", "figures")
"""In the order in which they are measured and shown; each is a module of this folder."""
_MODULES = ("views", "real", "heat_field", "settings", "methods", "{table}")
MEASURING = (
    PACKAGE,
    *(f"benchmarks/paper/{name}.py" for name in _MODULES),
    *(f"benchmarks/paper/{name}/*.py" for name in ("baselines", "{table}")),
)
USAGE_ERROR = 2


def main() -> int:
    """Run the study; 0 if it ran to its end."""
    options = _options()
    study = Study(
        out=options.out,
        work=options.work or options.out.parent / f".{options.out.name}.work",
        workers=num_workers(options.workers),
        quick=options.quick,
        command=shlex.join(["python", "-m", "benchmarks.paper", *sys.argv[1:]]),
        code=MEASURING,
    )
    try:
        _run(options.only or TABLES, study, measure=not options.pages)
        if not options.only and not options.quick:
            write_method(study.out)
    except ScanweldError as error:
        print(f"error: {error}", file=sys.stderr)
        return USAGE_ERROR
    return 0


def table(name: str) -> Table:
    """The table or figure of this name."""
    if name not in TABLES:
        raise InputError(f"{name}: no such table; there are {', '.join(TABLES)}")
    return import_module(f"benchmarks.paper.{name}")  # type: ignore[return-value]  # a module


def _run(names: Sequence[str], study: Study, *, measure: bool) -> None:
    """Measure table by table, or take what stands, and write each one's page."""
    for one in [table(name) for name in names]:
        if measure:
            study.write(one, measured(one, study))
        with measured_by(f"--only {one.NAME}"):
            records = read_records(study.out, one.NAME)
        write_page(one.NAME, records, study.out, quick=study.quick)
    write_index(TABLES, study.out)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help=", ".join(TABLES))
    parser.add_argument("--quick", action="store_true", help="a handful of units, no data needed")
    parser.add_argument("--pages", action="store_true", help="write the pages anew from the JSON")
    parser.add_argument("--out", type=Path, default=Path("docs/paper"))
    parser.add_argument("--work", type=Path, help="finished units (default: .NAME.work beside out)")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
