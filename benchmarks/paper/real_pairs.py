"""Pairs of real scans from any start, all methods."""

import zlib
from functools import lru_cache

from benchmarks.paper.baselines.records import ScanPair
from benchmarks.paper.methods import METHODS, missing_modules, need_all, try_methods, without
from benchmarks.paper.views import (
    MADE,
    VirtualPair,
    data_file,
    overlap_of,
    overlaps_of,
    start_pose,
    virtual_scan,
)
from benchmarks.sets import BUNNY, dragon, moved_scans
from benchmarks.study.study import Result, Unit
from scanweld.config import PrepareConfig
from scanweld.evaluation.metrics import object_diameter
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_poses, read_scan
from scanweld.preparation import prepare

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
SEED = 0
"""Of the frames that the scans are given in."""


def units(quick: bool) -> list[Unit]:
    """All pairs of the bunny, and those of the dragon that are not too far apart.

    Raises:
        InputError: If the scans or a library are missing.
    """
    if quick:
        missing = missing_modules(METHODS)
        more = {"missing": missing} if missing else {}
        return [{"object": MADE, "i": 0, "j": gap, "cpd": False, **more} for gap in QUICK_GAPS]
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
    names = [name for name in METHODS if name != "cpd" or unit["cpd"]]
    names = without(names, unit.get("missing", ()))
    seed = zlib.crc32(f"{unit['object']} {unit['i']} {unit['j']}".encode()) >> 1
    is_made = unit["object"] == MADE
    pair, true, diameter = _virtual_pair(unit) if is_made else _real_pair(unit)
    start = start_pose("random", pair, seed)
    return {
        "overlap": overlap_of(MADE, unit["i"], unit["j"]) if is_made else unit["overlap"],
        "answers": try_methods(names, pair, start, true, diameter, seed),
    }


def _virtual_pair(unit: Unit) -> tuple[ScanPair, Pose, float]:
    """Virtual scans with noise that stand in where there are no data."""
    i, j = (
        virtual_scan(MADE, unit[key], roll_deg=roll, noise=QUICK_NOISE, seed=unit[key])
        for key, roll in (("i", 0.0), ("j", QUICK_ROLL_DEG))
    )
    pair = VirtualPair(i, j)
    return pair.scans, pair.true, i.diameter


def _real_pair(unit: Unit) -> tuple[ScanPair, Pose, float]:
    """Two scans as a random motion and quarter turns of the grid leave them, truth, diameter."""
    name = unit["object"]
    _, reference, diameter = _moved(name)
    i, j = (_prepared(name, unit[key]) for key in ("i", "j"))
    world_from_i = reference[unit["i"]] @ i.scan_from_sensor
    world_from_j = reference[unit["j"]] @ j.scan_from_sensor
    pair = ScanPair(i=i, j=j, diameter=(i.diameter + j.diameter) / 2)
    return pair, world_from_i.inverse() @ world_from_j, diameter


@lru_cache(maxsize=2)
def _moved(name: str) -> tuple[dict[str, RangeScan], dict[str, Pose], float]:
    """The scans of an object in random frames, their reference poses, and the diameter."""
    folder, names, _ = REAL[name]
    moved, reference = moved_scans(
        [read_scan(data_file(f"{folder}/{each}.ply")) for each in names],
        read_poses(data_file(f"{folder}/poses.json")).poses,
        SEED,
        any_rotation=True,
        turn_grids=True,
    )
    return {scan.name: scan for scan in moved}, reference, object_diameter(moved, reference)


@lru_cache(maxsize=32)
def _prepared(name: str, scan: str) -> PreparedScan:
    scans, _, _ = _moved(name)
    return prepare(scans[scan], PrepareConfig())
