"""How well what is stated of answers tells right from wrong, in numbers and pictures."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from scipy.stats import mannwhitneyu

from benchmarks.study.plots import plain, save, subplots
from scanweld.geometry.arrays import BoolArray, FloatArray

NUM_BINS = 12
COLORS = {"pairs": "#1B6CA8", "placed scans": "#C2274B"}


@dataclass(frozen=True, slots=True)
class Bin:
    """Answers of about the same confidence: their mean confidence, share right, and number."""

    confidence: float
    right: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """Scores (N,) that are stated of answers, and which (N,) of these are right.

    What cannot be said of the answers there are is NaN.
    """

    scores: FloatArray
    is_right: BoolArray

    @classmethod
    def of(cls, answers: Iterable[tuple[float, bool]]) -> Self:
        """From one pair an answer."""
        scores, is_right = np.array(list(answers), dtype=float).reshape(-1, 2).T
        return cls(scores, is_right.astype(bool))

    def __len__(self) -> int:
        return len(self.scores)

    @property
    def num_right(self) -> int:
        """Number of right answers."""
        return int(self.is_right.sum())

    @property
    def auc(self) -> float:
        """Chance that a right answer has a higher score than a wrong one."""
        right, wrong = self.scores[self.is_right], self.scores[~self.is_right]
        if not len(right) or not len(wrong):
            return float("nan")
        return float(mannwhitneyu(right, wrong, method="asymptotic")[0] / len(right) / len(wrong))

    def bins(self, num_bins: int = NUM_BINS) -> list[Bin]:
        """Answers in order of their score, in bins of equal numbers."""
        order = np.argsort(self.scores, kind="stable")
        return [
            Bin(float(self.scores[part].mean()), float(self.is_right[part].mean()), len(part))
            for part in np.array_split(order, num_bins)
            if len(part)
        ]

    def calibration_error(self, num_bins: int = NUM_BINS) -> float:
        """Expected: mean over all answers of their bin's gap."""
        gaps = sum(b.count * abs(b.confidence - b.right) for b in self.bins(num_bins))
        return gaps / len(self) if len(self) else float("nan")

    @property
    def brier(self) -> float:
        """Mean squared difference of confidence and truth."""
        return float(np.mean((self.scores - self.is_right) ** 2)) if len(self) else float("nan")

    def risk_coverage(self) -> tuple[FloatArray, FloatArray]:
        """Share of answers that are taken, best first, and share of these that are wrong.

        Answers of the same score are taken together.
        """
        order = np.argsort(-self.scores, kind="stable")
        wrong, taken = np.cumsum(~self.is_right[order]), np.arange(1, len(order) + 1)
        ends = np.append(np.flatnonzero(np.diff(self.scores[order])), len(order) - 1)
        ends = ends[ends >= 0]
        return taken[ends] / len(order), wrong[ends] / taken[ends]

    @property
    def sure(self) -> float:
        """Share of the right answers that score higher than any wrong one."""
        coverage, risk = self.risk_coverage()
        taken = float(coverage[risk == 0].max(initial=0.0)) * len(self)
        return taken / self.num_right if self.num_right else float("nan")


def bound(num_runs: int) -> str:
    """What none of so many independent runs says of the rate, with 95 % confidence: below 3 / n.

    Scans of one run fail together, so that runs count and not scans.
    """
    return f"< {300 / num_runs:.2g} % of runs" if num_runs > 3 else "too few runs for a bound"


def draw(stated: Mapping[str, Stated], folder: Path, name: str) -> None:
    """Draw the reliability diagram and the risk-coverage curve of what ``COLORS`` names."""
    figure, axes = subplots(figsize=(5.2, 4.6))
    axes.plot([0, 1], [0, 1], color="#8C929C", linewidth=1, linestyle="--")
    for label, each in stated.items():
        x, y = zip(*((b.confidence, b.right) for b in each.bins()), strict=True)
        style = {"color": COLORS[label], "marker": "o", "markersize": 4.5}
        axes.plot(x, y, label=f"{label} ({len(each)})", **style)
    axes.set(xlabel="confidence that is stated", ylabel="share that is right")
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    _save(figure, axes, folder / f"{name}-reliability.png")

    figure, axes = subplots(figsize=(6.4, 4.2))
    for label, each in stated.items():
        coverage, risk = each.risk_coverage()
        axes.step(100 * coverage, 100 * risk, where="post", color=COLORS[label], label=label)
    axes.set(xlabel="taken, the most confident first (%)", ylabel="wrong among these (%)")
    axes.set(xlim=(0, 101), ylim=(-1, None))
    _save(figure, axes, folder / f"{name}-risk.png")


def _save(figure: Any, axes: Any, path: Path) -> None:
    plain(axes)
    axes.legend(frameon=False)
    save(figure, path)
