"""What the study says of features: tables by object and question, and a plot."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.optional import need
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record
from scanweld.geometry.arrays import FloatArray

FEW = 30
"""Fewer answers than this are told as a fraction."""
_TABLES = (
    ("Keypoints, repeated", "detectors", "repeated"),
    ("Descriptors at their keypoints, nearest", "own", "nearest"),
    ("Descriptors at their keypoints, mutual", "own", "mutual"),
    ("Descriptors at their keypoints, among 8", "own", "among 8"),
    ("Descriptors at evenly spread points, nearest", "even", "nearest"),
    ("Descriptors at evenly spread points, mutual", "even", "mutual"),
    ("Descriptors at evenly spread points, among 8", "even", "among 8"),
)


_USUAL = (30, 90)
"""Gaps of the table that says it all at once."""


def tell(records: Sequence[Record], plot: Path) -> str:
    """All objects together, a plot that is written to the given path, the tables of each object."""
    _plot(records, plot)
    parts = [_summary(records), f"![Repeatability and precision against the gap]({plot.name})\n"]
    for name in _objects(records):
        parts.append(f"## {name.capitalize()}\n")
        for heading, group, question in _TABLES:
            parts.append(f"{heading}\n\n{_table(records, name, group, question)}")
    return "\n".join(parts)


def _objects(records: Iterable[Record]) -> list[str]:
    return list(dict.fromkeys(record.unit["object"] for record in records))


def _gaps(records: Iterable[Record]) -> list[int]:
    return sorted({record.unit["gap"] for record in records})


def _summary(records: Sequence[Record]) -> str:
    """All objects together, at the gaps where scans are usually taken."""
    chosen = [record for record in records if _USUAL[0] <= record.unit["gap"] <= _USUAL[1]]
    rows = []
    for entry in records[0].result["detectors"] | records[0].result["own"]:
        row = [entry]
        for _, group, question in _TABLES:
            has_entry = entry in records[0].result[group]
            row.append(_cell(_pooled(chosen, (group, entry, question))) if has_entry else "")
        rows.append(row)
    columns = [
        f"{question}, even" if group == "even" else question for _, group, question in _TABLES
    ]
    title = f"All objects, gaps of {_USUAL[0]}° to {_USUAL[1]}°"
    return f"{title}\n\n{markdown_table(['', *columns], rows)}"


def _table(records: Sequence[Record], name: str, group: str, question: str) -> str:
    of_object = [record for record in records if record.unit["object"] == name]
    gaps = _gaps(of_object)
    rows = []
    for entry, first in of_object[0].result[group].items():
        row = [entry]
        for gap in gaps:
            at_gap = [record for record in of_object if record.unit["gap"] == gap]
            row.append(_cell(_pooled(at_gap, (group, entry, question))))
        if "missing" in first:
            row[1:] = [first["missing"], *[""] * (len(gaps) - 1)]
        if group == "detectors":
            counts = [record.result[group][entry]["points"] for record in of_object]
            row.append(f"{np.mean(counts):.0f}")
        rows.append(row)
    headings = [f"{gap}°" for gap in gaps]
    if group == "detectors":
        return markdown_table(["keypoints", *headings, "a view"], rows)
    return markdown_table(["descriptor", *headings], rows)


def _pooled(records: Iterable[Record], path: tuple[str, str, str]) -> FloatArray:
    """Right, asked and by chance right (3,), over all records."""
    group, entry, question = path
    total = np.zeros(3)
    for record in records:
        total += record.result[group][entry].get(question, [0, 0, 0])
    return total


def _cell(pooled: FloatArray) -> str:
    right, asked, chance = pooled
    if not asked:
        return "-"
    share = f"{right:.0f}/{asked:.0f}" if asked < FEW else f"{right / asked:.2f}"
    return f"{share} ({chance / asked:.2f})"


def _plot(records: Sequence[Record], path: Path) -> None:
    """Repeatability and mutual precision against the gap, chance dashed; a row an object."""
    need("matplotlib").use("Agg")
    pyplot = need("matplotlib.pyplot")
    objects, gaps = _objects(records), _gaps(records)
    panels = (("detectors", "repeated"), ("own", "mutual"), ("even", "mutual"))
    titles = ("repeated keypoints", "right mutual matches, own keypoints", "same, evenly spread")
    figure, axes = pyplot.subplots(
        len(objects), len(panels), figsize=(13, 3.9 * len(objects)), squeeze=False, sharey=True
    )
    for row, name in zip(axes, objects, strict=True):
        of_object = [record for record in records if record.unit["object"] == name]
        for axis, (group, question), title in zip(row, panels, titles, strict=True):
            for entry in records[0].result[group]:
                _draw(axis, of_object, (group, entry, question))
            axis.set(title=f"{name}: {title}", xlabel="gap (deg)", ylim=(-0.03, 1.05), xticks=gaps)
            axis.grid(alpha=0.25)
        row[0].set_ylabel("share (dashed: chance)")
    for axis in axes[0]:
        axis.legend(fontsize=8, loc="upper right", bbox_to_anchor=(1.0, 0.97))
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _draw(axis: Any, records: Sequence[Record], path: tuple[str, str, str]) -> None:
    """A curve against the gap, and its chance level."""
    gaps = _gaps(records)
    pooled = np.array(
        [_pooled([record for record in records if record.unit["gap"] == gap], path) for gap in gaps]
    )
    shares = pooled[:, [0, 2]] / np.where(pooled[:, 1:2] > 0, pooled[:, 1:2], np.nan)
    color, marker = _STYLE[path[1]]
    axis.plot(gaps, shares[:, 0], color=color, marker=marker, ms=5, label=path[1])
    axis.plot(gaps, shares[:, 1], color=color, lw=0.9, ls="--")


_STYLE = {
    "PA-HKS": ("#c0392b", "o"),
    "SI-HKS": ("#e67e22", "s"),
    "WKS": ("#b7950b", "^"),
    "HKS, full mesh": ("#7f8c8d", "D"),
    "FPFH": ("#2471a3", "v"),
    "3D Harris": ("#2471a3", "v"),
    "random points": ("#555555", "x"),
}
