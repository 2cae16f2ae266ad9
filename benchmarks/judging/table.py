"""The runs as a table of ``benchmarks.paper.study``: units of work that are kept when done."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.judging.trial import Outcome, try_out
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.virtual.scenarios import SCENARIOS

CODE = (
    "src/scanweld/**/*.py",
    "benchmarks/virtual/*.py",
    "benchmarks/judging/trial.py",
)
FIRST_SEED = 2000
"""The calibration has the seeds below, and whoever tunes a threshold."""
QUICK = ("64 pixels across", "crop to a ball", "plate")
"""One run each of these shows whether all works."""


def seeds_of(count: int) -> range:
    """The seeds of so many runs of a scenario."""
    return range(FIRST_SEED, FIRST_SEED + count)


@dataclass(kw_only=True)
class Runs:
    """Runs of scenarios by seeds.

    Attributes:
        scenarios: Names.
        seeds: How many of each; as many as the scenario asks for if None.
    """

    scenarios: tuple[str, ...] = tuple(SCENARIOS)
    seeds: int | None = None
    NAME: str = "trust"
    TITLE: str = "Trust"

    def units(self, quick: bool) -> list[Unit]:
        """Scenario by scenario and seed by seed; one of a few if quick."""
        if quick:
            return [{"scenario": name, "seed": FIRST_SEED} for name in QUICK]
        return [
            {"scenario": name, "seed": seed}
            for name in self.scenarios
            for seed in seeds_of(min(self.seeds or 10**6, SCENARIOS[name].seeds))
        ]

    def measure(self, unit: Unit) -> Result:
        """One run, on one core."""
        return try_out(unit["scenario"], unit["seed"]).record()

    def page(self, records: Sequence[Record], out: Path) -> str:
        """Nothing: the page is written by its blocks."""
        return ""


def outcomes_of(records: Sequence[Record]) -> list[Outcome]:
    """The runs, as they were judged."""
    return [Outcome.of(record.unit, record.result) for record in records]
