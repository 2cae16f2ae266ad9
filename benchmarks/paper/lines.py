"""How tables order methods, and plots of shares draw them."""

from collections.abc import Sequence
from typing import Any

from benchmarks.paper.methods import METHODS

ORDER = (
    *("icp", "trimmed-icp", "point-to-plane", "gicp", "cpd", "m-icc", "mm-icc"),
    *("paper-coarse", "paper", "fpfh-ransac", "fgr", "kiss-gicp", "default"),
)
COLORS = {
    "default": "#1B6CA8",
    "paper": "#C2274B",
    "paper-coarse": "#E59AAA",
    "mm-icc": "#B8860B",
    "m-icc": "#E3B04B",
    "fpfh-ransac": "#3B7D4F",
    "fgr": "#7FB38A",
    "kiss-gicp": "#7A4FA3",
    "gicp": "#555B66",
    "point-to-plane": "#737880",
    "trimmed-icp": "#8C929C",
    "icp": "#B4B9C1",
    "cpd": "#D5D8DD",
}
"""The project's own in strong colours, what needs a start in greys."""
_BOLD = ("default", "paper")


def draw_shares(axes: Any, method: str, places: Sequence[float], shares: Sequence[float]) -> Any:
    """Draw a method's shares into axes of matplotlib, as percentages; the line bears its title."""
    bold = method in _BOLD
    [line] = axes.plot(
        places,
        [100 * share for share in shares],
        label=METHODS[method].title,
        color=COLORS[method],
        linewidth=2.6 if bold else 1.4,
        marker="o",
        markersize=3.5,
        zorder=3 if bold else 2,
    )
    return line


def dress(axes: Any) -> None:
    """A quiet grid and no box, for shares from 0 to 100 percent."""
    axes.set_ylim(-4, 104)
    axes.grid(color="#E4E6EA", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
