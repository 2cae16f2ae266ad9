"""Keypoint repeatability and descriptor precision against the gap between two views."""

from collections.abc import Iterable, Sequence
from math import comb
from pathlib import Path

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
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, Result, Unit
from scanweld.errors import InputError
from scanweld.geometry.arrays import BoolArray, FloatArray

NAME = "features"
TITLE = "Features"

OBJECTS = ("armadillo", "bunny")
GAPS_DEG = (10, 30, 50, 70, 90, 110)
AZIMUTHS_DEG = (0, 45, 90, 135, 180, 225, 270, 315)
REPEATED_DIAMETERS = 0.04
"""A keypoint is repeated if the other view has one within this distance,"""
RIGHT_DIAMETERS = 0.06
"""and a match is right within this one."""
NUM_NEAREST = 8
NUM_EVEN = 200
"""Evenly spread points of each view at which all descriptors are compared."""
NUM_DRAWS = 20
"""Draws of random points behind a chance level."""
QUESTIONS = ("nearest", "mutual", "among 8")

Pair = tuple[FeatureView, FeatureView]


def units(quick: bool) -> list[Unit]:
    """Pairs of views of both objects; two pairs of the creature, if quick."""
    if quick:
        return [{"object": "creature", "azimuth": 0, "gap": gap} for gap in (30, 70)]
    return [
        {"object": name, "azimuth": azimuth, "gap": gap}
        for name in OBJECTS
        for azimuth in AZIMUTHS_DEG
        for gap in GAPS_DEG
    ]


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
            descriptor: _precision(
                pair, name, descriptor, [view.keypoints[DETECTOR_OF[descriptor]] for view in pair]
            )
            for descriptor in DESCRIPTORS
        },
        "even": {
            descriptor: _precision(pair, name, descriptor, even) for descriptor in DESCRIPTORS
        },
    }


def _repeatability(pair: Pair, detector: str) -> Result:
    """Of a detector's keypoints, and of as many points drawn from the samples of each view."""
    keypoints = [view.keypoints[detector] for view in pair]
    samples = [view.virtual.scan.samples.points for view in pair]
    reach = REPEATED_DIAMETERS * pair[0].virtual.diameter
    rng = np.random.default_rng(1)
    drawn = np.zeros(2)
    for _ in range(NUM_DRAWS):
        chosen = [
            all_points[rng.choice(len(all_points), min(len(found), len(all_points)), replace=False)]
            for all_points, found in zip(samples, keypoints, strict=True)
        ]
        drawn += _repeated(pair, chosen, reach)
    right, asked = map(float, _repeated(pair, keypoints, reach))
    return {
        "points": [len(found) for found in keypoints],
        "repeated": [right, asked, asked * float(drawn[0] / max(drawn[1], 1.0))],
    }


def _repeated(pair: Pair, points: Sequence[FloatArray], reach: float) -> FloatArray:
    """How many points (2,) have one of the other view near by, and how many that view sees."""
    is_near, seen = _truth(pair, points, reach)
    found = is_near.any(axis=1) & seen[0], is_near.any(axis=0) & seen[1]
    return np.array([sum(f.sum() for f in found), sum(s.sum() for s in seen)], dtype=np.float64)


def _truth(
    pair: Pair, points: Sequence[FloatArray], reach: float
) -> tuple[BoolArray, tuple[BoolArray, BoolArray]]:
    """Which points (N, M) of two views are the same place, and which (N,), (M,) both views see."""
    i, j = pair
    i_from_j = i.virtual.from_other(j.virtual)
    in_i, in_j = i_from_j.apply(points[1]), i_from_j.inverse().apply(points[0])
    is_near = np.linalg.norm(points[0][:, None] - in_i, axis=-1) < reach
    return is_near, (is_seen(in_j, j.virtual.scan), is_seen(in_i, i.virtual.scan))


def _precision(pair: Pair, name: str, descriptor: str, points: Sequence[FloatArray]) -> Result:
    """Answers to ``QUESTIONS`` for a descriptor at some points of each view."""
    try:
        apart = distances(descriptor, name, pair, points)
    except InputError as error:
        return {"missing": str(error)}
    reach = RIGHT_DIAMETERS * pair[0].virtual.diameter
    is_right, (seen_i, seen_j) = _truth(pair, points, reach)
    answers = (_asked(apart, is_right, seen_i), _asked(apart.T, is_right.T, seen_j))
    return {
        question: [answers[0][question][k] + answers[1][question][k] for k in range(3)]
        for question in QUESTIONS
    }


def _asked(apart: FloatArray, is_right: BoolArray, is_seen: BoolArray) -> dict[str, list[float]]:
    """Right, asked and by chance right, for points (N,) that look for themselves among (M,).

    Of a random descriptor each answer is as likely: a share of right ones for the nearest, mutual
    or not; for the nearest eight, one minus the chance that none of eight drawn is right.
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
    has_partner = is_seen & (partners > 0)
    mean_share = np.full(num, share[is_seen].mean() if is_seen.any() else 0.0)
    return {
        "nearest": _counts(found, is_seen, share),
        "mutual": _counts(found, is_seen & is_mutual, mean_share),
        "among 8": _counts(found_among, has_partner, 1 - np.array(none)),
    }


def _counts(is_found: BoolArray, is_asked: BoolArray, chance: FloatArray) -> list[float]:
    right, asked = (is_found & is_asked).sum(), is_asked.sum()
    return [float(right), float(asked), float(chance[is_asked].sum())]


def page(records: Sequence[Record], out: Path) -> str:
    """The tables of each object, with a plot of them."""
    _plot(records, out / f"{NAME}.png")
    parts = [_INTRODUCTION, f"![Repeatability and precision against the gap]({NAME}.png)\n"]
    for name in _objects(records):
        parts.append(f"## {name.capitalize()}\n")
        for heading, group, question in _TABLES:
            parts.append(f"{heading}\n\n{_table(records, name, group, question)}")
    return "\n".join(parts)


_INTRODUCTION = f"""\
Two virtual views of an object, 240 pixels across, without noise, the second camera rolled at
random; each number is pooled over all azimuths and both directions of each pair. In parentheses:
what chance alone would give.

- *Repeated*: keypoints whose place the other view sees that have a keypoint of the other view
  within {100 * REPEATED_DIAMETERS:g} % of the diameter. By chance: as many points in each view,
  drawn from its evenly spread samples.
- *Nearest*, *mutual*: of the points whose place the other view sees, those whose nearest
  descriptor lies within {100 * RIGHT_DIAMETERS:g} % of the diameter of that place; *mutual* asks
  only those that are the nearest of their nearest, too. Not every point has a partner.
- *Among {NUM_NEAREST}*: of the points that have a partner, those that have it among the
  {NUM_NEAREST} nearest descriptors. By chance: a random descriptor.

PA-HKS, SI-HKS and WKS are taken from the artificial mesh of each scan, at the keypoints of PA-HKS;
FPFH comes without a detector and is taken at those of 3D Harris. HKS on the full mesh needs what no
scan has: it sees the same surface from both sides, so that its keypoints repeat by construction.
At evenly spread points ({NUM_EVEN} a view) all descriptors have the same task; the full mesh is
their ceiling there: it cannot tell left from right, and no sample has its exact counterpart.
"""
_TABLES = (
    ("Keypoints, repeated", "detectors", "repeated"),
    ("Descriptors at their keypoints, nearest", "own", "nearest"),
    ("Descriptors at their keypoints, mutual", "own", "mutual"),
    (f"Descriptors at their keypoints, among {NUM_NEAREST}", "own", "among 8"),
    ("Descriptors at evenly spread points, nearest", "even", "nearest"),
    ("Descriptors at evenly spread points, mutual", "even", "mutual"),
    (f"Descriptors at evenly spread points, among {NUM_NEAREST}", "even", "among 8"),
)


def _objects(records: Iterable[Record]) -> list[str]:
    return list(dict.fromkeys(record.unit["object"] for record in records))


def _gaps(records: Iterable[Record]) -> list[int]:
    return sorted({record.unit["gap"] for record in records})


def _table(records: Sequence[Record], name: str, group: str, question: str) -> str:
    gaps = _gaps(records)
    first = records[0].result[group]
    headings = ["keypoints" if group == "detectors" else "descriptor", *(f"{g}°" for g in gaps)]
    if group == "detectors":
        headings.append("a view")
    rows = []
    for entry in first:
        row = [entry]
        for gap in gaps:
            right, asked, chance = _pooled(records, name, gap, (group, entry, question))
            row.append(f"{right / asked:.2f} ({chance / asked:.2f})" if asked else "-")
        if "missing" in first[entry]:
            row[1:] = [first[entry]["missing"], *[""] * (len(gaps) - 1)]
        if group == "detectors":
            counts = [r.result[group][entry]["points"] for r in records if r.unit["object"] == name]
            row.append(f"{np.mean(counts):.0f}")
        rows.append(row)
    return markdown_table(headings, rows)


def _pooled(
    records: Iterable[Record], name: str, gap: int, path: tuple[str, str, str]
) -> FloatArray:
    """Right, asked and by chance right (3,), over the azimuths."""
    group, entry, question = path
    total = np.zeros(3)
    for record in records:
        if record.unit["object"] == name and record.unit["gap"] == gap:
            total += record.result[group][entry].get(question, [0, 0, 0])
    return total


def _plot(records: Sequence[Record], path: Path) -> None:
    """Repeatability and mutual precision against the gap, chance dashed; a row an object."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    objects, gaps = _objects(records), _gaps(records)
    panels = (("detectors", "repeated"), ("own", "mutual"), ("even", "mutual"))
    titles = ("repeated keypoints", "right mutual matches, own keypoints", "same, evenly spread")
    figure, axes = pyplot.subplots(
        len(objects), len(panels), figsize=(13, 3.9 * len(objects)), squeeze=False, sharey=True
    )
    for row, name in zip(axes, objects, strict=True):
        for axis, (group, question), title in zip(row, panels, titles, strict=True):
            for entry in records[0].result[group]:
                totals = np.array(
                    [_pooled(records, name, gap, (group, entry, question)) for gap in gaps]
                )
                shares = totals[:, [0, 2]] / np.where(totals[:, 1:2] > 0, totals[:, 1:2], np.nan)
                color, marker = _STYLE[entry]
                axis.plot(gaps, shares[:, 0], color=color, marker=marker, label=entry)
                axis.plot(gaps, shares[:, 1], color=color, lw=0.9, ls="--")
            axis.set(title=f"{name}: {title}", xlabel="gap (deg)", ylim=(-0.03, 1.05), xticks=gaps)
            axis.grid(alpha=0.25)
            axis.legend(fontsize=8, loc="upper right")
        row[0].set_ylabel("share (dashed: chance)")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


_STYLE = {
    "PA-HKS": ("#c0392b", "o"),
    "SI-HKS": ("#e67e22", "s"),
    "WKS": ("#b7950b", "^"),
    "HKS, full mesh": ("#7f8c8d", "D"),
    "FPFH": ("#2471a3", "v"),
    "3D Harris": ("#2471a3", "v"),
    "random points": ("#555555", "x"),
}
