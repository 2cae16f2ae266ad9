"""Which answers are right, and how tables and sentences count them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import rankdata

Answer = Mapping[str, Any]
"""Errors of an answer: "deg" and "percent" (of the diameter), None where there is no pose."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Limit:
    """Errors below which an answer is right; the shift in % of the object's diameter."""

    deg: float
    percent: float

    def holds(self, answer: Answer) -> bool:
        """Whether there is a pose, and it is within."""
        deg, percent = answer["deg"], answer["percent"]
        return deg is not None and deg < self.deg and percent < self.percent

    def count(self, answers: Sequence[Answer]) -> str:
        """Right of all in words: "7 of 8"."""
        return f"{sum(map(self.holds, answers))} of {len(answers)}"

    def __str__(self) -> str:
        return f"< {self.deg:g}°, < {self.percent:g} %"


def share_right(answers: Sequence[Answer], limit: Limit) -> float:
    """Share of right answers; NaN of none."""
    return float(np.mean([limit.holds(each) for each in answers])) if answers else float("nan")


def cell(answers: Sequence[Answer], limit: Limit, near: Limit | None = None) -> str:
    """Right of all, and the median rotation of the right ones: "7/8 0.03".

    With a wider limit, also how many more answers lie within that one: "7/8 0.03 (+1)".
    """
    if not answers:
        return ""
    right = [each["deg"] for each in answers if limit.holds(each)]
    middle = f" {np.median(right):.2f}" if right else ""
    more = sum(near.holds(each) for each in answers) - len(right) if near else 0
    return f"{len(right)}/{len(answers)}{middle}" + (f" (+{more})" if more else "")


def auc(scores: Sequence[float], is_right: Sequence[bool]) -> float:
    """Chance that a right answer has a higher score than a wrong one; NaN without either."""
    right = np.array(is_right, dtype=bool)
    num_right, num_wrong = int(right.sum()), int((~right).sum())
    if not num_right or not num_wrong:
        return float("nan")
    ranks = rankdata(scores)
    return float((ranks[right].sum() / num_right - 0.5 * (num_right + 1)) / num_wrong)
