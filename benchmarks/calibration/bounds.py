"""Errors of right scans -> what makes their deviations bounds that hold for 95 %."""

from collections.abc import Sequence

import numpy as np

from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds, BoundScale
from scanweld.geometry.arrays import FloatArray

HELD = 0.95
"""Share of the scans for which a bound holds."""
SHARES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2)
"""Of the distance between surfaces, that are tried."""
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
    """From errors, deviations and distances between surfaces, (N, 3)."""
    if not len(told):
        return BoundScale(factor=2.0, share=0.0)
    error, deviation, sigma = told[told[:, 0] > LEAST * told[:, 2]].T
    options = []
    for share in SHARES:
        ratio = np.log(error / np.hypot(deviation, share * sigma))
        options.append((float(ratio.std()), float(np.exp(np.quantile(ratio, HELD))), share))
    _, factor, share = min(options)
    return BoundScale(factor=factor, share=share)
