"""The paper's Table 1: pairs of views by the angle between them, from two kinds of start."""

import zlib
from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.paper.methods import METHODS, ScanPair
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.table1_page import tell
from benchmarks.paper.trial import missing_modules, need_all, try_methods, without
from benchmarks.paper.views import VirtualScan, mesh_of, overlap_of, start_pose, virtual_scan
from scanweld.config import CoarseConfig, HeatConfig
from scanweld.heat.features import Features, describe
from scanweld.published.signature_matching import match_signatures

NAME = "table1"
TITLE = "Table 1: two views, any angle apart"

OBJECTS = ("armadillo", "bunny")
AZIMUTHS = tuple(range(0, 360, 45))
GAPS = tuple(range(10, 130, 10))
PROTOCOLS = ("identity", "random")
NOISE = 1e-3
"""Standard deviation of the depth, in diameters, besides none at all."""
NOISY_AZIMUTHS = AZIMUTHS[::2]
QUICK_GAPS = (30, 80)

FROM_A_START = ("icp", "trimmed-icp", "gicp", "m-icc", "mm-icc")
OWN = ("paper-coarse", "paper", "default")
ELSEWHERE = ("fpfh-ransac", "fgr", "kiss-gicp")
"""Library methods that make nothing of the start: they are tried from one kind of it only,"""
NOISY = ("m-icc", "mm-icc", "paper", "default", "fpfh-ransac")
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
    if quick:
        missing = missing_modules(METHODS)
        told = {"missing": missing} if missing else {}
        return [
            {**_unit("creature", 0.0, protocol, 0, gap), **told}
            for protocol, gap in product(PROTOCOLS, QUICK_GAPS)
        ]
    need_all(METHODS)
    for name in OBJECTS:
        mesh_of(name)
    return [
        _unit(name, noise, protocol, azimuth, gap)
        for name, noise, protocol in product(OBJECTS, (0.0, NOISE), PROTOCOLS)
        for azimuth, gap in product(NOISY_AZIMUTHS if noise else AZIMUTHS, GAPS)
    ]


def measure(unit: Unit) -> Result:
    """Register one pair by all methods that its unit asks for."""
    i, j = _scans(unit)
    start = start_pose(unit["protocol"], i, j, _seed(unit))
    # The diameter that a run on these two scans would take, not that of the object.
    pair = ScanPair(i=i.scan, j=j.scan, diameter=(i.scan.diameter + j.scan.diameter) / 2)
    true, names = i.from_other(j), without(methods_of(unit), unit.get("missing", ()))
    azimuths = unit["azimuth"], unit["azimuth"] + unit["gap"]
    result = {
        "overlap": overlap_of(unit["object"], *azimuths),
        "answers": try_methods(names, pair, start, true, i.diameter, _seed(unit)),
    }
    is_of_the_paper = unit["protocol"] == "identity" and not unit["noise"]
    return {**result, "matches": _matches(unit["object"], *azimuths)} if is_of_the_paper else result


def methods_of(unit: Unit) -> tuple[str, ...]:
    """The methods that are tried on a pair."""
    if unit["noise"]:
        names = NOISY
    else:
        names = (*FROM_A_START, *OWN)
        if unit["azimuth"] in CPD_AZIMUTHS and unit["gap"] in CPD_GAPS:
            names = (*names, "cpd")
        names = (*names, *ELSEWHERE)
    left_out = ("paper-coarse",)
    if unit["protocol"] == "identity":
        left_out = (*ELSEWHERE, "default") if unit["noise"] else ELSEWHERE
    return tuple(name for name in names if name not in left_out)


def page(records: Sequence[Record], out: Path) -> str:
    """Floors, the paper's own table, and shares of successes of all methods."""
    return tell(records, out)


def _unit(name: str, noise: float, protocol: str, azimuth: int, gap: int) -> Unit:
    return {
        "object": name,
        "noise": noise,
        "protocol": protocol,
        "azimuth": azimuth,
        "gap": gap,
    }


def _seed(unit: Unit) -> int:
    """Of the roll and the start, the same with and without noise."""
    return zlib.crc32(f"{unit['object']} {unit['azimuth']} {unit['gap']}".encode()) >> 1


def _scans(unit: Unit) -> tuple[VirtualScan, VirtualScan]:
    """The two scans; where the start is random, the second camera is rolled at random too."""
    name, noise, azimuth, gap = (unit[key] for key in ("object", "noise", "azimuth", "gap"))
    roll = 0.0
    if unit["protocol"] == "random":
        roll = float(np.random.default_rng([_seed(unit), 3]).uniform(0, 360))
    i = virtual_scan(name, azimuth, noise=noise, seed=azimuth)
    j = virtual_scan(name, azimuth + gap, roll_deg=roll, noise=noise, seed=1000 + azimuth + gap)
    return i, j


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
