"""Pairs of real scans from any start, all methods."""

import csv
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.paper.methods import METHODS, ScanPair
from benchmarks.paper.real_pairs_page import tell
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.trial import missing_modules, need_all, try_methods, without
from benchmarks.paper.views import data_folder, overlap_of, virtual_scan
from benchmarks.sets import BUNNY, dragon, moved_scans
from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.metrics import object_diameter
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_poses, read_scan
from scanweld.preparation import prepare

NAME = "real_pairs"
TITLE = "Pairs of real scans"

OBJECTS = {
    "bunny": ("stanford-bunny", BUNNY, 360.0),
    "dragon": ("stanford-dragon", dragon(24), 121.0),
}
"""Object -> folder, scans, largest rotation between the scans of a pair in degrees."""
QUICK_GAPS = (40, 80)
QUICK_NOISE = 1e-3
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
        told = {"missing": missing} if missing else {}
        return [
            {"object": "creature", "i": 0, "j": gap, "cpd": False, **told} for gap in QUICK_GAPS
        ]
    need_all(METHODS)
    pairs = [(name, row) for name in OBJECTS for row in _rows(name)]
    return [
        {"object": name, **row, "cpd": number % CPD_STEP == 0}
        for number, (name, row) in enumerate(pairs)
    ]


def measure(unit: Unit) -> Result:
    """Register one pair by all methods from a random start."""
    scene = _virtual_scene(unit) if unit["object"] == "creature" else _scene(unit)
    names = [name for name in METHODS if name != "cpd" or unit["cpd"]]
    pair = ScanPair(i=scene.i, j=scene.j, diameter=(scene.i.diameter + scene.j.diameter) / 2)
    seed = zlib.crc32(f"{unit['object']} {unit['i']} {unit['j']}".encode()) >> 1
    names = without(names, unit.get("missing", ()))
    start = _random_start(scene, seed)
    return {
        "overlap": scene.overlap,
        "answers": try_methods(names, pair, start, scene.true, scene.object_diameter, seed),
    }


def page(records: Sequence[Record], out: Path) -> str:
    """Successes, errors, time and AUC by overlap."""
    return tell(records, out)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Scene:
    """Two scans and the truth: ``i_from_j`` between the sensor frames, overlap, diameter."""

    i: PreparedScan
    j: PreparedScan
    true: Pose
    overlap: float
    object_diameter: float


def _random_start(scene: _Scene, seed: int) -> Pose:
    """The middles on each other, turned at random."""
    middle_i, middle_j = (scan.samples.points.mean(axis=0) for scan in (scene.i, scene.j))
    rotation = random_rotation(np.random.default_rng([seed, 7]))
    return Pose(rotation=rotation, translation=middle_i - rotation @ middle_j)


def _virtual_scene(unit: Unit) -> _Scene:
    """Virtual scans with noise that stand in where there are no data."""
    i, j = (
        virtual_scan("creature", unit[key], roll_deg=roll, noise=QUICK_NOISE, seed=unit[key])
        for key, roll in (("i", 0.0), ("j", 130.0))
    )
    overlap = overlap_of("creature", unit["i"], unit["j"])
    return _Scene(
        i=i.scan, j=j.scan, true=i.from_other(j), overlap=overlap, object_diameter=i.diameter
    )


def _scene(unit: Unit) -> _Scene:
    """Two scans as a random rigid motion and quarter turns of the grid leave them."""
    name = unit["object"]
    _, reference, diameter = _moved(name)
    i, j = _prepared(name, unit["i"]), _prepared(name, unit["j"])
    world_from_i = reference[unit["i"]] @ i.scan_from_sensor
    world_from_j = reference[unit["j"]] @ j.scan_from_sensor
    true = world_from_i.inverse() @ world_from_j
    return _Scene(i=i, j=j, true=true, overlap=unit["overlap"], object_diameter=diameter)


@lru_cache(maxsize=2)
def _moved(name: str) -> tuple[dict[str, RangeScan], dict[str, Pose], float]:
    """The scans of an object in random frames, their reference poses, and the diameter."""
    folder, names, _ = OBJECTS[name]
    data = data_folder() / folder
    moved, reference = moved_scans(
        [read_scan(data / f"{each}.ply") for each in names],
        read_poses(data / "poses.json").poses,
        SEED,
        any_rotation=True,
        turn_grids=True,
    )
    return {scan.name: scan for scan in moved}, reference, object_diameter(moved, reference)


@lru_cache(maxsize=32)
def _prepared(name: str, scan: str) -> PreparedScan:
    scans, _, _ = _moved(name)
    return prepare(scans[scan], PrepareConfig())


def _rows(name: str) -> list[Unit]:
    """The pairs of an object with their overlap and their gap."""
    folder, names, max_gap_deg = OBJECTS[name]
    path = data_folder() / folder / "overlaps.csv"
    if not path.exists():
        raise InputError(
            f"{path}: is missing; set SCANWELD_DATA to the folder of the Stanford data, or take "
            "--quick, which needs none"
        )
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [
        {
            "i": row["i"],
            "j": row["j"],
            "overlap": min(float(row["overlap_ij"]), float(row["overlap_ji"])),
            "gap": float(row["rotation_deg"]),
        }
        for row in rows
        if float(row["rotation_deg"]) <= max_gap_deg and {row["i"], row["j"]} <= set(names)
    ]
