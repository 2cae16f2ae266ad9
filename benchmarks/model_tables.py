"""The tables of the model's benchmark, from its records."""

from collections.abc import Sequence
from typing import Any

FLOORS = {
    "virtual": {"accuracy_90": 0.6, "completeness": 0.98},
    "real": {"accuracy_median": 0.15, "accuracy_90": 0.40},
    "many": {"peak_mb": 3072.0, "seconds": 180.0},
}
"""Issue of the model: accuracies in footprints (virtual) and millimetres (real)."""

Record = dict[str, Any]


def fidelity_table(records: Sequence[Record]) -> list[str]:
    """Markdown: our model against the reference, floors in brackets."""
    headings = (
        *("model", "unit", "median", "90 %", "completeness", "faces"),
        *("non-manifold", "double", "cracks", "estimated deviation"),
    )
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    for r in (r for r in records if r["kind"] in ("virtual", "real")):
        floors = FLOORS[r["kind"]]
        cells = (
            r["subject"],
            "mm" if r["kind"] == "real" else "footprint",
            _cell(r["accuracy_median"], floors.get("accuracy_median"), 3),
            _cell(r["accuracy_90"], floors.get("accuracy_90"), 3),
            _cell(r["completeness"], floors.get("completeness"), 4, at_least=True),
            str(r["faces"]),
            _cell(r["non_manifold"], 0, 0),
            _cell(r["double"], 0, 0),
            _cell(r["cracks"], 0, 0),
            f"{r['stdev']:.3f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def rivals_table(records: Sequence[Record]) -> list[str]:
    """Markdown: the surfaces of all methods from the same poses."""
    headings = (
        *("object", "surface", "F-score", "precision", "recall", "on common surface: median"),
        *("90 %", "faces", "non-manifold", "double", "cracks", "seconds"),
    )
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    for r in (r for r in records if r["kind"] == "rivals"):
        cells = (
            r["subject"],
            r["model"],
            *(f"{r[key]:.4f}" for key in ("f_score", "precision", "recall")),
            *(f"{r[key]:.3f}" for key in ("common_median", "common_90")),
            *(str(r[key]) for key in ("faces", "non_manifold", "double", "cracks")),
            f"{r['seconds']:.0f}" if r["seconds"] else "-",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def many_table(records: Sequence[Record]) -> list[str]:
    """Markdown: what many scans cost."""
    headings = ("scans", "points each", "faces", "peak (MB)", "fusion wall / CPU (s)", "all (s)")
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    for r in (r for r in records if r["kind"] == "many"):
        floors = FLOORS["many"]
        cells = (
            f"{r['scans']:.0f}",
            f"{r['points']:.0f}",
            f"{r['faces']:.0f}",
            _cell(r["peak_mb"], floors["peak_mb"], 0),
            f"{_cell(r['fusion_seconds'], floors['seconds'], 0)} / {r['fusion_cpu_seconds']:.0f}",
            f"{r['seconds']:.0f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _cell(value: float, floor: float | None, digits: int, *, at_least: bool = False) -> str:
    text = f"{value:.{digits}f}"
    if floor is None:
        return text
    is_met = value >= floor if at_least else value <= floor
    return f"{text} ({floor:g})" if is_met else f"**{text} ({floor:g}) FAIL**"
