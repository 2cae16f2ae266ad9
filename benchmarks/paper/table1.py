"""The paper's Table 1: pairs of views by the angle between them, from two kinds of start."""

import zlib
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.paper.methods import METHODS, missing_modules, need_all, try_methods, without
from benchmarks.paper.views import (
    MADE,
    OBJECTS,
    VirtualPair,
    VirtualScan,
    mesh_of,
    overlap_of,
    start_pose,
    virtual_scan,
)
from benchmarks.study.study import Result, Unit
from scanweld.config import CoarseConfig, HeatConfig
from scanweld.heat.features import Features, describe
from scanweld.published.signature_matching import match_signatures

NAME = "table1"

AZIMUTHS = tuple(range(0, 360, 45))
GAPS = tuple(range(10, 130, 10))
PROTOCOLS = ("identity", "random")
NOISE = 1e-3
"""Standard deviation of the depth, in diameters, besides none at all."""
NOISY_AZIMUTHS = AZIMUTHS[::2]
QUICK_GAPS = (30, 80)

LIBRARY_GLOBAL = {"fpfh-ransac", "fgr", "kiss-gicp"}
"""They make nothing of the start: they are tried from one kind of it only,"""
NOISY = {"m-icc", "mm-icc", "paper", "default", "fpfh-ransac"}
"""and so is the default where there is noise."""
CPD_AZIMUTHS, CPD_GAPS = (0, 90), (10, 30, 50, 70, 90)
"""CPD takes as long as all others together."""
RIGHT_MATCH = 0.05
"""In diameters: matched keypoints that lie closer than this are the same place of the object."""


def units(quick: bool) -> list[Unit]:
    """Pairs of views of the study's objects, or a few of the creature.

    Raises:
        InputError: If a mesh or a library is missing.
    """
    keys = ("object", "noise", "protocol", "azimuth", "gap")
    if quick:
        cases = product((MADE,), (0.0,), PROTOCOLS, (0,), QUICK_GAPS)
        missing = missing_modules(METHODS)
        more = {"missing": missing} if missing else {}
        return [dict(zip(keys, case, strict=True)) | more for case in cases]
    need_all(METHODS)
    for name in OBJECTS:
        mesh_of(name)
    return [
        dict(zip(keys, (name, noise, protocol, azimuth, gap), strict=True))
        for name, noise, protocol in product(OBJECTS, (0.0, NOISE), PROTOCOLS)
        for azimuth, gap in product(NOISY_AZIMUTHS if noise else AZIMUTHS, GAPS)
    ]


def measure(unit: Unit) -> Result:
    """Register one pair by all methods that its unit asks for."""
    pair, seed = _pair(unit), _seed(unit)
    start = start_pose(unit["protocol"], pair.scans, seed)
    names = without(methods_of(unit), unit.get("missing", ()))
    azimuths = unit["azimuth"], unit["azimuth"] + unit["gap"]
    result = {
        "overlap": overlap_of(unit["object"], *azimuths),
        "answers": try_methods(names, pair.scans, start, pair.true, pair.i.diameter, seed),
    }
    is_of_the_paper = unit["protocol"] == "identity" and not unit["noise"]
    return {**result, "matches": _matches(unit["object"], *azimuths)} if is_of_the_paper else result


def methods_of(unit: Unit) -> list[str]:
    """The methods that are tried on a pair."""
    left_out = {"point-to-plane"}
    left_out |= LIBRARY_GLOBAL if unit["protocol"] == "identity" else {"paper-coarse"}
    if unit["noise"]:
        left_out |= METHODS.keys() - NOISY
        left_out |= {"default"} if unit["protocol"] == "identity" else set()
    if unit["azimuth"] not in CPD_AZIMUTHS or unit["gap"] not in CPD_GAPS:
        left_out |= {"cpd"}
    return [name for name in METHODS if name not in left_out]


def _seed(unit: Unit) -> int:
    """Of the roll and the start, the same with and without noise."""
    return zlib.crc32(f"{unit['object']} {unit['azimuth']} {unit['gap']}".encode()) >> 1


def _pair(unit: Unit) -> VirtualPair:
    """The two scans; where the start is random, the second camera is rolled at random too."""
    name, noise, azimuth, gap = (unit[key] for key in ("object", "noise", "azimuth", "gap"))
    roll = 0.0
    if unit["protocol"] == "random":
        roll = float(np.random.default_rng([_seed(unit), 3]).uniform(0, 360))
    other = azimuth + gap
    return VirtualPair(
        virtual_scan(name, azimuth, noise=noise, seed=azimuth),
        virtual_scan(name, other, roll_deg=roll, noise=noise, seed=1000 + other),
    )


@lru_cache(maxsize=128)
def _features(name: str, azimuth: int) -> tuple[VirtualScan, Features]:
    scan = virtual_scan(name, azimuth % 360)
    return scan, describe(scan.scan, HeatConfig())


def _matches(name: str, azimuth_i: int, azimuth_j: int) -> dict[str, float | int]:
    """What eq. 1 matches: keypoints of i, matches, right ones, and as many as chance would give.

    Chance is a match of each of these keypoints of i with any keypoint of j.
    """
    (i, features_i), (j, features_j) = (_features(name, a) for a in (azimuth_i, azimuth_j))
    config = CoarseConfig()
    matches = match_signatures(
        features_i.signatures,
        features_j.signatures,
        max_distance=config.max_signature_distance,
        quantile=config.signature_quantile,
        mutual=config.mutual,
    )
    there = i.from_other(j).apply(features_j.points)
    is_near = cdist(features_i.points[matches.s], there) < RIGHT_MATCH * i.diameter
    return {
        "keypoints": len(features_i),
        "matched": len(matches),
        "right": int(is_near[np.arange(len(matches)), matches.t].sum()),
        "by_chance": float(is_near.mean(axis=1).sum()),
    }
