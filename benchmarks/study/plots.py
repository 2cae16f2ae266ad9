"""Plots of shares: a panel for each case, a curve for each method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.study.optional import need
from scanweld.geometry.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Curve:
    """Shares from 0 to 1, one a tick, NaN where there is none; how the line looks."""

    shares: Sequence[float] | FloatArray
    color: str
    style: str = "-"
    is_strong: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves by their titles, over ticks: places on the axis and their names."""

    title: str
    ticks: Mapping[int, str]
    curves: dict[str, Curve] = field(default_factory=dict)


def draw_panels(path: Path, rows: Sequence[Sequence[Panel]], x_title: str, y_title: str) -> None:
    """Draw panels in rows, with one legend to the right of all.

    Raises:
        InputError: If matplotlib is not installed.
    """
    need("matplotlib").use("Agg")
    pyplot = need("matplotlib.pyplot")
    width, height = 3.6 * len(rows[0]) + 2.6, 3.6 * len(rows) + 0.4
    figure, axes = pyplot.subplots(
        len(rows), len(rows[0]), figsize=(width, height), sharey=True, squeeze=False
    )
    lines: dict[str, Any] = {}
    for row, panels in zip(axes, rows, strict=True):
        row[0].set_ylabel(y_title)
        for panel_axes, panel in zip(row, panels, strict=True):
            lines |= _drawn(panel_axes, panel)
            panel_axes.set_xlabel(x_title)
    figure.legend(lines.values(), lines.keys(), loc="center right", frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0, 1 - 2.1 / width, 1))
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)


def _drawn(axes: Any, panel: Panel) -> dict[str, Any]:
    """Draw the curves of a panel, where they have any share; the lines by their titles."""
    lines = {}
    for title, curve in panel.curves.items():
        shares = 100 * np.asarray(curve.shares)
        known = np.isfinite(shares)
        if known.any():
            strength = {"linewidth": 2.6, "zorder": 3} if curve.is_strong else {"linewidth": 1.4}
            places = np.array(list(panel.ticks))[known]
            [lines[title]] = axes.plot(
                places, shares[known], curve.style, color=curve.color, marker="o", markersize=3.5,
                **strength,
            )  # fmt: skip
    axes.set(title=panel.title, ylim=(-4, 104))
    axes.set_xticks(list(panel.ticks), list(panel.ticks.values()))
    axes.grid(color="#E4E6EA", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    return lines
