"""The paper's Table 1: pairs of views by the angle between them, from two kinds of start."""

import zlib
from itertools import product

import numpy as np

from benchmarks.paper.baselines.own import right_matches
from benchmarks.paper.methods import METHODS, need_all, try_methods
from benchmarks.paper.views import (
    MADE,
    OBJECTS,
    KnownPair,
    known_pair,
    mesh_of,
    overlap_of,
    virtual_scan,
)
from benchmarks.study.study import Result, Unit
from scanweld.config import CoarseConfig, HeatConfig
from scanweld.geometry.pose import Pose
from scanweld.heat.features import describe

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
    """Pairs of views of the study's objects, or a few of the creature."""
    cases = product((MADE,), (0.0,), PROTOCOLS, (0,), QUICK_GAPS)
    if not quick:
        need_all(METHODS)
        for name in OBJECTS:
            mesh_of(name)
        cases = (
            (name, noise, protocol, azimuth, gap)
            for name, noise, protocol in product(OBJECTS, (0.0, NOISE), PROTOCOLS)
            for azimuth, gap in product(NOISY_AZIMUTHS if noise else AZIMUTHS, GAPS)
        )
    keys = ("object", "noise", "protocol", "azimuth", "gap")
    return [dict(zip(keys, case, strict=True)) for case in cases]


def measure(unit: Unit) -> Result:
    """Register one pair by all methods that its unit asks for."""
    name, is_random = unit["object"], unit["protocol"] == "random"
    azimuths = unit["azimuth"], unit["azimuth"] + unit["gap"]
    # The same with and without noise.
    seed = zlib.crc32(f"{name} {unit['azimuth']} {unit['gap']}".encode()) >> 1
    pair = _pair(unit, seed)
    start = pair.any_start(seed) if is_random else Pose.identity()
    result = {
        "overlap": overlap_of(name, *azimuths),
        "answers": try_methods(methods_of(unit), pair, start, seed),
    }
    return result if is_random or unit["noise"] else {**result, "matches": _matches(pair)}


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


def _pair(unit: Unit, seed: int) -> KnownPair:
    """The two scans; where the start is random, the second camera is rolled at random too."""
    name, noise, azimuth = unit["object"], unit["noise"], unit["azimuth"]
    roll, other = 0.0, azimuth + unit["gap"]
    if unit["protocol"] == "random":
        roll = float(np.random.default_rng([seed, 3]).uniform(0, 360))
    return known_pair(
        virtual_scan(name, azimuth, noise=noise, seed=azimuth),
        virtual_scan(name, other, roll_deg=roll, noise=noise, seed=1000 + other),
    )


def _matches(pair: KnownPair) -> dict[str, float | int]:
    """What eq. 1 matches: keypoints of i, matches, right ones, and as many as chance would give."""
    of_i, of_j = (describe(scan, HeatConfig()) for scan in (pair.i, pair.j))
    config = CoarseConfig()
    right, matched, by_chance = right_matches(
        *(pair.true, of_i, of_j, RIGHT_MATCH * pair.diameter),
        max_distance=config.max_signature_distance,
        quantile=config.signature_quantile,
        mutual=config.mutual,
    )
    counts = {"keypoints": len(of_i), "matched": int(matched), "right": int(right)}
    return {**counts, "by_chance": by_chance}
