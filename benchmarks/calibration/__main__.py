"""Calibrate the confidence of pairs and scans on virtual sets of made objects.

    python -m benchmarks.calibration                    into the package and docs/data
    python -m benchmarks.calibration --quick --out DIR  a few sets, to see that it works

Finished sets are kept: what was interrupted goes on where it stopped. Change the code that makes
or registers them and they are measured again.
"""

import argparse
import sys
from pathlib import Path

from benchmarks.calibration.collect import NUM_SETS, Sets
from benchmarks.calibration.learn import learn
from benchmarks.calibration.report import calibration_told, write_all
from benchmarks.kept import CALIBRATION, COLLECTED, Study, measured
from benchmarks.results import DOCS, command_line
from scanweld.work.threads import num_workers


def main() -> int:
    """Calibrate, and print what it says of objects that were held out."""
    options = _options()
    command = command_line("benchmarks.calibration")
    study = Study(
        out=options.out,
        work=options.work or options.out.parent / ".calibration.work",
        workers=num_workers(options.workers),
        quick=options.quick,
        command=command,
        code=COLLECTED,
    )
    learned = learn(measured(Sets(num_sets=options.sets), study), command)
    package = options.out / CALIBRATION.name if options.quick else CALIBRATION
    print(calibration_told(write_all(learned, package, options.out, quick=options.quick)))
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="a few sets; the package stays as it is")
    add("--out", type=Path, default=DOCS, help="folder of the pictures, and of data/")
    add("--work", type=Path, help="finished sets (default: .calibration.work beside out)")
    add("--sets", type=int, default=NUM_SETS, help="how many")
    add("--workers", type=int, help="processes (default: one a core)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
