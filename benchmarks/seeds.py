"""The ledger of seeds, the table of benchmarks/SEEDS.md: which of them decided something."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from benchmarks.results import ROOT

PAGE = ROOT / "benchmarks/SEEDS.md"
FIRST_FRESH = 3000
"""The next measurement of trust takes its seeds from here on."""
_ROW = re.compile(r"\| (\d+)(?: to (\d+))? \|[^|]*\|[^|]*\| *([^|]*?) *\|")


@dataclass(frozen=True, kw_only=True, slots=True)
class Spent:
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
    rows = [line for line in text.splitlines() if line.startswith("|")][2:]
    found = []
    for line in rows:
        row = _ROW.fullmatch(line)
        if row is None:
            raise ValueError(f"{PAGE.name}: not a row of seeds, used for, when, remark: {line}")
        first, last = int(row[1]), int(row[2] or row[1])
        found.append(Spent(seeds=range(first, last + 1), remark=row[3]))
    return found


def spent_among(seeds: Iterable[int]) -> list[Spent]:
    """The entries of the ledger that have some of these seeds."""
    asked = set(seeds)
    ledger = read_ledger(PAGE.read_text(encoding="utf-8"))
    return [spent for spent in ledger if not asked.isdisjoint(spent.seeds)]


def seeds_told(seeds: Iterable[int]) -> str:
    """What a page says of the seeds that it was measured with."""
    asked = sorted(set(seeds))
    told, spent = f"Seeds {asked[0]} to {asked[-1]}", spent_among(asked)
    if not spent:
        return f"{told}: nothing was decided with them before (`benchmarks/SEEDS.md`).\n"
    remarks = " ".join(each.remark for each in spent)
    return (
        f"{told}. **They are spent** (`benchmarks/SEEDS.md`: {', '.join(map(str, spent))}): code "
        "was changed after results with them had been looked at. So the figures below are figures "
        f"of development, and do not show what unseen scans would give. {remarks}".rstrip()
        + "\n"
    )
