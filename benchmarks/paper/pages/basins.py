"""What stands on the page of the basins of convergence."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.basins import DEFAULT, FROM_A_START, JOINT
from benchmarks.paper.methods import METHODS
from benchmarks.study.pages import grid, percent
from benchmarks.study.plots import Curve, Panel, draw_panels
from benchmarks.study.records import of, values_of
from benchmarks.study.study import Record
from benchmarks.study.success import Answer, Limit, cell, share_right

Records = Sequence[Record]

CONVERGED = Limit(deg=2.0, percent=1.0)
TITLES = {
    **{name: METHODS[name].title for name in FROM_A_START},
    JOINT: "joint refinement",
    DEFAULT: "default",
}
_COLORS = {name: METHODS[name].color for name in (*FROM_A_START, DEFAULT)} | {JOINT: "#9C6ADE"}
_STRONG = ("m-icc", "mm-icc", DEFAULT)


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template; the plot goes to the folder ``out``."""
    by_gap = {gap: of(records, gap=gap) for gap in values_of(records, "gap")}
    starts = {f"{start}° off": int(start) for start in records[0].result["answers"]}
    tried = next(iter(records[0].result["answers"].values()))
    methods = {title: m for m, title in TITLES.items() if m in tried or m == DEFAULT}
    _draw(by_gap, list(starts.values()), methods, out / "basins.png")

    def share(method: str) -> float:
        widest, farthest = max(by_gap), max(starts.values())
        return share_right(answers_from(by_gap[widest], farthest, method), CONVERGED)

    from_a_start = [title for title, method in methods.items() if method != DEFAULT]
    ranked = sorted(from_a_start, key=lambda title: -share(methods[title]))
    return {
        "gap": max(by_gap),
        "start": max(starts.values()),
        "ranked": ", ".join(f"{title} {percent(share(methods[title]))}" for title in ranked),
        "default": percent(share(DEFAULT)),
        "objects": " and ".join(values_of(records, "object")),
        "limit": CONVERGED,
        "tables": {
            gap: grid("method", methods, starts, partial(_cell, at_gap))
            for gap, at_gap in by_gap.items()
        },
    }


def answers_from(records: Records, start: int, method: str) -> list[Answer]:
    """Errors of a method from a start; those of the default are the same from all."""
    results = [record.result for record in records]
    if method == DEFAULT:
        return [result[DEFAULT] for result in results]
    return [result["answers"][str(start)][method] for result in results]


def _cell(records: Records, method: str, start: int) -> str:
    return cell(answers_from(records, start, method), CONVERGED)


def _draw(
    by_gap: Mapping[int, Records], starts: Sequence[int], methods: Mapping[str, str], path: Path
) -> None:
    panels = []
    for gap, records in by_gap.items():
        curves = {}
        for n, (title, method) in enumerate(methods.items()):
            told = [answers_from(records, start, method) for start in starts]
            # Curves that coincide are drawn a hair apart, so that all are seen.
            apart = 0.007 * (n - len(methods) / 2)
            curves[title] = Curve(
                places=starts,
                shares=np.array([share_right(each, CONVERGED) for each in told]) + apart,
                color=_COLORS[method],
                style="--" if method == DEFAULT else "-",
                strong=method in _STRONG,
            )
        ticks = {start: str(start) for start in starts}
        panels.append(Panel(title=f"views {gap}° apart", curves=curves, ticks=ticks))
    draw_panels(path, [panels], "start, degrees off", "right poses (%)")
