"""Errors of right scans -> what makes their deviations bounds that hold for 95 %."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.calibration.scenes import is_stereo
from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.gauss_newton import lever_arm

HELD = 0.95
"""Share of the scans for which both bounds hold,"""
HELD_EACH = 0.9
"""and of those of each kind of sensor."""
QUANTILES = tuple(np.linspace(HELD, 0.995, 10).tolist())
"""Of rotations and of translations alone, which are tried,"""
FLOORS = (0.0, *np.geomspace(0.25, 16.0, 13).tolist())
"""and floors."""
UNKNOWN = Bounds(rotation=4.0, translation=4.0, floor=1.0)
"""Where no scan is right, or none of these suffice."""
FARTHEST_TURN = lever_arm(1.0) * np.radians(RIVAL_ANGLE_DEG)
"""Rotations by which poses are rivals, as a share of the diameter."""
LEAST = 1e-9
"""Errors below this are of the scan that the others are held against: it has none."""


class Errors(NamedTuple):
    """What became of scans, all as shares of the diameter: rotations count at the lever arm."""

    rotations: FloatArray  # (N, 2) errors and deviations
    translations: FloatArray  # (N, 2) likewise
    correlated: FloatArray  # (N,) what neighbours share of the sensor's error
    is_stereo: BoolArray  # (N,)


def learn_bounds(records: Sequence[Record]) -> Bounds:
    """The tightest bounds of which enough hold, of all scans and of each kind of sensor.

    A floor makes as many hold of sensors that err alike in all scans as of others.
    """
    errors = _errors(records)
    if not len(errors.correlated):
        return UNKNOWN
    options = [
        bounds
        for floor in FLOORS
        for bounds in (_at(errors, quantile, floor) for quantile in QUANTILES)
        if _suffice(bounds, errors)
    ]
    return min(options, default=UNKNOWN, key=lambda bounds: _width(bounds, errors))


def _errors(records: Sequence[Record]) -> Errors:
    """Of all scans but those that others are held against, and those held against a wrong one."""
    rotations, translations, correlated, stereo = [], [], [], []
    for record in records:
        for scan in record.result["scans"]:
            if "errors" not in scan:
                continue
            turn, shift = (scan["errors"][what] for what in ("rotation", "translation"))
            if turn[0] > LEAST and turn[0] < FARTHEST_TURN and shift[0] < RIVAL_SHIFT_DIAMETERS:
                rotations.append(turn)
                translations.append(shift)
                correlated.append(scan["errors"]["correlated"])
                stereo.append(is_stereo(record.unit["seed"]))
    return Errors(
        np.array(rotations).reshape(-1, 2),
        np.array(translations).reshape(-1, 2),
        np.array(correlated),
        np.array(stereo, dtype=bool),
    )


def _suffice(bounds: Bounds, errors: Errors) -> bool:
    """Whether both bounds hold of as many scans as they should."""
    holds = [
        told[:, 0] <= factor * _spread(told, errors, bounds.floor)
        for factor, told in (
            (bounds.rotation, errors.rotations),
            (bounds.translation, errors.translations),
        )
    ]
    both = np.all(holds, axis=0)
    kinds = [both[errors.is_stereo == kind] for kind in (True, False)]
    return both.mean() >= HELD and all(kind.mean() >= HELD_EACH for kind in kinds if len(kind))


def _at(errors: Errors, quantile: float, floor: float) -> Bounds:
    """Bounds with that floor, of which that share holds of rotations and of translations."""
    rotation, translation = (
        float(np.quantile(told[:, 0] / _spread(told, errors, floor), quantile))
        for told in (errors.rotations, errors.translations)
    )
    return Bounds(rotation=rotation, translation=translation, floor=floor)


def _width(bounds: Bounds, errors: Errors) -> float:
    """How wide bounds are, as a mean of logarithms."""
    rotations = bounds.rotation * _spread(errors.rotations, errors, bounds.floor)
    translations = bounds.translation * _spread(errors.translations, errors, bounds.floor)
    return float(np.log(rotations).mean() + np.log(translations).mean())


def _spread(told: FloatArray, errors: Errors, floor: float) -> FloatArray:
    """What a factor makes the bounds (N,) of."""
    return np.hypot(told[:, 1], floor * errors.correlated)
