"""Errors of right scans -> what makes their deviations bounds that hold for 95 %."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog

from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds, BoundScale
from scanweld.geometry.arrays import BoolArray, FloatArray

HELD = 0.95
"""Share of the scans for which both bounds hold."""
QUANTILES = tuple(np.linspace(HELD, 0.995, 10).tolist())
"""Of rotations and of translations alone; the first by which both hold is taken."""
LEAST = 1e-9
"""Errors below this are of the scan that the others are held against: it has none."""


def learn_bounds(records: Sequence[Record]) -> Bounds:
    """Bounds below which so many errors lie, whatever their deviation and their sensor."""
    scans = [scan for record in records for scan in record.result["scans"]]
    told = [scan["errors"] for scan in scans if "errors" in scan]
    rotations, translations = (
        np.array([one[what] for one in told]).reshape(-1, 3) for what in ("rotation", "translation")
    )

    def at(quantile: float) -> Bounds:
        return Bounds(
            rotation=_scale(rotations, quantile), translation=_scale(translations, quantile)
        )

    def held(bounds: Bounds) -> float:
        both = _holds(bounds.rotation, rotations) & _holds(bounds.translation, translations)
        return float(both.mean()) if len(both) else 1.0

    *options, widest = QUANTILES
    return next((bounds for bounds in map(at, options) if held(bounds) >= HELD), at(widest))


def _holds(scale: BoundScale, told: FloatArray) -> BoolArray:
    """Whether bounds hold, (N,), of errors, deviations and distances between surfaces (N, 3)."""
    return np.array([error <= scale.bound(*by) for error, *by in told.tolist()], dtype=bool)


def _scale(told: FloatArray, quantile: float) -> BoundScale:
    """Powers and factor by quantile regression of the logarithms (Koenker & Bassett 1978).

    Unlike powers by least squares and one factor for all, they make as many bounds hold of exact
    sensors as of coarse ones.
    """
    told = told[told[:, 0] > LEAST]
    if len(told) < 3:
        return BoundScale(factor=2.0, of_deviation=1.0, of_sigma=0.0)
    error, deviation, sigma = np.log(told).T
    count = len(told)
    terms = np.column_stack([np.ones(count), deviation, sigma])
    costs = np.concatenate([np.zeros(3), np.full(count, quantile), np.full(count, 1.0 - quantile)])
    parts = np.hstack([terms, np.eye(count), -np.eye(count)])
    limits = [(None, None), (0.0, None), (0.0, None), *([(0.0, None)] * (2 * count))]
    log_factor, of_deviation, of_sigma = linprog(costs, A_eq=parts, b_eq=error, bounds=limits).x[:3]
    return BoundScale(
        factor=float(np.exp(log_factor)),
        of_deviation=float(of_deviation),
        of_sigma=float(of_sigma),
    )
