"""How well probabilities that are stated fit what came true."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray

NUM_BINS = 12


@dataclass(frozen=True, kw_only=True, slots=True)
class Bin:
    """Answers of about the same confidence: their mean confidence, share right, and number."""

    confidence: float
    right: float
    count: int


def reliability(
    confidences: Sequence[float], is_right: Sequence[bool], num_bins: int = NUM_BINS
) -> list[Bin]:
    """Answers in order of their confidence, in bins of equal numbers."""
    order = np.argsort(confidences, kind="stable")
    parts = [part for part in np.array_split(order, num_bins) if len(part)]
    stated, right = np.asarray(confidences, float), np.asarray(is_right, float)
    return [
        Bin(confidence=float(stated[p].mean()), right=float(right[p].mean()), count=len(p))
        for p in parts
    ]


def calibration_error(
    confidences: Sequence[float], is_right: Sequence[bool], num_bins: int = NUM_BINS
) -> float:
    """Expected calibration error: mean over all answers of their bin's gap; NaN of none."""
    bins = reliability(confidences, is_right, num_bins)
    total = sum(b.count for b in bins)
    gaps = sum(b.count * abs(b.confidence - b.right) for b in bins)
    return gaps / total if total else float("nan")


def brier(confidences: Sequence[float], is_right: Sequence[bool]) -> float:
    """Mean squared difference of confidence and truth; NaN of none."""
    if not len(confidences):
        return float("nan")
    return float(np.mean((np.asarray(confidences, float) - np.asarray(is_right, float)) ** 2))


def risk_coverage(
    confidences: Sequence[float], is_right: Sequence[bool]
) -> tuple[FloatArray, FloatArray]:
    """Share of answers that are taken, best first, and share of these that are wrong.

    Answers of the same confidence are taken together.
    """
    stated = np.asarray(confidences, float)
    order = np.argsort(-stated, kind="stable")
    wrong = np.cumsum(~np.asarray(is_right, bool)[order])
    taken = np.arange(1, len(order) + 1)
    ends = np.append(np.flatnonzero(np.diff(stated[order])), len(order) - 1)
    ends = ends[ends >= 0]
    return taken[ends] / len(order), wrong[ends] / taken[ends]
