"""The ledger of seeds, the table of benchmarks/SEEDS.md: which of them decided something."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from benchmarks.results import ROOT

PAGE = ROOT / "benchmarks/SEEDS.md"
FIRST_FRESH = 11000
"""The next measurement of trust takes its seeds from here on."""
_ROW = re.compile(r"\| (\d+)(?: to (\d+))? \|[^|]*\|[^|]*\| *([^|]*?) *\|")


class Spent(NamedTuple):
    """Seeds by which something was decided, and what a page measured with them has to say."""

    seeds: range
    remark: str

    def __str__(self) -> str:
        return f"{self.seeds[0]}" + (f" to {self.seeds[-1]}" if len(self.seeds) > 1 else "")


def read_ledger(text: str) -> list[Spent]:
    """The rows of the ledger's table.

    Raises:
        ValueError: If a row cannot be read: its seeds would be taken for fresh ones.
    """
    found = []
    for line in [line for line in text.splitlines() if line.startswith("|")][2:]:
        row = _ROW.fullmatch(line)
        if row is None:
            raise ValueError(f"{PAGE.name}: not a row of seeds, used for, when, remark: {line}")
        found.append(Spent(range(int(row[1]), int(row[2] or row[1]) + 1), row[3]))
    return found


def spent_among(seeds: Iterable[int]) -> list[Spent]:
    """The entries of the ledger that have some of these seeds."""
    asked = set(seeds)
    ledger = read_ledger(PAGE.read_text(encoding="utf-8"))
    return [spent for spent in ledger if not asked.isdisjoint(spent.seeds)]
