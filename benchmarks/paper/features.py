"""Keypoint repeatability and descriptor precision against the gap between two views."""

from collections.abc import Sequence
from itertools import product
from math import comb

import numpy as np

from benchmarks.paper.baselines.feature_views import (
    DESCRIPTORS,
    DETECTOR_OF,
    DETECTORS,
    FeatureView,
    distances,
    feature_view,
    is_seen,
)
from benchmarks.paper.settings import REPEATED_DIAMETERS, RIGHT_DIAMETERS
from benchmarks.paper.views import MADE, OBJECTS
from benchmarks.study.study import Result, Unit
from scanweld.errors import InputError
from scanweld.geometry.arrays import BoolArray, FloatArray

NAME = "features"

GAPS_DEG = (10, 30, 50, 70, 90, 110)
AZIMUTHS_DEG = (0, 45, 90, 135, 180, 225, 270, 315)
NUM_NEAREST = 8
NUM_EVEN = 200
"""Evenly spread points of each view at which all descriptors are compared."""
NUM_DRAWS = 20
"""Draws of random points behind a chance level."""
QUESTIONS = ("nearest", "mutual", "among 8")

Pair = tuple[FeatureView, FeatureView]
Points = Sequence[FloatArray]
"""Of each view of a pair."""


def units(quick: bool) -> list[Unit]:
    """Pairs of views of both objects; two pairs of the creature, if quick."""
    if quick:
        return [{"object": MADE, "azimuth": 0, "gap": gap} for gap in (30, 70)]
    cases = product(OBJECTS, AZIMUTHS_DEG, GAPS_DEG)
    return [{"object": name, "azimuth": azimuth, "gap": gap} for name, azimuth, gap in cases]


def measure(unit: Unit) -> Result:
    """Repeatability of each detector and precision of each descriptor on a pair of views.

    A share is told as three numbers: how many are right, how many were asked, and how many would be
    right by chance. Both directions of the pair are asked.
    """
    name, azimuth, gap = unit["object"], unit["azimuth"], unit["gap"]
    roll = float(np.random.default_rng([azimuth, gap, 5]).uniform(-180, 180))
    pair = feature_view(name, azimuth, 0.0), feature_view(name, azimuth + gap, roll)
    even = [view.virtual.scan.samples.points[:NUM_EVEN] for view in pair]
    return {
        "detectors": {detector: _repeatability(pair, detector) for detector in DETECTORS},
        "own": {
            descriptor: _precision(pair, descriptor, [view.keypoints[detector] for view in pair])
            for descriptor, detector in DETECTOR_OF.items()
        },
        "even": {descriptor: _precision(pair, descriptor, even) for descriptor in DESCRIPTORS},
    }


def _repeatability(pair: Pair, detector: str) -> Result:
    """Of a detector's keypoints, and of as many points drawn from the samples of each view."""
    keypoints = [view.keypoints[detector] for view in pair]
    samples = [view.virtual.scan.samples.points for view in pair]
    rng = np.random.default_rng(1)
    drawn = np.zeros(2)
    for _ in range(NUM_DRAWS):
        chosen = [
            all_points[rng.choice(len(all_points), min(len(found), len(all_points)), replace=False)]
            for all_points, found in zip(samples, keypoints, strict=True)
        ]
        drawn += _repeated(pair, chosen)
    right, asked = map(float, _repeated(pair, keypoints))
    return {
        "points": [len(found) for found in keypoints],
        "repeated": [right, asked, asked * float(drawn[0] / max(drawn[1], 1.0))],
    }


def _repeated(pair: Pair, points: Points) -> FloatArray:
    """How many points (2,) have one of the other view near by, and how many that view sees."""
    is_near, seen = _truth(pair, points, REPEATED_DIAMETERS)
    found = is_near.any(axis=1) & seen[0], is_near.any(axis=0) & seen[1]
    return np.array([sum(f.sum() for f in found), sum(s.sum() for s in seen)], dtype=np.float64)


def _truth(
    pair: Pair, points: Points, reach_diameters: float
) -> tuple[BoolArray, tuple[BoolArray, BoolArray]]:
    """Which points (N, M) of two views are the same place, and which (N,), (M,) both views see."""
    i, j = (view.virtual for view in pair)
    i_from_j = i.from_other(j)
    in_i, in_j = i_from_j.apply(points[1]), i_from_j.inverse().apply(points[0])
    apart = np.linalg.norm(points[0][:, None] - in_i, axis=-1)
    return apart < reach_diameters * i.diameter, (is_seen(in_j, j.scan), is_seen(in_i, i.scan))


def _precision(pair: Pair, descriptor: str, points: Points) -> Result:
    """Answers to ``QUESTIONS`` for a descriptor at some points of each view."""
    try:
        apart = distances(descriptor, pair, points)
    except InputError as error:
        return {"missing": str(error)}
    is_right, (seen_i, seen_j) = _truth(pair, points, RIGHT_DIAMETERS)
    of_i, of_j = answer(apart, is_right, seen_i), answer(apart.T, is_right.T, seen_j)
    return {question: np.add(of_i[question], of_j[question]).tolist() for question in QUESTIONS}


def answer(apart: FloatArray, is_right: BoolArray, is_seen: BoolArray) -> dict[str, list[float]]:
    """Answers to ``QUESTIONS``, each as (right, asked, right by chance).

    Of a random descriptor each answer is as likely: the nearest, mutual or not, is right as often
    as there are right ones, and the nearest eight hold one unless none of eight drawn is right.

    Args:
        apart: (N, M) distances of descriptors between points that ask and points that answer.
        is_right: (N, M) whether they are the same place.
        is_seen: (N,) whether the other view sees the place of one that asks.
    """
    num, others = apart.shape
    if num == 0 or others == 0:
        return {question: [0.0, 0.0, 0.0] for question in QUESTIONS}
    nearest = apart.argmin(axis=1)
    is_mutual = apart.argmin(axis=0)[nearest] == np.arange(num)
    found = is_right[np.arange(num), nearest]
    among = np.argsort(apart, axis=1, kind="stable")[:, :NUM_NEAREST]
    found_among: BoolArray = np.any(np.take_along_axis(is_right, among, axis=1), axis=1)
    partners = is_right.sum(axis=1)
    share = partners / others
    none = [comb(others - int(m), among.shape[1]) / comb(others, among.shape[1]) for m in partners]
    mean_share = np.full(num, share[is_seen].mean() if is_seen.any() else 0.0)
    return {
        "nearest": _counts(found, is_seen, share),
        "mutual": _counts(found, is_seen & is_mutual, mean_share),
        "among 8": _counts(found_among, is_seen & (partners > 0), 1 - np.array(none)),
    }


def _counts(is_found: BoolArray, is_asked: BoolArray, chance: FloatArray) -> list[float]:
    right, asked = (is_found & is_asked).sum(), is_asked.sum()
    return [float(right), float(asked), float(chance[is_asked].sum())]
