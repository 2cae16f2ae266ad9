"""Bounds learnt from drawn errors hold for others drawn alike, of each kind of sensor."""

import numpy as np

from benchmarks.calibration.bounds import learn_bounds
from benchmarks.calibration.scenes import is_stereo
from benchmarks.kept import Record
from scanweld.confidence.bounds import Bounds
from scanweld.geometry.arrays import FloatArray

SHARED = 3.0
"""How much larger the error that all scans of a stereo camera share is than that of neighbours."""


def drawn(seed: int, rng: np.random.Generator) -> Record:
    """Four scans of a set; the last two are those that others are held against, and a wrong one."""
    deviation = 10 ** rng.uniform(-4.0, -2.5)
    correlated = 2e-3 if is_stereo(seed) else 1e-5
    spread = np.hypot(deviation, SHARED * correlated)
    scans = []
    for _ in range(4):
        turn, shift = (spread * abs(rng.normal(size=2))).tolist()
        errors = {"rotation": [turn, deviation], "translation": [shift, deviation]}
        scans.append({"errors": {**errors, "correlated": correlated}})
    scans[2]["errors"]["rotation"][0] = scans[2]["errors"]["translation"][0] = 0.0
    scans[3]["errors"]["rotation"][0] = 0.5
    return Record(unit={"seed": seed}, result={"scans": scans})


def held(bounds: Bounds, records: list[Record]) -> FloatArray:
    """Which hold, (N,), of the scans that are neither."""
    holds = []
    for errors in (scan["errors"] for record in records for scan in record.result["scans"][:2]):
        floor = bounds.floor * errors["correlated"]
        (turn, turned), (shift, shifted) = errors["rotation"], errors["translation"]
        is_turn_held = turn <= bounds.rotation * np.hypot(turned, floor)
        holds.append(is_turn_held and shift <= bounds.translation * np.hypot(shifted, floor))
    return np.array(holds)


def test_bounds_hold_for_other_scans_of_each_kind_of_sensor():
    rng = np.random.default_rng(3)
    records, others = ([drawn(seed, rng) for seed in range(600)] for _ in range(2))
    bounds = learn_bounds(records)
    stereo = np.repeat([is_stereo(record.unit["seed"]) for record in others], 2)
    holds = held(bounds, others)
    assert 0.93 <= holds.mean() <= 0.98
    assert holds[stereo].mean() >= 0.87
    assert 1.0 < bounds.floor < 9.0
    assert 1.9 < bounds.rotation < 4.0, "errors are normal: two to three deviations"


def test_without_right_scans_bounds_are_wide():
    bounds = learn_bounds([Record(unit={"seed": 0}, result={"scans": [{}]})])
    assert bounds.rotation >= 3.0 and bounds.translation >= 3.0
