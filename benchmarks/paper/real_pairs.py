"""Pairs of real scans from any start, all methods."""

import zlib

from benchmarks.paper.methods import METHODS, need_all, try_methods
from benchmarks.paper.real import overlaps_of, real_pair
from benchmarks.paper.views import MADE, KnownPair, known_pair, overlap_of, virtual_scan
from benchmarks.sets import BUNNY, dragon
from benchmarks.study.study import Result, Unit

NAME = "real_pairs"

REAL = {
    "bunny": ("stanford-bunny", BUNNY, 360.0),
    "dragon": ("stanford-dragon", dragon(24), 121.0),
}
"""Object -> folder, scans, largest rotation between the scans of a pair in degrees."""
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
        for name, (folder, names, max_gap_deg) in REAL.items()
        for row in overlaps_of(folder)
        if row["gap"] <= max_gap_deg and {row["i"], row["j"]} <= set(names)
    ]
    return [{**pair, "cpd": number % CPD_STEP == 0} for number, pair in enumerate(pairs)]


def measure(unit: Unit) -> Result:
    """Register one pair by all methods from a random start."""
    name, i, j = (unit[key] for key in ("object", "i", "j"))
    seed = zlib.crc32(f"{name} {i} {j}".encode()) >> 1
    if name == MADE:
        pair, overlap = _virtual_pair(i, j), overlap_of(MADE, i, j)
    else:
        folder, names, _ = REAL[name]
        pair, overlap = real_pair(folder, tuple(names), i, j), unit["overlap"]
    methods = [method for method in METHODS if method != "cpd" or unit["cpd"]]
    return {"overlap": overlap, "answers": try_methods(methods, pair, pair.any_start(seed), seed)}


def _virtual_pair(i: int, j: int) -> KnownPair:
    """Virtual scans with noise that stand in where there are no data."""
    return known_pair(
        virtual_scan(MADE, i, noise=QUICK_NOISE, seed=i),
        virtual_scan(MADE, j, noise=QUICK_NOISE, seed=j, roll_deg=QUICK_ROLL_DEG),
    )
