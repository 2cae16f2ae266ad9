"""The page docs/trust.md: hand-written, but for its measured parts."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.blocks import rewritten
from benchmarks.judging.floors import Floor, floors
from benchmarks.judging.table import outcomes_of
from benchmarks.judging.tables import floor_table, misses, scenario_table
from benchmarks.judging.trial import Outcome
from benchmarks.paper.study import read_records
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
        return json.loads((self.folder / "data/trust.json").read_text(encoding="utf-8"))

    @cached_property
    def outcomes(self) -> list[Outcome]:
        """All runs."""
        return outcomes_of(read_records(self.folder, "trust"))

    @cached_property
    def floors(self) -> list[Floor]:
        """What they must show, and show."""
        return floors(self.outcomes)


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
    """Write the measured parts of the folder's page anew, if it has one."""
    page = folder / PAGE
    if page.exists():
        text = page_text(page.read_text(encoding="utf-8"), Results(folder))
        write_whole(page, text.encode())


def _told(results: Results) -> str:
    document, outcomes = results.document, results.outcomes
    hours = sum(outcome.seconds for outcome in outcomes) / 3600
    return (
        f"`{document['command']}`, on {document['machine']}: {len(outcomes)} runs, "
        f"{hours:.1f} hours on one core.\n\n"
    )


def _calibration(results: Results) -> str:
    return NOT_YET


BLOCKS: dict[str, Callable[[Results], str]] = {
    "trust-floors": lambda results: _told(results) + floor_table(results.floors),
    "trust-scenarios": lambda results: scenario_table(results.outcomes),
    "trust-misses": lambda results: misses(results.outcomes),
    "calibration": _calibration,
}
"""Measured part of the page -> what writes it."""
