"""What stands on the page of the features."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.features import NUM_EVEN, NUM_NEAREST, REPEATED_DIAMETERS, RIGHT_DIAMETERS
from benchmarks.study.pages import grid
from benchmarks.study.plots import Curve, Panel, draw_panels
from benchmarks.study.records import of, values_of
from benchmarks.study.study import Record
from scanweld.geometry.arrays import FloatArray

Records = Sequence[Record]
Question = tuple[str, str]
"""A group of rows in the results, and what was asked of them."""

FEW = 30
"""Fewer answers than this are told as a fraction."""
USUAL = (30, 90)
"""Gaps of the table that says it all at once."""
QUESTIONS: dict[str, Question] = {
    "Keypoints, repeated": ("detectors", "repeated"),
    "Descriptors at their keypoints, nearest": ("own", "nearest"),
    "Descriptors at their keypoints, mutual": ("own", "mutual"),
    "Descriptors at their keypoints, among 8": ("own", "among 8"),
    "Descriptors at evenly spread points, nearest": ("even", "nearest"),
    "Descriptors at evenly spread points, mutual": ("even", "mutual"),
    "Descriptors at evenly spread points, among 8": ("even", "among 8"),
}
_PLOTTED: dict[str, Question] = {
    "repeated keypoints": ("detectors", "repeated"),
    "right mutual matches, own keypoints": ("own", "mutual"),
    "same, evenly spread": ("even", "mutual"),
}
_COLORS = {
    "PA-HKS": "#c0392b",
    "SI-HKS": "#e67e22",
    "WKS": "#b7950b",
    "HKS, full mesh": "#7f8c8d",
    "FPFH": "#2471a3",
    "3D Harris": "#2471a3",
    "random points": "#555555",
}


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template; the plot goes to the folder ``out``."""
    by_object = {name: of(records, object=name) for name in values_of(records, "object")}
    _draw(by_object, out / "features.png")
    return {
        "few": FEW,
        "usual": USUAL,
        "repeated": f"{100 * REPEATED_DIAMETERS:g} %",
        "right": f"{100 * RIGHT_DIAMETERS:g} %",
        "num_nearest": NUM_NEAREST,
        "num_even": NUM_EVEN,
        "summary": _summary(records),
        "objects": {
            name.capitalize(): {title: _table(own, *asked) for title, asked in QUESTIONS.items()}
            for name, own in by_object.items()
        },
    }


def _summary(records: Records) -> str:
    """All objects together, at the gaps where scans are usually taken."""
    chosen = [record for record in records if USUAL[0] <= record.unit["gap"] <= USUAL[1]]
    first = records[0].result
    rows = {entry: entry for entry in first["detectors"] | first["own"]}
    columns = {
        f"{question}, even" if group == "even" else question: (group, question)
        for group, question in QUESTIONS.values()
    }

    def cell(entry: str, asked: Question) -> str:
        group, question = asked
        return _cell(pooled(chosen, group, entry, question)) if entry in first[group] else ""

    return grid("", rows, columns, cell)


def _table(records: Records, group: str, question: str) -> str:
    """Answers to a question by the gap; for detectors also the number of points."""
    gaps: dict[str, Records] = {
        f"{gap}°": of(records, gap=gap) for gap in sorted(values_of(records, "gap"))
    }
    first, is_detector = records[0].result[group], group == "detectors"

    def cell(entry: str, at_gap: Records) -> str:
        if at_gap is records:
            counts = [record.result[group][entry]["points"] for record in records]
            return f"{np.mean(counts):.0f}"
        if "missing" in first[entry]:
            return first[entry]["missing"] if at_gap is next(iter(gaps.values())) else ""
        return _cell(pooled(at_gap, group, entry, question))

    columns = gaps | ({"a view": records} if is_detector else {})
    corner = "keypoints" if is_detector else "descriptor"
    return grid(corner, {entry: entry for entry in first}, columns, cell)


def pooled(records: Iterable[Record], group: str, entry: str, question: str) -> FloatArray:
    """Right, asked and by chance right (3,), over all records."""
    told = [record.result[group][entry].get(question, [0, 0, 0]) for record in records]
    return np.array(told, dtype=np.float64).reshape(-1, 3).sum(axis=0)


def _cell(counts: FloatArray) -> str:
    right, asked, chance = counts
    if not asked:
        return "-"
    share = f"{right:.0f}/{asked:.0f}" if asked < FEW else f"{right / asked:.2f}"
    return f"{share} ({chance / asked:.2f})"


def _draw(by_object: Mapping[str, Records], path: Path) -> None:
    """Shares against the gap, chance dashed; a row an object."""
    rows = [
        [_panel(f"{name}: {title}", records, *asked) for title, asked in _PLOTTED.items()]
        for name, records in by_object.items()
    ]
    draw_panels(path, rows, "gap (°)", "share (%), by chance dashed")


def _panel(title: str, records: Records, group: str, question: str) -> Panel:
    gaps = sorted(values_of(records, "gap"))
    curves = {}
    for entry in records[0].result[group]:
        counts = np.array([pooled(of(records, gap=gap), group, entry, question) for gap in gaps])
        asked = np.where(counts[:, 1] > 0, counts[:, 1], np.nan)
        color = _COLORS[entry]
        curves[entry] = Curve(places=gaps, shares=counts[:, 0] / asked, color=color)
        chance = counts[:, 2] / asked
        curves[f"_{entry} by chance"] = Curve(places=gaps, shares=chance, color=color, style="--")
    return Panel(title=title, curves=curves, ticks={gap: str(gap) for gap in gaps})
