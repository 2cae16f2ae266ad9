"""The page docs/trust.md: hand-written, but for its measured parts."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from benchmarks.blocks import rewritten
from benchmarks.calibration.report import calibration_told
from benchmarks.judging.floors import Floor, floors, real_sets, stated_pairs, stated_scans
from benchmarks.judging.other_tools import other_tools_table
from benchmarks.judging.plots import draw, pictures
from benchmarks.judging.runs import outcomes_of
from benchmarks.judging.tables import (
    confidence_table,
    floor_table,
    kind_table,
    misses,
    scenario_table,
)
from benchmarks.judging.trial import Outcome
from benchmarks.kept import Record, read_records
from benchmarks.results import Json, how_measured, read_results, write_file
from benchmarks.seeds import seeds_told

PAGE = "trust.md"


@dataclass(frozen=True)
class Results:
    """What was measured, in a folder such as docs.

    Its properties raise FileNotFoundError if it was not.
    """

    folder: Path

    def document(self, name: str) -> Json:
        """Records and what stands beside them: the command, the machine, the code."""
        return read_results(self.folder / f"data/{name}.json")

    @cached_property
    def outcomes(self) -> list[Outcome]:
        """All runs."""
        return outcomes_of(read_records(self.folder, "trust"))

    @cached_property
    def other_tools(self) -> list[Record]:
        """What other tools say of the same pairs."""
        return read_records(self.folder, "rivals")

    @cached_property
    def floors(self) -> list[Floor]:
        """What must be shown, and is."""
        return [*floors(self.outcomes), real_sets(self.document("sets")["records"])]


def page_text(text: str, results: Results) -> str:
    """The page with its measured parts as the results have them now."""
    return rewritten(text, lambda name: block(name, results))


def block(name: str, results: Results) -> str:
    """A measured part of the page."""
    try:
        return BLOCKS[name](results)
    except FileNotFoundError:
        return "Not measured yet.\n"


def write_page(folder: Path) -> None:
    """Draw its pictures, and write the measured parts of the folder's page anew."""
    results = Results(folder)
    if (folder / "data/trust.json").exists():
        stated = stated_pairs(results.outcomes), stated_scans(results.outcomes)
        draw(dict(zip(("pairs", "placed scans"), stated, strict=True)), folder, "trust")
    page = folder / PAGE
    write_file(page, page_text(page.read_text(encoding="utf-8"), results))


def _floors(results: Results) -> str:
    document, outcomes = results.document("trust"), results.outcomes
    hours = sum(outcome.seconds for outcome in outcomes) / 3600
    told = f"{len(outcomes)} runs of code {document['code']}, {hours:.1f} hours on one core"
    return f"{how_measured(document)}: {told}.\n\n{floor_table(results.floors)}"


def _confidence(results: Results) -> str:
    stated = {"pairs": stated_pairs(results.outcomes), "scans": stated_scans(results.outcomes)}
    return f"{confidence_table(stated)}\n{pictures('trust', 'answers')}"


BLOCKS: dict[str, Callable[[Results], str]] = {
    "trust-seeds": lambda results: seeds_told(outcome.seed for outcome in results.outcomes),
    "trust-floors": _floors,
    "trust-scenarios": lambda results: scenario_table(results.outcomes),
    "trust-confidence": _confidence,
    "trust-rivals": lambda results: other_tools_table(results.other_tools, results.outcomes),
    "trust-kinds": lambda results: kind_table(results.outcomes),
    "trust-misses": lambda results: misses(results.outcomes),
    "calibration": lambda results: calibration_told(results.document("calibration")),
}
"""Measured part of the page -> what writes it."""
