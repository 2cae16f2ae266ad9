"""Pictures of the page: what is stated against what came true."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.judging.floors import posed_pairs, scans_of
from benchmarks.judging.measures import reliability, risk_coverage
from benchmarks.judging.trial import Outcome
from scanweld.evaluation.metrics import Standing

RELIABILITY, RISK = "trust-reliability.png", "trust-risk.png"
COLORS = {"pairs": "#1B6CA8", "placed scans": "#C2274B"}

Stated = list[tuple[float, bool]]
"""Confidences, and whether they were right."""


def stated_pairs(outcomes: Sequence[Outcome]) -> Stated:
    """Of all pairs that have a pose."""
    return [(pair.confidence, pair.is_right) for pair in posed_pairs(outcomes)]


def stated_scans(outcomes: Sequence[Outcome]) -> Stated:
    """Of all placed scans: whether they are right beside the others of their component."""
    return [
        (scan.confidence, scan.standing == Standing.RIGHT and not scan.is_open)
        for scan in scans_of(outcomes)
        if scan.confidence is not None and scan.standing != Standing.UNPLACED
    ]


def draw(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Draw the reliability diagram and the risk-coverage curve into a folder."""
    stated = {"pairs": stated_pairs(outcomes), "placed scans": stated_scans(outcomes)}
    draw_stated(stated, folder / RELIABILITY, folder / RISK)


def draw_stated(stated: dict[str, Stated], reliability_png: Path, risk_png: Path) -> None:
    """Draw both of any confidences; they are named as in ``COLORS``."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5.2, 4.6))
    _draw_reliability(axes, stated)
    _save(figure, reliability_png)
    figure, axes = pyplot.subplots(figsize=(6.4, 4.2))
    _draw_risk(axes, stated)
    _save(figure, risk_png)
    pyplot.close("all")


def _draw_reliability(axes: Any, stated: dict[str, Stated]) -> None:
    axes.plot([0, 1], [0, 1], color="#8C929C", linewidth=1, linestyle="--")
    for name, each in stated.items():
        bins = reliability([c for c, _ in each], [r for _, r in each])
        axes.plot(
            [b.confidence for b in bins],
            [b.right for b in bins],
            color=COLORS[name],
            marker="o",
            markersize=4.5,
            label=f"{name} ({len(each)})",
        )
    axes.set(xlabel="confidence that is stated", ylabel="share that is right")
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    _dress(axes)


def _draw_risk(axes: Any, stated: dict[str, Stated]) -> None:
    for name, each in stated.items():
        coverage, risk = risk_coverage([c for c, _ in each], [r for _, r in each])
        axes.step(100 * coverage, 100 * risk, where="post", color=COLORS[name], label=name)
    axes.set(xlabel="taken, the most confident first (%)", ylabel="wrong among these (%)")
    axes.set(xlim=(0, 101), ylim=(-1, None))
    _dress(axes)


def _dress(axes: Any) -> None:
    axes.grid(color="#E4E6EA", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)


def _save(figure: Any, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=110)
