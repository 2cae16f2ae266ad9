"""Which answers are right, and how a table tells it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import rankdata

Told = Mapping[str, Any]
"""What a trial tells of an answer: "deg" and "percent", None where there is no pose."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Limit:
    """Errors below which an answer is right; the shift in % of the object's diameter."""

    deg: float
    percent: float

    def holds(self, told: Told) -> bool:
        """Whether there is an answer, and it is within."""
        return told["deg"] is not None and told["deg"] < self.deg and told["percent"] < self.percent

    def __str__(self) -> str:
        return f"< {self.deg:g}°, < {self.percent:g} %"


def share_right(told: Sequence[Told], limit: Limit) -> float:
    """Share of right answers; NaN of none."""
    return float(np.mean([limit.holds(each) for each in told])) if told else float("nan")


def cell(told: Sequence[Told], limit: Limit, near: Limit | None = None) -> str:
    """Right of all, and the median rotation of the right ones: "7/8 0.03".

    With a wider limit, also how many more answers lie within that one: "7/8 0.03 (+1)".
    """
    if not told:
        return ""
    right = [each["deg"] for each in told if limit.holds(each)]
    middle = f" {np.median(right):.2f}" if right else ""
    more = sum(near.holds(each) for each in told) - len(right) if near else 0
    return f"{len(right)}/{len(told)}{middle}" + (f" (+{more})" if more else "")


def auc(scores: Sequence[float], is_right: Sequence[bool]) -> float:
    """Chance that a right answer has a higher score than a wrong one; NaN without either."""
    right = np.array(is_right, dtype=bool)
    num_right, num_wrong = int(right.sum()), int((~right).sum())
    if not num_right or not num_wrong:
        return float("nan")
    ranks = rankdata(scores)
    return float((ranks[right].sum() / num_right - 0.5 * (num_right + 1)) / num_wrong)
