"""Errors of right scans -> what makes their deviations bounds that hold for 95 %."""

from collections.abc import Sequence

import numpy as np

from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds, BoundScale
from scanweld.geometry.arrays import FloatArray

HELD = 0.95
"""Share of the scans for which a bound holds."""
LEAST = 1e-9
"""Errors below this are of the scan that the others are held against: it has none."""


def learn_bounds(records: Sequence[Record]) -> Bounds:
    """Powers by least squares over the logarithms; then a factor by which 95 % are bounded."""
    scans = [scan for record in records for scan in record.result["scans"]]
    told = [scan["errors"] for scan in scans if "errors" in scan]
    return Bounds(
        rotation=_scale(np.array([one["rotation"] for one in told])),
        translation=_scale(np.array([one["translation"] for one in told])),
    )


def _scale(told: FloatArray) -> BoundScale:
    """From errors, deviations and distances between surfaces, (N, 3)."""
    told = told[told[:, 0] > LEAST] if len(told) else told
    if len(told) < 3:
        return BoundScale(factor=2.0, of_deviation=1.0, of_sigma=0.0)
    error, deviation, sigma = np.log(told).T
    terms = np.column_stack([np.ones(len(told)), deviation, sigma])
    (_, of_deviation, of_sigma), *_ = np.linalg.lstsq(terms, error, rcond=None)
    left = error - of_deviation * deviation - of_sigma * sigma
    return BoundScale(
        factor=float(np.exp(np.quantile(left, HELD))),
        of_deviation=float(of_deviation),
        of_sigma=float(of_sigma),
    )
