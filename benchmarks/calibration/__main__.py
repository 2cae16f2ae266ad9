"""Calibrate the confidence of pairs and scans on virtual sets of made objects.

    python -m benchmarks.calibration                    into the package and docs/data
    python -m benchmarks.calibration --quick --out DIR  a few sets, to see that it works

Finished sets are kept: what was interrupted goes on where it stopped. Change the code that makes
or registers them and they are measured again.
"""

import argparse
import os
import shlex
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.calibration.collect import CODE, NUM_SETS, Sets
from benchmarks.calibration.learn import learn
from benchmarks.calibration.page import calibration
from benchmarks.calibration.report import measures, write_all
from benchmarks.paper.study import Study
from scanweld.work.threads import num_workers

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Calibrate, and print what it says of objects that were held out."""
    options = _options()
    command = shlex.join(["python", "-m", "benchmarks.calibration", *sys.argv[1:]])
    study = Study(
        out=options.out,
        work=options.work,
        workers=num_workers(options.workers),
        quick=options.quick,
        command=command,
        code=CODE,
    )
    records = study.records(Sets(num_sets=options.sets), _show)
    learned = learn(records, command)
    package = options.out if options.quick else ROOT / "src/scanweld/confidence"
    write_all(learned, package / "calibration.json", options.out)
    print(calibration(measures(learned)))
    return 0


def _show(done: int, total: int) -> None:
    print(f"\rsets: {done}/{total}", end="\n" if done == total else "", file=sys.stderr, flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--quick", action="store_true", help="a few sets; the package stays as it is"
    )
    parser.add_argument(
        "--out", type=Path, default=ROOT / "docs", help="folder of the diagram, and of data/"
    )
    parser.add_argument(
        "--work", type=Path, default=ROOT / ".calibration.work", help="finished sets"
    )
    parser.add_argument("--sets", type=int, default=NUM_SETS, help="how many")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
