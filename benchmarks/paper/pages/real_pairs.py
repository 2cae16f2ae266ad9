"""What the page of the real pairs tells of its records."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.methods import BY_TITLE, METHODS, curve
from benchmarks.scores import Stated
from benchmarks.study.plots import Panel, draw_panels
from benchmarks.study.records import (
    Answer,
    Limit,
    Records,
    answers,
    overlap_title,
    overlapping,
)

BASIN = Limit(deg=5, percent=2)
TIGHT = Limit(deg=2, percent=1)
BINS = ((0.4, 1.01), (0.25, 0.4), (0.15, 0.25), (0.10, 0.15), (0.05, 0.10), (0.0, 0.05))
HALVES = ((0.15, 1.01), (0.05, 0.15), (0.0, 0.05))
"""What the words speak of."""


def by_overlap(records: Records, bins: Sequence[tuple[float, float]]) -> dict[str, Records]:
    """The pairs by their overlap, as far as there are any."""
    inside = {overlap_title(*edges): overlapping(records, *edges) for edges in bins}
    return {title: chosen for title, chosen in inside.items() if chosen}


def tried(records: Records) -> dict[str, list[Answer]]:
    """The answers of all methods that were tried, by their titles."""
    told = {title: answers(records, method) for title, method in BY_TITLE.items()}
    return {title: of_method for title, of_method in told.items() if of_method}


def best_but_default(records: Records) -> tuple[str, list[Answer]] | None:
    """Which of the other methods is right most often, and its answers; None if all are wrong."""
    told = tried(records)
    del told[METHODS["default"].title]
    best = max(told, key=lambda title: BASIN.share(told[title]))
    return (best, told[best]) if BASIN.share(told[best]) > 0 else None


def _auc(told: Sequence[Answer]) -> str:
    given = [each for each in told if each["deg"] is not None]
    value = Stated.of((each["score"], BASIN.holds(each)) for each in given).auc
    return "-" if np.isnan(value) else f"{value:.3f}"


def _accepted(told: Sequence[Answer], wrong_only: bool) -> str:
    """How many answers the method vouches for; a dash where it does not judge its own."""
    if not any("accepted" in each for each in told):
        return "-"
    accepted = [each for each in told if each["deg"] is not None and each.get("accepted")]
    return str(sum(not (wrong_only and BASIN.holds(each)) for each in accepted))


SCORES = {
    "CPU seconds": lambda told: f"{np.median([each['seconds'] for each in told]):.2f}",
    "no answer": lambda told: str(sum(each["deg"] is None for each in told)),
    "AUC": _auc,
    "accepted": lambda told: _accepted(told, wrong_only=False),
    "accepted wrong": lambda told: _accepted(told, wrong_only=True),
}


def draw(records: Records, out: Path) -> None:
    """Share of pairs in the right basin by overlap, a line for each method."""
    bins = by_overlap(records, BINS[::-1])
    titles = [f"{title}\n{len(inside)} pairs" for title, inside in bins.items()]
    panel = Panel("", dict(enumerate(titles)))
    for title, method in BY_TITLE.items():
        shares = [BASIN.share(answers(inside, method)) for inside in bins.values()]
        panel.curves[title] = curve(method, shares)
    draw_panels(out / "real_pairs.png", [[panel]], "overlap", f"right answers, {BASIN} (%)")
