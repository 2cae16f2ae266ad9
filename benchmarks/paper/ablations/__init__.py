"""Ablations: what each part of the method is worth."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper.ablations import coarse, contours, heat, search, terms
from benchmarks.paper.study import Record, Result, Unit

NAME = "ablations"
TITLE = "Ablations"

_PARTS = {"contours": contours, "terms": terms, "heat": heat, "coarse": coarse, "search": search}


def units(quick: bool) -> list[Unit]:
    """The units of all parts.

    Raises:
        InputError: If a mesh or the real scans are missing.
    """
    return [{"part": name, **u} for name, part in _PARTS.items() for u in part.units(quick)]


def measure(unit: Unit) -> Result:
    """Measure one unit of its part."""
    return _PARTS[unit["part"]].measure(unit)


def page(records: Sequence[Record], out: Path) -> str:
    """The tables of all parts, one below the other."""
    told = [
        part.page([record for record in records if record.unit["part"] == name])
        for name, part in _PARTS.items()
    ]
    return "\n".join(told)
