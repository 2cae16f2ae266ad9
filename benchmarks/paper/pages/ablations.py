"""What stands on the page of the ablations."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.ablations.parts import (
    ALONE,
    CLOSED,
    COARSE,
    CONTOURS,
    HEAT,
    PERCENTILES,
    PRUNED,
    PUBLISHED,
    REPEATED_DIAMETERS,
    RIGHT_DIAMETERS,
    TERMS,
    TERMS_NOISE,
    TERMS_START_DEG,
)
from benchmarks.paper.ablations.search import (
    ANCHORS,
    RIGHT,
    THIN_OVERLAPS,
    WEIGHTS,
    rescored,
)
from benchmarks.study.pages import grid, percent
from benchmarks.study.records import of, values_of
from benchmarks.study.study import Record
from benchmarks.study.success import Answer, Limit, cell, share_right
from scanweld.geometry.arrays import FloatArray

Records = Sequence[Record]

CONVERGED = Limit(deg=2.0, percent=1.0)
COARSE_RIGHT = Limit(deg=5.0, percent=2.0)
_WHAT = {"repeated": "repeated", "right by eq. 1": "matched"}


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template: a part of it for each ablation."""
    tell = {
        "contours": _contours,
        "terms": _terms,
        "heat": _heat,
        "coarse": _coarse,
        "search": _search,
    }
    return {part: of_part(of(records, part=part)) for part, of_part in tell.items()}


def _by_gap(records: Records) -> dict[int, Records]:
    return {gap: of(records, gap=gap) for gap in values_of(records, "gap")}


def _same(names: Iterable[str]) -> dict[str, str]:
    return {name: name for name in names}


def _columns(records: Records) -> dict[str, Records]:
    """A column for each gap, and one for all."""
    return {f"{gap}° apart": r for gap, r in _by_gap(records).items()} | {"all": records}


def contour_errors(records: Records, variant: str) -> list[Answer]:
    """Errors of a variant of MM-ICC from all starts."""
    return [error for record in records for error in record.result["errors"][variant]]


def apart(records: Records, prunings: str) -> FloatArray:
    """Percentiles of the distance of true contours in pixels, medians over the pairs."""
    return np.median([record.result["apart"][prunings] for record in records], axis=0)


def _contours(records: Records) -> dict[str, Any]:
    by_gap = _by_gap(records)
    share = {
        name: percent(share_right(contour_errors(records, name), CONVERGED)) for name in CONTOURS
    }
    return {
        "limit": CONVERGED,
        "starts": " and ".join(f"{start}°" for start in records[0].unit["starts"]),
        "published": share[PUBLISHED],
        "share": share,
        "gap": max(by_gap),
        "apart": {name: f"{apart(by_gap[max(by_gap)], name)[-1]:.1f}" for name in PRUNED},
        "percentiles": ", ".join(map(str, PERCENTILES)),
        "table": grid(
            "variant",
            _same(CONTOURS),
            _columns(records),
            lambda name, chosen: cell(contour_errors(chosen, name), CONVERGED),
        ),
        "apart_table": grid(
            "prunings",
            _same(PRUNED),
            {f"{gap}° apart": chosen for gap, chosen in by_gap.items()},
            lambda name, chosen: " / ".join(f"{value:.1f}" for value in apart(chosen, name)),
        ),
    }


def term_errors(records: Records, name: str) -> FloatArray:
    """Errors with some of the terms: (2, N) degrees and % of the diameter."""
    return np.array([record.result["errors"][name] for record in records]).T


def _terms(records: Records) -> dict[str, Any]:
    def cell(name: str, chosen: Records) -> str:
        deg, shift = term_errors(chosen, name)
        return f"{np.median(deg):.3f} ({np.percentile(deg, 90):.2f}), {np.median(shift):.3f} %"

    by_gap, names = _by_gap(records), (ALONE, *TERMS)
    widest = by_gap[max(by_gap)]
    middle = {name: float(np.median(term_errors(widest, name)[0])) for name in names}
    columns = {
        f"{gap}° (overlap {np.median([r.result['overlap'] for r in chosen]):.2f})": chosen
        for gap, chosen in by_gap.items()
    }
    return {
        "gap": max(by_gap),
        "best": min(middle, key=lambda name: middle[name]),
        "medians": ", ".join(f"{name} {value:.2f}°" for name, value in middle.items()),
        "start": f"{TERMS_START_DEG:g}°",
        "noise": f"{100 * TERMS_NOISE:g} %",
        "weight": TERMS["both"]["contour_weight"],
        "alike": f"{TERMS['both, alike']['contour_weight']:g}",
        "table": grid("terms", _same(names), columns, cell),
    }


def heat_totals(records: Records, name: str, what: str) -> FloatArray:
    """Right, asked and by chance right (3,) on a surface that heat spreads on."""
    return np.sum([record.result[name][what] for record in records], axis=0)


def heat_cell(records: Records, name: str, what: str) -> str:
    """The share that is right, in brackets by chance."""
    right, asked, by_chance = heat_totals(records, name, what)
    return f"{percent(right / asked)} ({percent(by_chance / asked)})" if asked else "-"


def _heat(records: Records) -> dict[str, Any]:
    def gain(name: str) -> float:
        right, asked, by_chance = heat_totals(records, name, "repeated")
        return (right - by_chance) / asked if asked else 0.0

    def cell(name: str, column: tuple[str, Records]) -> str:
        what, chosen = column
        if what == "keypoints":
            return f"{np.mean([k for r in chosen for k in r.result[name][what]]):.0f}"
        return heat_cell(chosen, name, what)

    best = max(HEAT, key=gain)
    columns = {"keypoints a view": ("keypoints", records)}
    columns |= {
        f"{title}, {gap}°": (what, chosen)
        for title, what in _WHAT.items()
        for gap, chosen in _by_gap(records).items()
    }
    return {
        "best": best,
        "best_gain": f"{100 * gain(best):.0f}",
        "closed": CLOSED,
        "closed_gain": f"{100 * gain(CLOSED):.0f}",
        "matched": ", ".join(f"{name}: {heat_cell(records, name, 'matched')}" for name in HEAT),
        "repeated": f"{100 * REPEATED_DIAMETERS:g} %",
        "right": f"{100 * RIGHT_DIAMETERS:g} %",
        "table": grid("surface", _same(HEAT), columns, cell),
    }


def _coarse(records: Records) -> dict[str, Any]:
    return {
        "limit": COARSE_RIGHT,
        "table": grid(
            "reading",
            _same(COARSE),
            _columns(records),
            lambda name, chosen: cell([r.result[name] for r in chosen], COARSE_RIGHT),
        ),
    }


def _search(records: Records) -> dict[str, Any]:
    groups: dict[str, list[Record]] = {}
    for record in records:
        gap = record.unit.get("gap")
        real = f"{record.unit['object'].removeprefix('stanford-')} scans"
        groups.setdefault(f"{gap}° apart" if gap else real, []).append(record)
    groups["all"] = list(records)

    def first(kind: str, chosen: Records) -> str:
        answers = [record.result[kind] for record in chosen]
        return _share([bool(kept) and RIGHT.holds(kept[0]) for kept in answers])

    def rescored_cell(name: str, chosen: Records | None) -> str:
        if chosen is None:
            return f"{rescored(records, name)[1]:.3f}"
        return _share(rescored(chosen, name)[0])

    bare, full = (rescored(records, name) for name in ("agreement alone", "as it stands"))
    return {
        "limit": RIGHT,
        "first": {kind: first(kind, records) for kind in ANCHORS.values()},
        "anchors": f"{np.mean([record.result['anchors'] for record in records]):.0f}",
        "thin": THIN_OVERLAPS,
        "anchors_table": grid("anchors", ANCHORS, groups, first),
        "bare": {"first": _share(bare[0]), "auc": f"{bare[1]:.3f}"},
        "full": {"first": _share(full[0]), "auc": f"{full[1]:.3f}"},
        "table": grid("score", _same(WEIGHTS), {**groups, "AUC": None}, rescored_cell),
    }


def _share(is_right: Sequence[bool]) -> str:
    return f"{sum(is_right)}/{len(is_right)}"
