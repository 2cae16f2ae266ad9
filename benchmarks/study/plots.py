"""Plots of shares: a panel for each case, a curve for each method."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.study.optional import need
from scanweld.geometry.arrays import FloatArray

GRID = {"color": "#E4E6EA", "linewidth": 0.8}
Curve = tuple[Sequence[float] | FloatArray, Mapping[str, Any]]
"""Shares from 0 to 1, one a tick, NaN where there is none; how the line looks."""


class Panel(NamedTuple):
    """Curves by their titles, over ticks: places on the axis and their names."""

    title: str
    ticks: Mapping[int, str]
    curves: Mapping[str, Curve]


def subplots(*shape: int, **settings: Any) -> tuple[Any, Any]:
    """A new figure of matplotlib and its axes.

    Raises:
        InputError: If matplotlib is not installed.
    """
    need("matplotlib").use("Agg")
    return need("matplotlib.pyplot").subplots(*shape, **settings)


def plain(axes: Any) -> None:
    """Axes with a faint grid and no box."""
    axes.grid(**GRID)
    axes.spines[["top", "right"]].set_visible(False)


def save(figure: Any, path: Path, rect: Sequence[float] = (0, 0, 1, 1), **how: Any) -> None:
    """Write a figure, without space around its contents but what the rectangle leaves."""
    figure.tight_layout(rect=rect)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110, **how)
    need("matplotlib.pyplot").close(figure)


def draw_panels(path: Path, rows: Sequence[Sequence[Panel]], x_title: str, y_title: str) -> None:
    """Draw panels in rows, with one legend to the right of all."""
    width, height = 3.6 * len(rows[0]) + 2.6, 3.6 * len(rows) + 0.4
    figure, axes = subplots(
        len(rows), len(rows[0]), figsize=(width, height), sharey=True, squeeze=False
    )
    lines: dict[str, Any] = {}
    for row, panels in zip(axes, rows, strict=True):
        row[0].set_ylabel(y_title)
        for panel_axes, panel in zip(row, panels, strict=True):
            lines |= _drawn(panel_axes, panel)
            panel_axes.set_xlabel(x_title)
    figure.legend(lines.values(), lines.keys(), loc="center right", frameon=False, fontsize=9)
    save(figure, path, (0, 0, 1 - 2.1 / width, 1), metadata={"Software": None})


def _drawn(axes: Any, panel: Panel) -> dict[str, Any]:
    """Draw the curves of a panel, where they have any share; the lines by their titles."""
    lines = {}
    for title, (shares, look) in panel.curves.items():
        known = np.isfinite(shares)
        if known.any():
            xy = np.array(list(panel.ticks))[known], 100 * np.asarray(shares)[known]
            style = {"marker": "o", "markersize": 3.5, "linewidth": 1.4, **look}
            [lines[title]] = axes.plot(*xy, **style)
    axes.set(title=panel.title, ylim=(-4, 104))
    axes.set_xticks(list(panel.ticks), list(panel.ticks.values()))
    plain(axes)
    return lines
