"""Contours alone, surfaces alone, and both: what holds a pose that is nearly right."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.views import disturbed, mesh_of, overlap_of, pose_error, virtual_scan
from scanweld.config import ContoursConfig, RefineConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.geometry.pose import Pose
from scanweld.published.mm_icc import mm_icc
from scanweld.refinement.refine import refine_poses

OBJECTS = ("armadillo", "bunny")
GAPS = (60, 90, 110, 120)
AZIMUTHS = tuple(range(0, 360, 45))
NOISE = 1e-3
START_DEG = 2.0
WEIGHTS = {"surfaces alone": 0.0, "both": RefineConfig().contour_weight, "both, alike": 1.0}
ALONE = "contours alone"


def units(quick: bool) -> list[Unit]:
    """Pairs of views, the last of which hardly overlap."""
    if quick:
        return [{"object": "creature", "gap": 90, "azimuth": 0, "noise": NOISE}]
    for name in OBJECTS:
        mesh_of(name)
    return [
        {"object": name, "gap": gap, "azimuth": azimuth, "noise": NOISE}
        for name, gap, azimuth in product(OBJECTS, GAPS, AZIMUTHS)
    ]


def measure(unit: Unit) -> Result:
    """Errors of the terms, from a pose that is nearly right."""
    name, azimuth = unit["object"], float(unit["azimuth"])
    azimuths = azimuth, azimuth + unit["gap"]
    i, j = (virtual_scan(name, a, noise=NOISE, seed=k) for k, a in enumerate(azimuths))
    scans, edges, true = (i.scan, j.scan), [(0, 1)], i.from_other(j)
    start = {0: Pose.identity(), 1: disturbed(true, j.centre(), START_DEG, unit["azimuth"])}
    matcher = contour_matcher(scans, ContoursConfig())
    contours = ContoursConfig(residual="normal")
    found = {ALONE: mm_icc(scans, start, edges, contours).poses}
    for told, weight in WEIGHTS.items():
        config = RefineConfig(contour_weight=weight)
        found[told] = refine_poses(scans, start, edges, config, matcher).poses
    errors = {
        told: pose_error(true, poses[0].inverse() @ poses[1], j.centre(), i.diameter)
        for told, poses in found.items()
    }
    return {"overlap": overlap_of(name, *azimuths), "errors": errors}


def page(records: Sequence[Record]) -> str:
    """Median errors by gap."""
    gaps = list(dict.fromkeys(record.unit["gap"] for record in records))
    names = (ALONE, *WEIGHTS)
    rows = [[name, *(_cell(records, name, gap) for gap in gaps)] for name in names]
    shown = [f"{gap}° (overlap {_overlap(records, gap):.2f})" for gap in gaps]
    return (
        f"## Contours, surfaces, both\n\n{_sentence(records, gaps)}\n\n"
        f"The joint refinement from {START_DEG:g}° off, with {100 * NOISE:g} % depth noise; the "
        f"weight of a contour match is {WEIGHTS['both']:g} in the default, "
        f"{WEIGHTS['both, alike']:g} in the last row. Contours alone are MM-ICC with the distance "
        "across the outline. Median (and 90th percentile) of the rotation error in degrees, and "
        "median of the shift in % of the diameter.\n\n" + markdown_table(["terms", *shown], rows)
    )


def _errors(records: Sequence[Record], name: str, gap: int) -> np.ndarray:
    """(N, 2) degrees and % of the diameter."""
    return np.array([r.result["errors"][name] for r in records if r.unit["gap"] == gap])


def _overlap(records: Sequence[Record], gap: int) -> float:
    return float(np.median([r.result["overlap"] for r in records if r.unit["gap"] == gap]))


def _cell(records: Sequence[Record], name: str, gap: int) -> str:
    degrees, shift = _errors(records, name, gap).T
    return f"{np.median(degrees):.3f} ({np.percentile(degrees, 90):.2f}), {np.median(shift):.3f} %"


def _sentence(records: Sequence[Record], gaps: Sequence[int]) -> str:
    gap = max(gaps)
    middle = {n: float(np.median(_errors(records, n, gap)[:, 0])) for n in (ALONE, *WEIGHTS)}
    best = min(middle, key=lambda name: middle[name])
    told = ", ".join(f"{name} {value:.2f}°" for name, value in middle.items())
    return f"**At {gap}° apart the median error is least with {best}: {told}.**"
