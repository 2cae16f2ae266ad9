"""Errors of right scans -> what makes their deviations bounds that hold for 95 %."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds, BoundScale
from scanweld.geometry.arrays import FloatArray

HELD = 0.95
"""Share of the scans for which a bound holds."""
SHARES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
"""Of the distance between surfaces and of cycles that are tried."""
LEAST = 1e-9
"""Errors below this are of the scan that the others are held against: it has none."""


def learn_bounds(records: Sequence[Record]) -> Bounds:
    """Of each kind of error, the bound that holds for 95 % and says most.

    That which says most is the one whose ratio to the errors varies least from scan to scan.
    """
    told = [
        scan["errors"] for record in records for scan in record.result["scans"] if "errors" in scan
    ]
    return Bounds(
        rotation=_scale(np.array([one["rotation"] for one in told])),
        translation=_scale(np.array([one["translation"] for one in told])),
    )


def _scale(told: FloatArray) -> BoundScale:
    """From errors, deviations, distances between surfaces and cycles, (N, 4)."""
    if not len(told):
        return BoundScale(factor=2.0, sigma_share=0.0, cycle_share=0.0)
    error, *parts = told[told[:, 0] > LEAST * told[:, 2]].T
    options = []
    for shares in product(SHARES, SHARES):
        weighed = [part * share for part, share in zip(parts, (1.0, *shares), strict=True)]
        ratio = np.log(error / np.sqrt(np.square(weighed).sum(axis=0)))
        factor = float(np.exp(np.quantile(ratio, HELD)))
        options.append((float(ratio.std()), factor, *shares))
    _, factor, of_sigma, of_cycle = min(options)
    return BoundScale(factor=factor, sigma_share=of_sigma, cycle_share=of_cycle)
