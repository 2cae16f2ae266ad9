"""What heat spreads on: the artificial mesh against an open one, jumps cut against bridged."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from benchmarks.paper.baselines.feature_views import is_seen
from benchmarks.paper.pages import markdown_table, percent
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.views import VirtualScan, mesh_of, virtual_scan
from scanweld.config import HeatConfig
from scanweld.heat.features import Features, describe
from scanweld.published.signature_matching import match_signatures

OBJECTS = ("armadillo", "bunny")
AZIMUTHS = (0, 90, 180, 270)
GAPS = (30, 60, 90)
REPEATED_DIAMETERS = 0.04
"""A keypoint is repeated if the other view has one within this distance,"""
RIGHT_DIAMETERS = 0.06
"""and a match is right within this one."""

VARIANTS: dict[str, dict[str, Any]] = {
    "closed, cut at jumps": {},
    "closed, jumps bridged": {"jumps": "bridged"},
    "open (Neumann)": {"surface": "open"},
    "open, cold rims (Dirichlet)": {"surface": "clamped"},
    "closed, times of Sun et al.": {"times": "sun"},
}
CLOSED = "closed, cut at jumps"


def units(quick: bool) -> list[Unit]:
    """Pairs of views."""
    if quick:
        return [{"object": "creature", "gap": 30, "azimuth": 0}]
    for name in OBJECTS:
        mesh_of(name)
    return [
        {"object": name, "gap": gap, "azimuth": azimuth}
        for name, gap, azimuth in product(OBJECTS, GAPS, AZIMUTHS)
    ]


def measure(unit: Unit) -> Result:
    """Repeatability and precision of each variant; each as (right, asked, right by chance)."""
    azimuth = float(unit["azimuth"])
    pair = [virtual_scan(unit["object"], a) for a in (azimuth, azimuth + unit["gap"])]
    result = {}
    for name, change in VARIANTS.items():
        found = [describe(view.scan, HeatConfig(**change)) for view in pair]
        result[name] = {
            "keypoints": [len(features) for features in found],
            "repeated": repeated(pair, found),
            "matched": matched(pair, found),
        }
    return result


def repeated(pair: Sequence[VirtualScan], found: Sequence[Features]) -> list[float]:
    """Keypoints that the other view sees, and has; by chance, evenly spread samples do."""
    reach = REPEATED_DIAMETERS * pair[0].diameter
    totals = np.zeros(3)
    for (a, b), (of_a, of_b) in zip((pair, pair[::-1]), (found, found[::-1]), strict=True):
        if not len(of_b):
            continue
        tree, b_from_a = KDTree(of_b.points), b.from_other(a)
        keypoints, samples = b_from_a.apply(of_a.points), b_from_a.apply(a.scan.samples.points)
        keypoints, samples = (x[is_seen(x, b.scan)] for x in (keypoints, samples))
        near, by_chance = (tree.query(x)[0] < reach for x in (keypoints, samples))
        level = float(by_chance.mean()) if len(by_chance) else 0.0
        totals += near.sum(), len(near), len(near) * level
    return [float(total) for total in totals]


def matched(pair: Sequence[VirtualScan], found: Sequence[Features]) -> list[float]:
    """Matches of eq. 1 with the median as threshold; by chance, any keypoint is as likely."""
    i, j = pair
    of_i, of_j = found
    matches = match_signatures(of_i.signatures, of_j.signatures)
    if not len(matches):
        return [0.0, 0.0, 0.0]
    in_i = i.from_other(j).apply(of_j.points)
    apart = np.linalg.norm(of_i.points[matches.s][:, None] - in_i, axis=-1)
    is_right = apart < RIGHT_DIAMETERS * i.diameter
    right = is_right[np.arange(len(matches)), matches.t].sum()
    return [float(right), float(len(matches)), float(is_right.mean(axis=1).sum())]


def page(records: Sequence[Record]) -> str:
    """Number, repeatability and precision of keypoints by gap."""
    gaps = list(dict.fromkeys(record.unit["gap"] for record in records))
    rows = []
    for name in VARIANTS:
        number = np.mean([k for record in records for k in record.result[name]["keypoints"]])
        cells = [_cell(records, name, what, [gap]) for what in _WHAT for gap in gaps]
        rows.append([name, f"{number:.0f}", *cells])
    headings = ["surface", "keypoints a view"]
    headings += [f"{title}, {gap}°" for title in _WHAT.values() for gap in gaps]
    return (
        f"## What heat spreads on\n\n{_sentence(records, gaps)}\n\n"
        f"A keypoint that the other view sees is repeated if that view has one within "
        f"{100 * REPEATED_DIAMETERS:g} % of the diameter; a match of eq. 1 (nearest signature, "
        f"median threshold) is right within {100 * RIGHT_DIAMETERS:g} %. In brackets the share "
        "by chance: of evenly spread points, and of a random keypoint as the match.\n\n"
        + markdown_table(headings, rows)
    )


_WHAT = {"repeated": "repeated", "matched": "right by eq. 1"}


def _totals(records: Sequence[Record], name: str, what: str, gaps: Sequence[int]) -> np.ndarray:
    chosen = [r.result[name][what] for r in records if r.unit["gap"] in gaps]
    return np.array(chosen).sum(axis=0)


def _cell(records: Sequence[Record], name: str, what: str, gaps: Sequence[int]) -> str:
    right, asked, by_chance = _totals(records, name, what, gaps)
    return f"{percent(right / asked)} ({percent(by_chance / asked)})" if asked else "-"


def _sentence(records: Sequence[Record], gaps: Sequence[int]) -> str:
    gain = {}
    for name in VARIANTS:
        right, asked, by_chance = _totals(records, name, "repeated", gaps)
        gain[name] = (right - by_chance) / asked if asked else 0.0
    best = max(gain, key=lambda name: gain[name])
    precision = {name: _cell(records, name, "matched", gaps) for name in VARIANTS}
    told = ", ".join(f"{name}: {value}" for name, value in precision.items())
    return (
        f"**Keypoints repeat farthest above chance on the surface that is {best} "
        f"(+{100 * gain[best]:.0f} points; {CLOSED}: +{100 * gain[CLOSED]:.0f}). Eq. 1 is right "
        f"for few, whatever heat spreads on ({told}).**"
    )
