"""Pairs of real scans from any start, all methods."""

import zlib

from benchmarks.paper.methods import METHODS, need_all, try_methods
from benchmarks.paper.views import (
    MADE,
    KnownPair,
    data_file,
    known_pair,
    overlap_of,
    real_pair,
    virtual_scan,
)
from benchmarks.sets import OBJECTS, overlaps_of
from benchmarks.study.study import Result, Unit

NAME = "real_pairs"

MAX_GAP_DEG = {"bunny": 360.0, "dragon": 121.0}
"""Largest rotation between the scans of a pair of each object."""
QUICK_GAPS = (40, 80)
QUICK_NOISE = 1e-3
QUICK_ROLL_DEG = 130.0
CPD_STEP = 12
"""CPD takes as long as all others together: it is tried on every so-many-th pair."""


def units(quick: bool) -> list[Unit]:
    """All pairs of the bunny, and those of the dragon that are not too far apart."""
    if quick:
        return [{"object": MADE, "i": 0, "j": gap, "cpd": False} for gap in QUICK_GAPS]
    need_all(METHODS)
    pairs = [
        {"object": name, **row}
        for name, of in OBJECTS.items()
        for row in overlaps_of(data_file(f"{of.folder}/overlaps.csv").parent)
        if row["gap"] <= MAX_GAP_DEG[name] and {row["i"], row["j"]} <= set(of.scans)
    ]
    return [{**pair, "cpd": number % CPD_STEP == 0} for number, pair in enumerate(pairs)]


def measure(unit: Unit) -> Result:
    """Register one pair by all methods from a random start."""
    name, i, j = (unit[key] for key in ("object", "i", "j"))
    seed = zlib.crc32(f"{name} {i} {j}".encode()) >> 1
    if name == MADE:
        pair, overlap = _virtual_pair(i, j), overlap_of(MADE, i, j)
    else:
        of = OBJECTS[name]
        pair, overlap = real_pair(of.folder, of.scans, i, j), unit["overlap"]
    methods = [method for method in METHODS if method != "cpd" or unit["cpd"]]
    return {"overlap": overlap, "answers": try_methods(methods, pair, pair.any_start(seed), seed)}


def _virtual_pair(i: int, j: int) -> KnownPair:
    """Virtual scans with noise that stand in where there are no data."""
    return known_pair(
        virtual_scan(MADE, i, noise=QUICK_NOISE, seed=i),
        virtual_scan(MADE, j, noise=QUICK_NOISE, seed=j, roll_deg=QUICK_ROLL_DEG),
    )
