"""Try to make the main job assert what is not so: hard conditions by seeds, and what it says.

    python -m benchmarks.trust                            all runs, the comparison and the page
    python -m benchmarks.trust --only "ring of 6" hand --seeds 2 --out DIR
    python -m benchmarks.trust --quick --out DIR          a handful of runs
    python -m benchmarks.trust --pages                    the page anew, from the JSON that stands

Runs are made in processes of one core each, and kept as they finish: an interrupted benchmark goes
on where it stopped. Change the code that measures and they are made again. 0 if all floors are met.
"""

import argparse
import os
import shlex
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.judging.page import Results, block, write_page
from benchmarks.judging.table import CODE, Runs
from benchmarks.paper.study import Study
from benchmarks.virtual.scenarios import SCENARIOS
from scanweld.parallel import num_workers

DOCS = Path(__file__).parents[1] / "docs"


def main() -> int:
    """Make the runs; 0 if all floors are met, else 1."""
    options = _options()
    study = Study(
        out=options.out,
        work=options.work or options.out.parent / ".trust.work",
        workers=num_workers(options.jobs),
        quick=options.quick,
        command=shlex.join(["python", "-m", "benchmarks.trust", *sys.argv[1:]]),
        code=CODE,
    )
    if not options.pages:
        runs = Runs(scenarios=tuple(options.only), seeds=options.seeds)
        study.write(runs, study.records(runs, _advance))
    write_page(options.out)
    results = Results(options.out)
    for name in ("trust-floors", "trust-scenarios", "trust-misses"):
        print(block(name, results))
    return int(any(floor.is_met is False for floor in results.floors))


def _advance(done: int, total: int) -> None:
    print(f"{done} of {total} runs", file=sys.stderr, flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.trust",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", choices=SCENARIOS, default=SCENARIOS, metavar="NAME")
    parser.add_argument("--seeds", type=int, help="of each scenario, at most (default: its own)")
    parser.add_argument("--quick", action="store_true", help="a handful of runs")
    parser.add_argument("--pages", action="store_true", help="only write the page anew")
    parser.add_argument("--jobs", type=int, help="processes (default: one a core)")
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (docs)")
    parser.add_argument("--work", type=Path, help="finished runs (default: .trust.work beside out)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
