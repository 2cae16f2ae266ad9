"""The runs as a table of units that are kept when done."""

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.judging.trial import Outcome, try_out
from benchmarks.kept import Kept, Record, Result, Unit
from benchmarks.seeds import FIRST_FRESH
from benchmarks.virtual.scenarios import SCENARIOS

QUICK = ("64 pixels across",)
"""One run of each shows whether all works."""


@dataclass(kw_only=True)
class Runs(Kept):
    """Runs of scenarios by seeds."""

    scenarios: Sequence[str] = tuple(SCENARIOS)  # Names
    seeds: int = 10**6  # How many of each, at most
    first_seed: int = FIRST_FRESH  # The first seed of each
    NAME: str = "trust"
    TITLE: str = "Trust"

    def units(self, quick: bool) -> list[Unit]:
        """Scenario by scenario and seed by seed; one of a few if quick."""
        counts = {name: min(self.seeds, SCENARIOS[name].seeds) for name in self.scenarios}
        return seeded(dict.fromkeys(QUICK, 1) if quick else counts, self.first_seed)

    def measure(self, unit: Unit) -> Result:
        """One run, on one core."""
        return try_out(unit["scenario"], unit["seed"]).record()


def seeded(counts: dict[str, int], first_seed: int) -> list[Unit]:
    """Units of so many runs of each scenario."""
    return [
        {"scenario": name, "seed": first_seed + k}
        for name, count in counts.items()
        for k in range(count)
    ]


def outcomes_of(records: Sequence[Record]) -> list[Outcome]:
    """The runs, as they were judged."""
    return [Outcome.of(record.unit, record.result) for record in records]
