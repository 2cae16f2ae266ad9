"""The ablations as data: which pairs of views each takes, what it changes, and how it measures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from benchmarks.paper.ablations.search import measure as measure_search
from benchmarks.paper.baselines.feature_views import is_seen
from benchmarks.paper.baselines.own import aligned, coarse_pose, jointly_refined, right_matches
from benchmarks.paper.views import KnownPair, overlap_of
from benchmarks.study.study import Result, Unit
from scanweld.config import ContoursConfig, HeatConfig, RefineConfig
from scanweld.contours.coherence import contour_pair
from scanweld.contours.contour_sets import observe_contours
from scanweld.geometry.pose import Pose
from scanweld.heat.features import Features, describe

Changes = Mapping[str, Mapping[str, Any]]
"""Variants by name, each with the settings that it changes."""

PUBLISHED = "MM-ICC as published"
CONTOURS: Changes = {
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
PRUNED: Changes = {
    "none": {"prunings": ()},
    "1 and 2": {"prunings": ("self-occlusion", "observed")},
    "1, 2 and 3": {"prunings": ("self-occlusion", "observed", "predicted")},
}
PERCENTILES = (25, 50, 75, 90)

ALONE = "contours alone"
TERMS: Changes = {
    "surfaces alone": {"contour_weight": 0.0},
    "both": {"contour_weight": RefineConfig().contour_weight},
    "both, alike": {"contour_weight": 1.0},
}
TERMS_NOISE, TERMS_START_DEG = 1e-3, 2.0

CLOSED = "closed, cut at jumps"
HEAT: Changes = {
    CLOSED: {},
    "closed, jumps bridged": {"jumps": "bridged"},
    "open (Neumann)": {"surface": "open"},
    "open, cold rims (Dirichlet)": {"surface": "clamped"},
    "closed, times of Sun et al.": {"times": "sun"},
}
REPEATED_DIAMETERS = 0.04
"""A keypoint is repeated if the other view has one within this distance,"""
RIGHT_DIAMETERS = 0.06
"""and a match is right within this one."""

COARSE: Changes = {
    "as taken": {},
    "the better half of the matches": {"signature_quantile": 0.5},
    "the better quarter of the matches": {"signature_quantile": 0.25},
    "mutual matches": {"mutual": True},
    "ICP of the keypoints alone": {"icp": "keypoints"},
    "trimmed ICP": {"trim": "auto"},
    "ours: start where the nearest signatures agree": {"start": "consensus"},
    "ours: start where the evidence is best": {"start": "evidence"},
    "the former, trimmed ICP": {"start": "consensus", "trim": "auto"},
    "the latter, trimmed ICP": {"start": "evidence", "trim": "auto"},
}


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


@dataclass(frozen=True, slots=True)
class Part:
    """One ablation: how it measures a pair, which gaps and azimuths, what else its units hold."""

    measure: Callable[[KnownPair, Unit], Result]
    gaps: Sequence[int]
    azimuths: Sequence[int]
    more: Mapping[str, Any] = field(default_factory=dict)
    quick_gap: int = 30


QUARTERS, EIGHTHS = range(0, 360, 90), range(0, 360, 45)
PARTS = {
    "contours": Part(measure_contours, (30, 60, 90), QUARTERS, {"starts": (20, 40)}, 60),
    "terms": Part(measure_terms, (60, 90, 110, 120), EIGHTHS, {"noise": TERMS_NOISE}, 90),
    "heat": Part(measure_heat, (30, 60, 90), QUARTERS),
    "coarse": Part(measure_coarse, (10, 30, 50, 70, 90), QUARTERS),
    "search": Part(measure_search, (90, 100, 110, 120), EIGHTHS, quick_gap=90),
}
"""In the order in which they are measured and shown."""
