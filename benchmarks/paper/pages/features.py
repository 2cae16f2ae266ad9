"""What the page of the features tells of its records."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from benchmarks.study.pages import grid
from benchmarks.study.plots import Curve, Panel, draw_panels
from benchmarks.study.records import Records, grouped, of, values_of
from benchmarks.study.study import Record
from scanweld.geometry.arrays import FloatArray

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


def summary(records: Records) -> str:
    """All objects together, at the gaps where scans are usually taken."""
    chosen = [record for record in records if USUAL[0] <= record.unit["gap"] <= USUAL[1]]
    first = records[0].result
    columns = {f"{q}, even" if g == "even" else q: (g, q) for g, q in QUESTIONS.values()}

    def cell(entry: str, asked: Question) -> str:
        return _cell(pooled(chosen, *asked, entry)) if entry in first[asked[0]] else ""

    return grid("", list(first["detectors"] | first["own"]), columns, cell)


def table(records: Records, group: str, question: str) -> str:
    """Answers to a question by the gap; for detectors also the number of points."""
    first, gaps = records[0].result[group], grouped(records, "gap", "{}°")
    is_detector, nearest = group == "detectors", next(iter(gaps))

    def cell(entry: str, column: str) -> str:
        if column not in gaps:
            return f"{np.mean([r.result[group][entry]['points'] for r in records]):.0f}"
        if "missing" in first[entry]:
            return first[entry]["missing"] if column == nearest else ""
        return _cell(pooled(gaps[column], group, question, entry))

    columns = {title: title for title in [*gaps, "a view"][: len(gaps) + is_detector]}
    return grid("keypoints" if is_detector else "descriptor", list(first), columns, cell)


def pooled(records: Iterable[Record], group: str, question: str, entry: str) -> FloatArray:
    """Right, asked and by chance right (3,), over all records."""
    told = [record.result[group][entry].get(question, [0, 0, 0]) for record in records]
    return np.array(told, dtype=np.float64).reshape(-1, 3).sum(axis=0)


def _cell(counts: FloatArray) -> str:
    right, asked, chance = counts
    if not asked:
        return "-"
    share = f"{right:.0f}/{asked:.0f}" if asked < FEW else f"{right / asked:.2f}"
    return f"{share} ({chance / asked:.2f})"


def draw(records: Records, out: Path) -> None:
    """Shares against the gap, chance dashed; a row an object."""
    rows = [
        [_panel(f"{name}: {title}", own, *asked) for title, asked in _PLOTTED.items()]
        for name, own in grouped(records, "object").items()
    ]
    draw_panels(out / "features.png", rows, "gap (°)", "share (%), by chance dashed")


def _panel(title: str, records: Records, group: str, question: str) -> Panel:
    gaps = values_of(records, "gap")
    panel = Panel(title, {gap: str(gap) for gap in gaps})
    for entry in records[0].result[group]:
        told = np.array([pooled(of(records, gap=gap), group, question, entry) for gap in gaps])
        right, asked, chance = told.T
        asked = np.where(asked > 0, asked, np.nan)
        panel.curves[entry] = Curve(right / asked, _COLORS[entry])
        panel.curves[f"_{entry} by chance"] = Curve(chance / asked, _COLORS[entry], "--")
    return panel
