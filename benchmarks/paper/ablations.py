"""Ablations: what each part of the method is worth; study.toml has what they change."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial import KDTree

from benchmarks.paper import ablations_search as search
from benchmarks.paper.baselines.feature_views import is_seen
from benchmarks.paper.baselines.own import aligned, coarse_pose, jointly_refined, right_matches
from benchmarks.paper.settings import REPEATED_DIAMETERS, RIGHT_DIAMETERS, STUDY
from benchmarks.paper.views import MADE, KnownPair, overlap_of, pair_units, real_pair, virtual_pair
from benchmarks.study.study import Result, Unit
from scanweld.config import ContoursConfig, HeatConfig
from scanweld.contours.coherence import contour_pair
from scanweld.contours.contour_sets import observe_contours
from scanweld.geometry.pose import Pose
from scanweld.heat.features import Features, describe

NAME = "ablations"
CONTOURS, PRUNED, TERMS = STUDY["contours"], STUDY["pruned"], STUDY["terms"]
HEAT, COARSE = STUDY["heat"], STUDY["coarse"]
"""Variants by name, each with the settings that it changes."""
PUBLISHED, ALONE, CLOSED = "MM-ICC as published", "contours alone", "closed, cut at jumps"
PERCENTILES = (25, 50, 75, 90)
TERMS_NOISE, TERMS_START_DEG = STUDY["parts"]["terms"]["more"]["noise"], 2.0


def units(quick: bool) -> list[Unit]:
    """Pairs of views for each part, and the thin ones among the real pairs for the search."""
    units = []
    for name, part in STUDY["parts"].items():
        more = {"part": name, **part.get("more", {})}
        if quick:
            units.append({"object": MADE, "gap": part["quick_gap"], "azimuth": 0, **more})
        else:
            units += pair_units(part["gaps"], range(0, 360, part["step_deg"]), **more)
    real = () if quick else search.thin_real_pairs()
    return [*units, *({"part": "search", **unit} for unit in real)]


def measure(unit: Unit) -> Result:
    """Measure one unit of its part."""
    if "i" in unit:
        return search.measure(real_pair(unit["object"], (), unit["i"], unit["j"]), unit)
    noise = unit.get("noise", 0.0)
    pair = virtual_pair(unit["object"], unit["azimuth"], unit["gap"], noise)
    return PARTS[unit["part"]](pair, unit)


def measure_contours(pair: KnownPair, unit: Unit) -> Result:
    """Errors of each variant from each start, and how far contours lie apart at the truth."""
    scans = pair.i, pair.j
    starts = [pair.start(degrees, unit["azimuth"]) for degrees in unit["starts"]]
    return {
        "errors": {
            name: [
                _error(pair, aligned("mm-icc", scans, start, **change).poses) for start in starts
            ]
            for name, change in CONTOURS.items()
        },
        "apart": {
            name: contours_apart(pair, ContoursConfig(**change)) for name, change in PRUNED.items()
        },
    }


def contours_apart(pair: KnownPair, config: ContoursConfig) -> list[float]:
    """Percentiles of the distance in pixels from predicted to observed contours, at the truth."""
    i, j = (observe_contours(scan, config) for scan in (pair.i, pair.j))
    pairs = (
        contour_pair(i, j, pair.true.inverse(), config),
        contour_pair(j, i, pair.true, config),
    )
    distances = [
        np.atleast_1d(KDTree(each.observed.pixels).query(each.predicted.pixels)[0])
        for each in pairs
        if len(each.observed) and len(each.predicted)
    ]
    if not distances:
        return [float("inf")] * len(PERCENTILES)
    return np.percentile(np.concatenate(distances), PERCENTILES).tolist()


def measure_terms(pair: KnownPair, unit: Unit) -> Result:
    """Errors with contours alone, surfaces alone and both, from a pose that is nearly right."""
    scans, start = (pair.i, pair.j), pair.start(TERMS_START_DEG, unit["azimuth"])
    found = {ALONE: aligned("mm-icc", scans, start, residual="normal").poses}
    found |= {name: jointly_refined(scans, start, **change) for name, change in TERMS.items()}
    return {
        "overlap": overlap_of(unit["object"], unit["azimuth"], unit["azimuth"] + unit["gap"]),
        "errors": {name: list(_error(pair, poses).values()) for name, poses in found.items()},
    }


def measure_heat(pair: KnownPair, unit: Unit) -> Result:
    """Repeatability and precision by what heat spreads on; each as (right, asked, by chance)."""
    result = {}
    for name, change in HEAT.items():
        of_i, of_j = (describe(scan, HeatConfig(**change)) for scan in (pair.i, pair.j))
        result[name] = {
            "keypoints": [len(of_i), len(of_j)],
            "repeated": repeated(pair, (of_i, of_j)),
            "matched": right_matches(pair.true, of_i, of_j, RIGHT_DIAMETERS * pair.diameter),
        }
    return result


def repeated(pair: KnownPair, found: Sequence[Features]) -> list[float]:
    """Keypoints that the other view sees, and has; by chance, evenly spread samples do."""
    reach = REPEATED_DIAMETERS * pair.diameter
    totals = np.zeros(3)
    ways = (
        (pair.i, pair.j, pair.true.inverse(), *found),
        (pair.j, pair.i, pair.true, *found[::-1]),
    )
    for a, b, b_from_a, of_a, of_b in ways:
        if not len(of_b):
            continue
        tree = KDTree(of_b.points)
        keypoints, samples = (b_from_a.apply(x) for x in (of_a.points, a.samples.points))
        keypoints, samples = (x[is_seen(x, b)] for x in (keypoints, samples))
        near, by_chance = (tree.query(x)[0] < reach for x in (keypoints, samples))
        level = float(by_chance.mean()) if len(by_chance) else 0.0
        totals += near.sum(), len(near), len(near) * level
    return totals.tolist()


def measure_coarse(pair: KnownPair, unit: Unit) -> Result:
    """Errors of the coarse pose in each reading of the published step."""
    features = [describe(scan, HeatConfig()) for scan in (pair.i, pair.j)]
    return {
        name: pair.error(coarse_pose(pair.i, pair.j, features, **change).i_from_j)
        for name, change in COARSE.items()
    }


def _error(pair: KnownPair, poses: Mapping[int, Pose]) -> dict[str, float | None]:
    return pair.error(poses[0].inverse() @ poses[1])


PARTS: Mapping[str, Callable[[KnownPair, Unit], Result]] = {
    **{"contours": measure_contours, "terms": measure_terms, "heat": measure_heat},
    **{"coarse": measure_coarse, "search": search.measure},
}
