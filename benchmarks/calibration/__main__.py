"""Calibrate the confidence of pairs and scans on virtual sets of made objects.

    python -m benchmarks.calibration                    into the package and docs/data
    python -m benchmarks.calibration --quick --out DIR  a few sets, to see that it works

Finished sets are kept: what was interrupted goes on where it stopped. Change the code that makes
or registers them and they are measured again.
"""

import argparse
import sys

from benchmarks.blocks import rendered
from benchmarks.calibration.collect import NUM_SETS, Sets
from benchmarks.calibration.learn import learn
from benchmarks.calibration.report import calibration_told, write_all
from benchmarks.kept import CALIBRATION, COLLECTED, add_options, measured, study


def main() -> int:
    """Calibrate, and print what it says of objects that were held out."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--sets", type=int, default=NUM_SETS, help="how many")
    options = add_options(parser, "--workers", "calibration").parse_args()
    where = study(options, "calibration", COLLECTED)
    learned = learn(measured(Sets(num_sets=options.sets), where), where.command)
    package = options.out / CALIBRATION.name if options.quick else CALIBRATION
    found = write_all(learned, package, options.out, quick=options.quick)
    print(rendered("calibration", **calibration_told(found)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
