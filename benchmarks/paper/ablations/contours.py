"""Which prunings, readings and matches of the contours carry MM-ICC."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from benchmarks.paper.pages import markdown_table, percent
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.success import Limit, cell, share_right
from benchmarks.paper.views import VirtualScan, disturbed, mesh_of, pose_error, virtual_scan
from scanweld.config import ContoursConfig
from scanweld.contours.coherence import contour_pair
from scanweld.contours.contour_sets import observe_contours
from scanweld.geometry.pose import Pose
from scanweld.published.mm_icc import mm_icc

OBJECTS = ("armadillo", "bunny")
GAPS = (30, 60, 90)
AZIMUTHS = (0, 90, 180, 270)
START_DEG = (20, 40)
CONVERGED = Limit(deg=2.0, percent=1.0)
PERCENTILES = (25, 50, 75, 90)

PUBLISHED = "MM-ICC as published"
VARIANTS: dict[str, dict[str, Any]] = {
    PUBLISHED: {},
    "without pruning 1": {"prunings": ("observed", "predicted")},
    "without pruning 2": {"prunings": ("self-occlusion", "predicted")},
    "without pruning 3": {"prunings": ("self-occlusion", "observed")},
    "without any pruning": {"prunings": ()},
    "eq. 4 by place": {"self_occlusion": "place"},
    "eq. 6 by depth": {"predicted_visibility": "depth"},
    "eq. 6 by the observed normal": {"predicted_visibility": "observed normal"},
    "eq. 6 as printed": {"predicted_visibility": "printed"},
    "mutual matches": {"matching": "mutual"},
    "all matches, untrimmed": {"trim": 1.0},
    "distance in the image": {"residual": "image"},
    "distance in space": {"residual": "point"},
    "then across the outline": {"residual": "normal"},
}
"""What is changed against MM-ICC as published: face normals in eq. 6, trimmed matches."""
PRUNED = {
    "none": (),
    "1 and 2": ("self-occlusion", "observed"),
    "1, 2 and 3": ("self-occlusion", "observed", "predicted"),
}


def units(quick: bool) -> list[Unit]:
    """Pairs of views."""
    if quick:
        return [{"object": "creature", "gap": 60, "azimuth": 0, "starts": [20]}]
    for name in OBJECTS:
        mesh_of(name)
    return [
        {"object": name, "gap": gap, "azimuth": azimuth, "starts": START_DEG}
        for name, gap, azimuth in product(OBJECTS, GAPS, AZIMUTHS)
    ]


def measure(unit: Unit) -> Result:
    """Errors of each variant from each start, and how far contours lie apart at the truth."""
    azimuth = float(unit["azimuth"])
    i, j = (virtual_scan(unit["object"], a) for a in (azimuth, azimuth + unit["gap"]))
    return {
        "errors": {
            name: [_error(i, j, degrees, unit["azimuth"], change) for degrees in unit["starts"]]
            for name, change in VARIANTS.items()
        },
        "apart": {
            name: contours_apart(i, j, ContoursConfig(prunings=p)) for name, p in PRUNED.items()
        },
    }


def _error(
    i: VirtualScan, j: VirtualScan, degrees: float, seed: int, change: dict[str, Any]
) -> dict[str, float]:
    config = ContoursConfig(**change)
    start = disturbed(i.from_other(j), j.centre(), degrees, seed)
    at_start = {0: Pose.identity(), 1: start}
    poses = mm_icc((i.scan, j.scan), at_start, [(0, 1)], config).poses
    found = poses[0].inverse() @ poses[1]
    deg, shift = pose_error(i.from_other(j), found, j.centre(), i.diameter)
    return {"deg": deg, "percent": shift}


def contours_apart(i: VirtualScan, j: VirtualScan, config: ContoursConfig) -> list[float]:
    """Percentiles of the distance in pixels from predicted to observed contours, at the truth."""
    a, b = observe_contours(i.scan, config), observe_contours(j.scan, config)
    pairs = (
        contour_pair(a, b, j.from_other(i), config),
        contour_pair(b, a, i.from_other(j), config),
    )
    distances = [
        np.atleast_1d(KDTree(pair.observed.pixels).query(pair.predicted.pixels)[0])
        for pair in pairs
        if len(pair.observed) and len(pair.predicted)
    ]
    if not distances:
        return [float("inf")] * len(PERCENTILES)
    return [float(p) for p in np.percentile(np.concatenate(distances), PERCENTILES)]


def page(records: Sequence[Record]) -> str:
    """Converged shares of the variants by gap, and distances of contours."""
    gaps = list(dict.fromkeys(record.unit["gap"] for record in records))
    starts = " and ".join(f"{start}°" for start in records[0].unit["starts"])
    rows = [
        [name, *(cell(_told(records, name, [gap]), CONVERGED) for gap in gaps), _all(records, name)]
        for name in VARIANTS
    ]
    return (
        f"## Contours: prunings, readings, matches\n\n{_sentence(records)}\n\n"
        f"MM-ICC with one thing changed at a time, from {starts} off; right is {CONVERGED} of the "
        "diameter. Cells: right of all, and the median error of the right ones in degrees. Eq. 6 "
        "as published here asks that the rendered face look towards camera j.\n\n"
        + markdown_table(["variant", *(f"{gap}° apart" for gap in gaps), "all"], rows)
        + "\nDistance from predicted to observed contours at the true pose, in pixels: "
        f"percentiles {', '.join(map(str, PERCENTILES))}, medians over the pairs of views.\n\n"
        + markdown_table(
            ["prunings", *(f"{gap}° apart" for gap in gaps)],
            [[name, *(_apart_cell(records, name, gap) for gap in gaps)] for name in PRUNED],
        )
    )


def _told(records: Sequence[Record], name: str, gaps: Sequence[int]) -> list[dict[str, float]]:
    return [e for r in records if r.unit["gap"] in gaps for e in r.result["errors"][name]]


def _all(records: Sequence[Record], name: str) -> str:
    gaps = [record.unit["gap"] for record in records]
    return cell(_told(records, name, gaps), CONVERGED)


def _sentence(records: Sequence[Record]) -> str:
    gaps = [record.unit["gap"] for record in records]
    share = {name: share_right(_told(records, name, gaps), CONVERGED) for name in VARIANTS}
    far = {name: _median_apart(records, name, max(gaps))[-1] for name in PRUNED}
    without = ", ".join(f"{k} {percent(share[f'without pruning {k}'])}" for k in (1, 2, 3))
    return (
        f"**MM-ICC comes right in {percent(share[PUBLISHED])} of the runs, without pruning "
        f"{without}, without any {percent(share['without any pruning'])}; with mutual matches "
        f"{percent(share['mutual matches'])}, with eq. 6 as printed "
        f"{percent(share['eq. 6 as printed'])}. At {max(gaps)}° the prunings bring the 90th "
        f"percentile of the contours' distance from {far['none']:.1f} to "
        f"{far['1, 2 and 3']:.1f} pixels.**"
    )


def _median_apart(records: Sequence[Record], name: str, gap: int) -> list[float]:
    rows = [record.result["apart"][name] for record in records if record.unit["gap"] == gap]
    return [float(value) for value in np.median(rows, axis=0)]


def _apart_cell(records: Sequence[Record], name: str, gap: int) -> str:
    return " / ".join(f"{value:.1f}" for value in _median_apart(records, name, gap))
