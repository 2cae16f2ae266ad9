"""What stands on the page of the real pairs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.methods import BY_TITLE, METHODS, curve
from benchmarks.paper.views import MADE
from benchmarks.study.pages import grid
from benchmarks.study.plots import Panel, draw_panels
from benchmarks.study.records import answers, of, overlap_title, overlapping, values_of
from benchmarks.study.study import Record
from benchmarks.study.success import Answer, Limit, auc, cell, share_right

Records = Sequence[Record]

BASIN = Limit(deg=5, percent=2)
TIGHT = Limit(deg=2, percent=1)
BINS = ((0.4, 1.01), (0.25, 0.4), (0.15, 0.25), (0.10, 0.15), (0.05, 0.10), (0.0, 0.05))
HALVES = ((0.15, 1.01), (0.05, 0.15), (0.0, 0.05))
"""What the words speak of."""


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template; the plot goes to the folder ``out``."""
    _draw(records, out / "real_pairs.png")
    by_object = {name: of(records, object=name) for name in values_of(records, "object")}
    accepted = [each for each in answers(records, "default") if each["accepted"]]
    return {
        "num": len(records),
        "counts": ", ".join(f"{len(own)} of the {name}" for name, own in by_object.items()),
        "is_made": list(by_object) == [MADE],
        "halves": {
            overlap_title(*edges): _in_words(inside)
            for edges in HALVES
            if (inside := overlapping(records, *edges))
        },
        "accepted": len(accepted),
        "accepted_wrong": sum(not BASIN.holds(answer) for answer in accepted),
        "basin": BASIN,
        "tight": TIGHT,
        "in_basin": _by_overlap(records, BASIN),
        "right": _by_overlap(records, TIGHT),
        "by_object": {
            name: _by_overlap(own, TIGHT) for name, own in by_object.items() if len(by_object) > 1
        },
        "scores": grid("", _tried(records), _SCORES, lambda told, column: column(told)),
    }


def _tried(records: Records) -> dict[str, list[Answer]]:
    """The answers of all methods that were tried, by their titles."""
    told = {title: answers(records, method) for title, method in BY_TITLE.items()}
    return {title: of_method for title, of_method in told.items() if of_method}


def _in_words(records: Records) -> dict[str, str]:
    """How often the default is right, and which of the others does best."""
    told = _tried(records)
    default = told.pop(METHODS["default"].title)
    best = max(told, key=lambda title: share_right(told[title], BASIN))
    is_any = share_right(told[best], BASIN) > 0
    return {
        "default": BASIN.count(default),
        "best": best if is_any else "",
        "best_count": BASIN.count(told[best]),
    }


def _bins(records: Records) -> dict[str, Records]:
    """The pairs by their overlap, as far as there are any."""
    inside = {overlap_title(*edges): overlapping(records, *edges) for edges in BINS}
    return {title: chosen for title, chosen in inside.items() if chosen}


def _by_overlap(records: Records, limit: Limit) -> str:
    return grid("overlap", BY_TITLE, _bins(records), lambda m, r: cell(answers(r, m), limit))


def _auc(told: Sequence[Answer]) -> str:
    given = [each for each in told if each["deg"] is not None]
    value = auc([each["score"] for each in given], [BASIN.holds(each) for each in given])
    return "-" if np.isnan(value) else f"{value:.3f}"


def _accepted(told: Sequence[Answer], wrong_only: bool) -> str:
    """How many answers the method vouches for; a dash where it does not judge its own."""
    if not any("accepted" in each for each in told):
        return "-"
    accepted = [each for each in told if each["deg"] is not None and each.get("accepted")]
    return str(sum(not (wrong_only and BASIN.holds(each)) for each in accepted))


_SCORES = {
    "CPU seconds": lambda told: f"{np.median([each['seconds'] for each in told]):.2f}",
    "no answer": lambda told: str(sum(each["deg"] is None for each in told)),
    "AUC": _auc,
    "accepted": lambda told: _accepted(told, wrong_only=False),
    "accepted wrong": lambda told: _accepted(told, wrong_only=True),
}


def _draw(records: Records, path: Path) -> None:
    """Share of pairs in the right basin by overlap, a line for each method."""
    bins = dict(reversed(_bins(records).items()))
    places = list(range(len(bins)))
    curves = {
        title: curve(
            method,
            places,
            [share_right(answers(inside, method), BASIN) for inside in bins.values()],
        )
        for title, method in BY_TITLE.items()
    }
    titles = [f"{title}\n{len(inside)} pairs" for title, inside in bins.items()]
    panel = Panel(title="", curves=curves, ticks=dict(zip(places, titles, strict=True)))
    draw_panels(path, [[panel]], "overlap", f"right answers, {BASIN} (%)")
