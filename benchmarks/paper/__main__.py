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
import sys
from importlib import import_module

from benchmarks import kept
from benchmarks.paper.method import write_method
from benchmarks.paper.pages import write_index, write_page
from benchmarks.results import DOCS
from benchmarks.study.study import PACKAGE, Table, measured, measured_by, read_records
from scanweld.errors import InputError, ScanweldError

TABLES = ("table1", "table2", "real_pairs", "features", "ablations", "basins", "figures")
"""In the order in which they are measured and shown; each is a module of this folder."""
_MODULES = ("views", "heat_field", "settings", "methods", "baselines/*", "{table}*")
MEASURING = (
    *(PACKAGE, "benchmarks/paper/study.toml"),
    *(f"benchmarks/paper/{name}.py" for name in _MODULES),
)
USAGE_ERROR = 2


def main() -> int:
    """Run the study; 0 if it ran to its end."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = kept.add_options(parser, "--workers", "paper").add_argument
    add("--only", nargs="+", metavar="NAME", help=", ".join(TABLES))
    add("--pages", action="store_true", help="write the pages anew from the JSON")
    parser.set_defaults(out=DOCS / "paper")
    options = parser.parse_args()
    study = kept.study(options, "paper", MEASURING)
    try:
        for one in [table(name) for name in options.only or TABLES]:
            if not options.pages:
                measured(one, study, is_written=True)
            with measured_by(f"--only {one.NAME}"):
                records = read_records(study.out, one.NAME)
            write_page(one.NAME, records, study.out, quick=study.quick)
        write_index(TABLES, study.out)
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


if __name__ == "__main__":
    sys.exit(main())
