"""The residuals' histogram as bars to be drawn."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray

NUM_BINS = 40
SHOWN_SHARE = 0.995
"""Share of the residuals that the axis covers; the last bar holds the rest as well."""
MIN_POINTS = 10


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
    """The histogram of distances (N,) without sign; None where there are too few."""
    if len(distances) < MIN_POINTS:
        return None
    median, p90, p99, largest = (
        float(value) for value in np.quantile(distances, [0.5, 0.9, 0.99, SHOWN_SHARE])
    )
    largest = largest or 1.0
    counts, _ = np.histogram(np.minimum(distances, largest), NUM_BINS, range=(0.0, largest))
    return Histogram(
        shares=tuple((counts / len(distances)).tolist()),
        largest=largest,
        median=median,
        p90=p90,
        p99=p99,
        count=len(distances),
    )
