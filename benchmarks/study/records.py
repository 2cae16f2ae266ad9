"""Picking records by their units, and the answers of methods in their results."""

from collections.abc import Iterable
from typing import Any

from benchmarks.study.study import Record
from benchmarks.study.success import Answer


def of(records: Iterable[Record], **wanted: object) -> list[Record]:
    """The records whose units have these values."""
    return [r for r in records if all(r.unit[key] == value for key, value in wanted.items())]


def values_of(records: Iterable[Record], key: str) -> list[Any]:
    """The values that the units have, each once, in their order."""
    return list(dict.fromkeys(r.unit[key] for r in records))


def answers(records: Iterable[Record], method: str) -> list[Answer]:
    """A method's answers to the pairs on which it was tried."""
    return [r.result["answers"][method] for r in records if method in r.result["answers"]]


def up_to(records: Iterable[Record], gap: int) -> list[Record]:
    """The pairs that are not farther apart."""
    return [r for r in records if r.unit["gap"] <= gap]


def beyond(records: Iterable[Record], gap: int) -> list[Record]:
    """The pairs that are farther apart."""
    return [r for r in records if r.unit["gap"] > gap]


def overlapping(records: Iterable[Record], low: float, high: float) -> list[Record]:
    """The pairs whose overlap is from ``low`` and below ``high``."""
    return [r for r in records if low <= r.result["overlap"] < high]


def overlap_title(low: float, high: float) -> str:
    """A range of overlaps in words."""
    if high > 1:
        return f"from {low:.2f}"
    return f"{low:.2f}-{high:.2f}" if low else f"below {high:.2f}"
