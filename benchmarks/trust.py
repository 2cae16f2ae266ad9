"""Try to make the main job assert what is not so: hard conditions by seeds, and what it says.

    python -m benchmarks.trust                            all runs and the page docs/trust.md
    python -m benchmarks.trust --compare                  other tools on some of the pairs, too
    python -m benchmarks.trust --only "ring of 6" hand --seeds 2 --out DIR
    python -m benchmarks.trust --quick --out DIR          a handful of runs
    python -m benchmarks.trust --pages                    the page anew, from the JSON that stands

Runs are made in processes of one core each, and kept as they finish: an interrupted benchmark goes
on where it stopped. Change the code that measures and they are made again. 0 if all floors are met.
"""

import argparse
import os
import shlex
import shutil
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks.judging.page import PAGE, Results, block, write_page
from benchmarks.judging.rivals import CODE as RIVALS_CODE
from benchmarks.judging.rivals import Rivals
from benchmarks.judging.table import CODE as TRUST_CODE
from benchmarks.judging.table import Runs
from benchmarks.paper.study import Study, Table
from benchmarks.virtual.scenarios import SCENARIOS
from scanweld.work.threads import num_workers

DOCS = Path(__file__).parents[1] / "docs"
COLUMNS = (
    TextColumn("{task.description}"),
    *(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()),
)


def main() -> int:
    """Make runs, comparison and page; 0 if all floors are met or only the page was asked for."""
    options = _options()
    study = Study(
        out=options.out,
        work=options.work or options.out.parent / ".trust.work",
        workers=num_workers(options.jobs),
        quick=options.quick,
        command=shlex.join(["python", "-m", "benchmarks.trust", *sys.argv[1:]]),
        code=TRUST_CODE,
    )
    if options.so_far:
        runs = Runs(scenarios=tuple(options.only), seeds=options.seeds)
        study.write(runs, study.finished(runs))
    elif not options.pages:
        _measure(Runs(scenarios=tuple(options.only), seeds=options.seeds), study)
        if options.compare:
            _measure(Rivals(), replace(study, code=RIVALS_CODE))
    _write_page(options.out)
    results = Results(options.out)
    if options.pages:
        return 0
    for name in ("trust-floors", "trust-scenarios", "trust-rivals", "trust-misses"):
        print(block(name, results))
    return int(any(floor.is_met is False for floor in results.floors))


def _measure(table: Table, study: Study) -> None:
    with Progress(*COLUMNS, console=Console(stderr=True)) as progress:
        task = progress.add_task(table.NAME, total=None)
        records = study.records(
            table, lambda done, total: progress.update(task, completed=done, total=total)
        )
        study.write(table, records)


def _write_page(out: Path) -> None:
    """In another folder than the documentation's, from a copy of its page and of the real sets."""
    for name in (PAGE, "data/sets.json"):
        if not (out / name).exists():
            shutil.copyfile(DOCS / name, out / name)
    write_page(out)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.trust",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", choices=SCENARIOS, default=SCENARIOS, metavar="NAME")
    parser.add_argument("--seeds", type=int, help="of each scenario, at most (default: its own)")
    parser.add_argument("--quick", action="store_true", help="a handful of runs")
    parser.add_argument(
        "--compare", action="store_true", help="other tools on some pairs too (extra: bench)"
    )
    parser.add_argument(
        "--so-far", action="store_true", help="no more runs: the page from those that are finished"
    )
    parser.add_argument("--pages", action="store_true", help="only write the page anew")
    parser.add_argument("--jobs", type=int, help="processes (default: one a core)")
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (docs)")
    parser.add_argument("--work", type=Path, help="finished runs (default: .trust.work beside out)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
