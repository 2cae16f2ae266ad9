"""The residuals' histogram as bars to be drawn."""

from dataclasses import dataclass

import numpy as np

from scanweld.app.html_report.style import STYLE
from scanweld.geometry.arrays import FloatArray


@dataclass(frozen=True, kw_only=True, slots=True)
class Histogram:
    """Bars of equal width from 0 to ``largest``, and what is read off the residuals.

    Attributes:
        shares: Of all residuals in each bar.
        largest: Right end of the axis, in the scans' unit; the last bar holds all beyond.
        median: Half of the residuals are smaller,
        p90: 90 % are,
        p99: 99 % are.
        count: Residuals.
    """

    shares: tuple[float, ...]
    largest: float
    median: float
    p90: float
    p99: float
    count: int


def histogram(distances: FloatArray) -> Histogram | None:
    """The histogram of distances (N,) without sign; None where there are none."""
    if not len(distances):
        return None
    median, p90, p99 = (float(value) for value in np.quantile(distances, [0.5, 0.9, 0.99]))
    largest = p99 or 1.0
    within, bars = np.minimum(distances, largest), STYLE.histogram_bars
    counts, _ = np.histogram(within, bars, range=(0.0, largest))
    return Histogram(
        shares=tuple((counts / len(distances)).tolist()),
        largest=largest,
        median=median,
        p90=p90,
        p99=p99,
        count=len(distances),
    )
