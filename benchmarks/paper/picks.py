"""Picking records by their units and answers by their method, and titles of what is picked."""

from collections.abc import Iterable
from typing import Any

from benchmarks.paper.study import Record
from benchmarks.paper.success import Told


def of(records: Iterable[Record], **wanted: object) -> list[Record]:
    """The records whose units have these values."""
    return [r for r in records if all(r.unit[key] == value for key, value in wanted.items())]


def told_by(records: Iterable[Record], method: str) -> list[Told]:
    """A method's answers to the pairs on which it was tried."""
    return [r.result["answers"][method] for r in records if method in r.result["answers"]]


def by_gap(records: Iterable[Record], method: str) -> dict[int, list[Told]]:
    """The same by the gap of the pair, ascending."""
    found: dict[int, list[Told]] = {}
    for r in records:
        if method in r.result["answers"]:
            found.setdefault(r.unit["gap"], []).append(r.result["answers"][method])
    return dict(sorted(found.items()))


def overlapping(records: Iterable[Record], low: float, high: float) -> list[Record]:
    """The pairs whose overlap is from ``low`` and below ``high``."""
    return [r for r in records if low <= r.result["overlap"] < high]


def values(records: Iterable[Record], key: str) -> list[Any]:
    """The values that the units have, each once, in their order."""
    return list(dict.fromkeys(r.unit[key] for r in records))


def sentence_on_missing(records: Iterable[Record]) -> str:
    """On the methods that were left out of a quick run; empty where none were."""
    missing = sorted({module for r in records for module in r.unit.get("missing", ())})
    if not missing:
        return ""
    return f"\nNot installed, and the methods that need them left out: {', '.join(missing)}.\n"


def overlap_title(low: float, high: float) -> str:
    """A range of overlaps in words."""
    if high > 1:
        return f"from {low:.2f}"
    return f"{low:.2f}-{high:.2f}" if low else f"below {high:.2f}"
