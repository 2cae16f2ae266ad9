"""Try to make the main job assert what is not so: hard conditions by seeds, and what it says.

    python -m benchmarks.trust                            all runs and the page docs/trust.md
    python -m benchmarks.trust --times 3                  three times as many: narrower bounds
    python -m benchmarks.trust --compare                  other tools on some of the pairs, too
    python -m benchmarks.trust --only "ring of 6" hand --seeds 2 --out DIR
    python -m benchmarks.trust --quick --out DIR          a handful of runs
    python -m benchmarks.trust --pages                    the page anew, from the JSON that stands

Runs are made in processes of one core each, and kept as they finish: an interrupted benchmark goes
on where it stopped. Change the code that measures and they are made again. 0 if all floors are met.
"""

import argparse
import shutil
import sys
from pathlib import Path

from benchmarks.judging.other_tools import OtherTools
from benchmarks.judging.page import PAGE, Results, block, write_page
from benchmarks.judging.trial import Runs
from benchmarks.kept import (
    COMPARED,
    TRUSTED,
    Unit,
    add_options,
    code_digest,
    measured,
    study,
    warn_of_old_calibration,
)
from benchmarks.results import DOCS, read_results
from benchmarks.seeds import FIRST_FRESH, spent_among
from benchmarks.virtual.scenarios import SCENARIOS
from scanweld.errors import InputError

PRINTED = ("trust-seeds", "trust-floors", "trust-scenarios", "trust-rivals", "trust-misses")


def main() -> int:
    """Make runs, comparison and page; 0 if all floors are met or only the page was asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.trust",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--only", nargs="+", choices=SCENARIOS, default=tuple(SCENARIOS), metavar="NAME")
    add("--seeds", type=int, default=10**6, help="of each scenario, at most (default: its own)")
    add("--times", type=int, default=1, metavar="N", help="N times as many runs of each scenario")
    add("--first-seed", type=int, default=FIRST_FRESH, help="see benchmarks/SEEDS.md")
    add("--compare", action="store_true", help="other tools on some pairs too (extra: bench)")
    add("--pages", action="store_true", help="only write the page anew")
    options = add_options(parser, "--jobs", "trust").parse_args()
    warn_of_old_calibration()
    if not options.pages:
        counted = {"seeds": options.seeds, "first_seed": options.first_seed, "times": options.times}
        runs = Runs(scenarios=options.only, **counted)
        refuse_seen_seeds(runs.units(options.quick), options.out)
        measured(runs, study(options, "trust", TRUSTED), is_written=True)
        if options.compare:
            others = OtherTools(first_seed=options.first_seed)
            measured(others, study(options, "trust", COMPARED), is_written=True)
    for name in (PAGE, "data/sets.json"):
        # Another folder than the documentation's gets a copy of its page and of the real sets.
        if not (options.out / name).exists():
            shutil.copyfile(DOCS / name, options.out / name)
    write_page(options.out)
    if options.pages:
        return 0
    results = Results(options.out)
    print(*(block(name, results) for name in PRINTED), sep="\n")
    return int(any(floor.is_met is False for floor in results.floors))


def refuse_seen_seeds(units: list[Unit], out: Path) -> None:
    """Measure no seeds anew that a page shows for other code, unless the ledger says so.

    Raises:
        InputError: If the folder's page was measured with some of them, and they are not spent.
    """
    published = out / "data/trust.json"
    if not published.exists():
        return
    document, asked = read_results(published), {unit["seed"] for unit in units}
    if document["code"] == code_digest(TRUSTED):
        return
    seen = asked & {record["seed"] for record in document["records"]}
    fresh = sorted(seed for seed in seen if not spent_among([seed]))
    if fresh:
        raise InputError(
            f"seeds {fresh[0]} to {fresh[-1]} were already looked at in {PAGE}: enter them into "
            "benchmarks/SEEDS.md and measure fresh ones, as it says"
        )


if __name__ == "__main__":
    sys.exit(main())
