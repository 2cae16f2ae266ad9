"""The page docs/trust.md: hand-written, but for its measured parts."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.blocks import rewritten
from benchmarks.calibration.page import calibration
from benchmarks.judging.floors import Floor, floors, real_sets
from benchmarks.judging.measures import brier, calibration_error
from benchmarks.judging.plots import RELIABILITY, RISK, Stated, draw, stated_pairs, stated_scans
from benchmarks.judging.rivals import rival_table
from benchmarks.judging.table import outcomes_of
from benchmarks.judging.tables import floor_table, kind_table, misses, scenario_table
from benchmarks.judging.trial import Outcome
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, read_records
from benchmarks.paper.success import auc
from benchmarks.results import read_results
from scanweld.io.atomic import write_whole

PAGE = "trust.md"
NOT_YET = "Not measured yet.\n"


@dataclass(frozen=True)
class Results:
    """What was measured, in a folder such as docs.

    Its properties raise FileNotFoundError if it was not.
    """

    folder: Path

    @cached_property
    def document(self) -> dict[str, Any]:
        """What stands beside the runs: the command, the machine."""
        return read_results(self.folder / "data/trust.json")

    @cached_property
    def calibration(self) -> dict[str, Any]:
        """What the calibration found."""
        return read_results(self.folder / "data/calibration.json")

    @cached_property
    def outcomes(self) -> list[Outcome]:
        """All runs."""
        return outcomes_of(read_records(self.folder, "trust"))

    @cached_property
    def rivals(self) -> list[Record]:
        """What other tools say of the same pairs."""
        return read_records(self.folder, "rivals")

    @cached_property
    def floors(self) -> list[Floor]:
        """What must be shown, and is."""
        sets = read_results(self.folder / "data/sets.json")["records"]
        return [*floors(self.outcomes), real_sets(sets)]


def page_text(text: str, results: Results) -> str:
    """The page with its measured parts as the results have them now."""
    return rewritten(text, lambda name: f"\n{block(name, results)}\n")


def block(name: str, results: Results) -> str:
    """A measured part of the page."""
    try:
        return BLOCKS[name](results)
    except FileNotFoundError:
        return NOT_YET


def write_page(folder: Path) -> None:
    """Draw its pictures, and write the measured parts of the folder's page anew."""
    results = Results(folder)
    if (folder / "data/trust.json").exists():
        draw(results.outcomes, folder)
    page = folder / PAGE
    write_whole(page, page_text(page.read_text(encoding="utf-8"), results).encode())


def _told(results: Results) -> str:
    document, outcomes = results.document, results.outcomes
    hours = sum(outcome.seconds for outcome in outcomes) / 3600
    return (
        f"`{document['command']}`, on {document['machine']}: {len(outcomes)} runs, "
        f"{hours:.1f} hours on one core.\n\n"
    )


def _confidence(results: Results) -> str:
    stated = {"pairs": stated_pairs(results.outcomes), "scans": stated_scans(results.outcomes)}
    table = markdown_table(
        ("confidence of", "number", "right", "AUC", "calibration error", "Brier score"),
        [(name, *_numbers(each)) for name, each in stated.items()],
    )
    pictures = (
        f"![share of right answers by stated confidence]({RELIABILITY})\n\n"
        f"![share of wrong answers among the most confident]({RISK})\n"
    )
    return f"{table}\n{pictures}"


def _numbers(stated: Stated) -> tuple[str, ...]:
    confidences, is_right = [c for c, _ in stated], [r for _, r in stated]
    are_both = any(is_right) and not all(is_right)
    area = f"{auc(confidences, is_right):.4f}" if are_both else "- (none wrong)"
    return (
        *(str(len(stated)), str(sum(is_right)), area),
        f"{calibration_error(confidences, is_right):.4f}",
        f"{brier(confidences, is_right):.4f}",
    )


BLOCKS: dict[str, Callable[[Results], str]] = {
    "trust-floors": lambda results: _told(results) + floor_table(results.floors),
    "trust-scenarios": lambda results: scenario_table(results.outcomes),
    "trust-confidence": _confidence,
    "trust-rivals": lambda results: rival_table(results.rivals, results.outcomes),
    "trust-kinds": lambda results: kind_table(results.outcomes),
    "trust-misses": lambda results: misses(results.outcomes),
    "calibration": lambda results: calibration(results.calibration),
}
"""Measured part of the page -> what writes it."""
