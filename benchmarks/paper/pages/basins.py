"""What the page of the basins of convergence tells of its records."""

from pathlib import Path

import numpy as np

from benchmarks.paper.basins import DEFAULT, FROM_A_START, JOINT
from benchmarks.paper.methods import METHODS
from benchmarks.study.plots import Curve, Panel, draw_panels
from benchmarks.study.records import Answer, Limit, Records, grouped, of, values_of

CONVERGED = Limit(deg=2.0, percent=1.0)
TITLES = {METHODS[name].title: name for name in FROM_A_START}
TITLES |= {"joint refinement": JOINT, "default": DEFAULT}
_COLORS = {name: METHODS[name].color for name in (*FROM_A_START, DEFAULT)} | {JOINT: "#9C6ADE"}
_STRONG = ("m-icc", "mm-icc", DEFAULT)


def starts_of(records: Records) -> dict[str, int]:
    """How far off the starts are, in degrees, by their titles."""
    return {f"{start}° off": int(start) for start in records[0].result["answers"]}


def methods_of(records: Records) -> dict[str, str]:
    """The methods that were tried, by their titles."""
    tried = {DEFAULT, *next(iter(records[0].result["answers"].values()))}
    return {title: method for title, method in TITLES.items() if method in tried}


def answers_from(records: Records, start: int, method: str) -> list[Answer]:
    """Errors of a method from a start; those of the default are the same from all."""
    results = [record.result for record in records]
    if method == DEFAULT:
        return [result[DEFAULT] for result in results]
    return [result["answers"][str(start)][method] for result in results]


def hardest(records: Records) -> dict[str, float]:
    """Shares that come right from the farthest start at the widest gap, the highest first."""
    widest = of(records, gap=max(values_of(records, "gap")))
    farthest = max(starts_of(records).values())
    shares = {
        title: CONVERGED.share(answers_from(widest, farthest, method))
        for title, method in methods_of(records).items()
    }
    return dict(sorted(shares.items(), key=lambda entry: -entry[1]))


def draw(records: Records, out: Path) -> None:
    """Share of right answers against the start, a panel for each gap."""
    starts, methods = starts_of(records).values(), methods_of(records)
    panels = []
    for title, at_gap in grouped(records, "gap", "views {}° apart").items():
        panel = Panel(title, {start: str(start) for start in starts})
        for n, (name, method) in enumerate(methods.items()):
            told = [CONVERGED.share(answers_from(at_gap, start, method)) for start in starts]
            # Curves that coincide are drawn a hair apart, so that all are seen.
            shares = np.array(told) + 0.007 * (n - len(methods) / 2)
            style = "--" if method == DEFAULT else "-"
            panel.curves[name] = Curve(shares, _COLORS[method], style, method in _STRONG)
        panels.append(panel)
    draw_panels(out / "basins.png", [panels], "start, degrees off", "right poses (%)")
