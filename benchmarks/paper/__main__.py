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
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks.paper.method_page import write_method
from benchmarks.paper.pages import write_index, write_page
from benchmarks.paper.study import Study, Table, read_records
from benchmarks.paper.tables import table, table_names
from scanweld.errors import InputError, ScanweldError
from scanweld.work.threads import num_workers

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
    )
    try:
        tables = [table(name) for name in options.only or table_names()]
        if options.pages:
            _pages_again(tables, study)
        else:
            _measure(tables, study)
        if not options.only and not options.quick:
            write_method(study.out)
    except ScanweldError as error:
        print(f"error: {error}", file=sys.stderr)
        return USAGE_ERROR
    return 0


def _measure(tables: list[Table], study: Study) -> None:
    """Measure table by table, and write each one's JSON and page as soon as it is done."""
    columns = (
        TextColumn("{task.description}"),
        *(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        for one in tables:
            task = progress.add_task(one.NAME, total=None)
            records = study.records(
                one, lambda done, total, t=task: progress.update(t, completed=done, total=total)
            )
            study.write(one, records)
            write_page(one, records, study)
    write_index(study)


def _pages_again(tables: list[Table], study: Study) -> None:
    for one in tables:
        try:
            records = read_records(study.out, one.NAME)
        except FileNotFoundError as error:
            raise InputError(
                f"{error.filename}: is missing; measure it first (--only {one.NAME})"
            ) from error
        write_page(one, records, study)
    write_index(study)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help=", ".join(table_names()))
    parser.add_argument("--quick", action="store_true", help="a handful of units, no data needed")
    parser.add_argument("--pages", action="store_true", help="write the pages anew from the JSON")
    parser.add_argument("--out", type=Path, default=Path("docs/paper"))
    parser.add_argument("--work", type=Path, help="finished units (default: .NAME.work beside out)")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
