"""Records picked by their units, the answers in their results, and which of these are right."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import getitem
from typing import Any

import numpy as np

from benchmarks.scores import Stated
from benchmarks.study.study import Record

Records = Sequence[Record]
Answer = Mapping[str, Any]
"""Errors of an answer: "deg" and "percent" (of the diameter), None where there is no pose."""


def of(records: Iterable[Record], **wanted: object) -> list[Record]:
    """The records whose units have these values."""
    return [r for r in records if all(r.unit[key] == value for key, value in wanted.items())]


def values_of(records: Iterable[Record], key: str) -> list[Any]:
    """The values that the units have, each once, in their order."""
    return list(dict.fromkeys(r.unit[key] for r in records))


def grouped(records: Iterable[Record], title: str) -> dict[str, list[Record]]:
    """The records by a title with values of their units in it, such as "{gap}° apart"."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(title.format(**record.unit), []).append(record)
    return groups


def results(records: Iterable[Record], *path: Any) -> list[Any]:
    """What stands at a path of keys in each result."""
    return [reduce(getitem, path, record.result) for record in records]


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


def by_overlap(records: Records, bins: Iterable[Sequence[float]]) -> dict[str, Records]:
    """The pairs by their overlap in words, as far as there are any."""
    inside = {overlap_title(*edges): overlapping(records, *edges) for edges in bins}
    return {title: chosen for title, chosen in inside.items() if chosen}


def overlap_title(low: float, high: float) -> str:
    """A range of overlaps in words."""
    if high > 1:
        return f"from {low:.2f}"
    return f"{low:.2f}-{high:.2f}" if low else f"below {high:.2f}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Limit:
    """Errors below which an answer is right; the shift in % of the object's diameter."""

    deg: float
    percent: float

    def holds(self, answer: Answer) -> bool:
        """Whether there is a pose, and it is within."""
        deg, percent = answer["deg"], answer["percent"]
        return deg is not None and deg < self.deg and percent < self.percent

    def among(self, answers: Iterable[Answer]) -> list[Answer]:
        """The right ones."""
        return [answer for answer in answers if self.holds(answer)]

    def share(self, answers: Sequence[Answer]) -> float:
        """Share of right answers; NaN of none."""
        return len(self.among(answers)) / len(answers) if answers else float("nan")

    def count(self, answers: Sequence[Answer]) -> str:
        """Right of all in words: "7 of 8"."""
        return f"{len(self.among(answers))} of {len(answers)}"

    def auc(self, answers: Iterable[Answer]) -> float:
        """How well the scores of the answers with a pose tell right from wrong."""
        given = [each for each in answers if each["deg"] is not None]
        return Stated.of((each["score"], self.holds(each)) for each in given).auc

    def cell(self, answers: Sequence[Answer], near: "Limit | None" = None) -> str:
        """Right of all, and the median rotation of the right ones: "7/8 0.03".

        With a wider limit, also how many more answers lie within that one: "7/8 0.03 (+1)".
        """
        if not answers:
            return ""
        right = [answer["deg"] for answer in self.among(answers)]
        middle = f" {np.median(right):.2f}" if right else ""
        more = len(near.among(answers)) - len(right) if near else 0
        return f"{len(right)}/{len(answers)}{middle}" + (f" (+{more})" if more else "")

    def __str__(self) -> str:
        return f"< {self.deg:g}°, < {self.percent:g} %"
