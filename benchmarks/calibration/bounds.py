"""Errors of right scans -> what makes their deviations bounds that hold for 95 %."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import lever_arm

HELD = 0.95
"""Share of the scans for which both bounds hold."""
QUANTILES = tuple(np.linspace(HELD, 0.995, 10).tolist())
"""Of rotations and of translations alone; the first by which both hold is taken."""
FLOORS = (0.0, *np.geomspace(0.25, 16.0, 13).tolist())
"""Which are tried."""
LEAST = 1e-9
"""Errors below this are of the scan that the others are held against: it has none."""


class Errors(NamedTuple):
    """What became of scans, all as shares of the diameter: rotations count at the lever arm."""

    rotations: FloatArray  # (N, 2) errors and deviations
    translations: FloatArray  # (N, 2) likewise
    correlated: FloatArray  # (N,) what neighbours share of the sensor's error


def learn_bounds(records: Sequence[Record]) -> Bounds:
    """Bounds below which so many errors lie, whatever their deviation and their sensor."""
    errors = _errors(records)
    if len(errors.correlated) < len(FLOORS):
        return Bounds(rotation=2.0, translation=2.0, floor=1.0)
    *options, widest = QUANTILES
    return next(
        (bounds for bounds in (_at(errors, q) for q in options) if _held(bounds, errors) >= HELD),
        _at(errors, widest),
    )


def _errors(records: Sequence[Record]) -> Errors:
    """Of all scans but those that others are held against, and those held against a wrong one."""
    rotations, translations, correlated = [], [], []
    for record in records:
        for scan in record.result["scans"]:
            if "errors" not in scan:
                continue
            turn, shift = (scan["errors"][what][:2] for what in ("rotation", "translation"))
            is_near = turn[0] < np.radians(RIVAL_ANGLE_DEG) and shift[0] < RIVAL_SHIFT_DIAMETERS
            if turn[0] > LEAST and is_near:
                rotations.append([lever_arm(1.0) * one for one in turn])
                translations.append(shift)
                correlated.append(record.result["sensor"]["correlated"])
    return Errors(
        np.array(rotations).reshape(-1, 2),
        np.array(translations).reshape(-1, 2),
        np.array(correlated),
    )


def _held(bounds: Bounds, errors: Errors) -> float:
    """Share of the scans of which both bounds hold."""
    holds = [
        told[:, 0] <= factor * _spread(told, errors, bounds.floor)
        for factor, told in (
            (bounds.rotation, errors.rotations),
            (bounds.translation, errors.translations),
        )
    ]
    return float(np.all(holds, axis=0).mean())


def _at(errors: Errors, quantile: float) -> Bounds:
    """Factors by quantile regression of the logarithms (Koenker & Bassett 1978).

    Unlike one factor for all, a floor makes as many bounds hold of sensors that err alike in all
    scans as of others.
    """
    fits = []
    for floor in FLOORS:
        loss, factors = 0.0, []
        for told in (errors.rotations, errors.translations):
            ratio = np.log(told[:, 0] / _spread(told, errors, floor))
            factor = np.quantile(ratio, quantile)
            loss += float(np.mean(np.maximum(quantile * (ratio - factor), 0.0)))
            loss += float(np.mean(np.maximum((1.0 - quantile) * (factor - ratio), 0.0)))
            factors.append(float(np.exp(factor)))
        fits.append((loss, floor, factors))
    _, floor, (rotation, translation) = min(fits)
    return Bounds(rotation=rotation, translation=translation, floor=floor)


def _spread(told: FloatArray, errors: Errors, floor: float) -> FloatArray:
    """What a factor makes the bounds (N,) of."""
    return np.hypot(told[:, 1], floor * errors.correlated)
