"""The page of the real pairs: what its records say."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.paper.lines import ORDER, draw_shares, dress
from benchmarks.paper.methods import METHODS
from benchmarks.paper.optional import need
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.picks import (
    of,
    overlap_title,
    overlapping,
    sentence_on_missing,
    told_by,
    values,
)
from benchmarks.paper.study import Record
from benchmarks.paper.success import Limit, auc, cell, share_right

BASIN = Limit(deg=5, percent=2)
TIGHT = Limit(deg=2, percent=1)
BINS = ((0.4, 1.01), (0.25, 0.4), (0.15, 0.25), (0.10, 0.15), (0.05, 0.10), (0.0, 0.05))
HALVES = ((0.15, 1.01), (0.05, 0.15), (0.0, 0.05))
"""What the words speak of."""
_PLOT = "real_pairs.png"
_STARTS = """\
Methods that need a start begin at a random rotation, with the middles of both scans on each other.
Errors are taken at the middle of the second scan, in degrees and in % of the object's diameter.
"""
_REAL = f"""\
Every scan is moved by a random rotation and shift, and its grid turned by quarter turns.
{_STARTS}They are held against the reference poses of the data; the overlap of a pair is the smaller
of its two in the data's `overlaps.csv`. CPD is slow, and is tried on a few pairs only.
"""
_STAND_INS = f"""\
**A quick run: virtual scans with noise of an object that the project makes stand in for the real
ones.** {_STARTS}"""


def tell(records: Sequence[Record], out: Path) -> str:
    """The page as Markdown; its plot goes to the folder ``out``."""
    _plot(records, out / _PLOT)
    objects = values(records, "object")
    parts = [
        _introduction(records, objects),
        "## What it shows\n",
        _words(records),
        f"![Share of pairs in the right basin by overlap]({_PLOT})\n",
        f"## In the right basin: {BASIN}\n",
        "Right of all, and the median rotation error of the right ones in degrees.\n",
        _by_overlap(records, BASIN),
        f"## Right to {TIGHT}\n",
        _by_overlap(records, TIGHT),
        *(
            f"### {name}\n\n" + _by_overlap(of(records, object=name), TIGHT)
            for name in objects
            if len(objects) > 1
        ),
        "## Time, and how far the score can be trusted\n",
        _scores(records),
    ]
    return "\n".join(parts)


def _introduction(records: Sequence[Record], objects: Sequence[str]) -> str:
    counts = ", ".join(f"{len(of(records, object=name))} of the {name}" for name in objects)
    text = _STAND_INS if objects == ["creature"] else _REAL
    return f"{len(records)} pairs: {counts}. {text}{sentence_on_missing(records)}"


def _words(records: Sequence[Record]) -> str:
    """The default beside the best of the others, counted from the records."""
    lines = []
    for low, high in HALVES:
        inside = overlapping(records, low, high)
        if inside:
            told = f"the default is right in {_count(inside, 'default')} pairs"
            lines.append(f"- Overlap {overlap_title(low, high)}: {told}; {_best_other(inside)}.")
    accepted = [told for told in told_by(records, "default") if told["accepted"]]
    num_wrong = sum(not BASIN.holds(told) for told in accepted)
    lines.append(f"- The default vouches for {len(accepted)} answers; {num_wrong} are wrong.")
    return "\n".join(lines) + "\n"


def _best_other(records: Sequence[Record]) -> str:
    others = [m for m in ORDER if m != "default" and told_by(records, m)]
    best = max(others, key=lambda method: share_right(told_by(records, method), BASIN))
    if not share_right(told_by(records, best), BASIN):
        return "no other method is right in any"
    return f"of the others {METHODS[best].title} does best, {_count(records, best)}"


def _count(records: Sequence[Record], method: str) -> str:
    told = told_by(records, method)
    return f"{sum(BASIN.holds(each) for each in told)} of {len(told)}"


def _by_overlap(records: Sequence[Record], limit: Limit) -> str:
    bins = [(low, high) for low, high in BINS if overlapping(records, low, high)]
    rows = [
        (
            METHODS[method].title,
            *(cell(told_by(overlapping(records, low, high), method), limit) for low, high in bins),
        )
        for method in ORDER
        if told_by(records, method)
    ]
    headings = ("overlap", *(overlap_title(low, high) for low, high in bins))
    return markdown_table(headings, rows)


def _scores(records: Sequence[Record]) -> str:
    rows = []
    for method in ORDER:
        told = told_by(records, method)
        if not told:
            continue
        given = [each for each in told if each["deg"] is not None]
        is_right = [BASIN.holds(each) for each in given]
        value = auc([each["score"] for each in given], is_right)
        accepted = [each for each in given if each.get("accepted")]
        judged = any("accepted" in each for each in told)
        rows.append(
            (
                METHODS[method].title,
                f"{np.median([each['seconds'] for each in told]):.2f}",
                f"{len(told) - len(given)}",
                "-" if np.isnan(value) else f"{value:.3f}",
                f"{len(accepted)}" if judged else "-",
                f"{sum(not BASIN.holds(each) for each in accepted)}" if judged else "-",
            )
        )
    headings = ("", "CPU seconds", "no answer", "AUC", "accepted", "accepted wrong")
    text = f"""\
Seconds are medians on one core, both scans prepared, and whatever else a method needs included.
AUC: the chance that a right answer ({BASIN}) has a higher score than a wrong one, by the
method's own score; 0.5 says nothing. Answers that a method itself withholds do not count in it.

"""
    return text + markdown_table(headings, rows)


def _plot(records: Sequence[Record], path: Path) -> None:
    """Share of pairs in the right basin by overlap, a line for each method."""
    need("matplotlib").use("Agg")
    from matplotlib import pyplot

    bins = [(low, high) for low, high in reversed(BINS) if overlapping(records, low, high)]
    figure, axes = pyplot.subplots(figsize=(9, 4.6))
    for method in ORDER:
        told = [told_by(overlapping(records, low, high), method) for low, high in bins]
        places = [place for place, answers in enumerate(told) if answers]
        if places:
            draw_shares(axes, method, places, [share_right(told[place], BASIN) for place in places])
    counts = [len(overlapping(records, low, high)) for low, high in bins]
    labels = [f"{overlap_title(*edges)}\n{n} pairs" for edges, n in zip(bins, counts, strict=True)]
    axes.set_xticks(range(len(bins)), labels)
    axes.set(xlabel="overlap", ylabel=f"right answers, {BASIN} (%)")
    dress(axes)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False, fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
