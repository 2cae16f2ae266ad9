"""Pictures of confidences: what is stated against what came true."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.scores import Stated

COLORS = {"pairs": "#1B6CA8", "placed scans": "#C2274B"}


def draw(stated: Mapping[str, Stated], folder: Path, name: str) -> None:
    """Draw the reliability diagram and the risk-coverage curve of what ``COLORS`` names."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5.2, 4.6))
    axes.plot([0, 1], [0, 1], color="#8C929C", linewidth=1, linestyle="--")
    for label, each in stated.items():
        x, y = zip(*((b.confidence, b.right) for b in each.bins()), strict=True)
        style = {"color": COLORS[label], "marker": "o", "markersize": 4.5}
        axes.plot(x, y, label=f"{label} ({len(each)})", **style)
    axes.set(xlabel="confidence that is stated", ylabel="share that is right")
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    _save(figure, axes, folder / f"{name}-reliability.png")

    figure, axes = pyplot.subplots(figsize=(6.4, 4.2))
    for label, each in stated.items():
        coverage, risk = each.risk_coverage()
        axes.step(100 * coverage, 100 * risk, where="post", color=COLORS[label], label=label)
    axes.set(xlabel="taken, the most confident first (%)", ylabel="wrong among these (%)")
    axes.set(xlim=(0, 101), ylim=(-1, None))
    _save(figure, axes, folder / f"{name}-risk.png")
    pyplot.close("all")


def _save(figure: Any, axes: Any, path: Path) -> None:
    axes.grid(color="#E4E6EA", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
