"""What stands on the page of Table 1."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.methods import BY_TITLE, METHODS, curve
from benchmarks.study.pages import grid, markdown_table, percent
from benchmarks.study.plots import Panel, draw_panels
from benchmarks.study.records import (
    answers,
    beyond,
    of,
    overlap_title,
    overlapping,
    up_to,
    values_of,
)
from benchmarks.study.study import Record
from benchmarks.study.success import Answer, Limit, cell, share_right

Records = Sequence[Record]

RIGHT = Limit(deg=1, percent=1)
SUCCESS = Limit(deg=2, percent=1)
"""What the study calls a success; beyond a right angle the floors ask for that."""
BASIN = Limit(deg=5, percent=2)
LIMIT_OF = {"paper-coarse": BASIN}
"""What is not refined cannot be held to the tight limit."""
PRINTED_GAPS = list(range(10, 100, 10))
PRINTED = {
    "M-ICC": ("< 1", "< 1", "< 1", "< 1", "< 1", "< 1", "58", "58", "62"),
    "Proposed": ("< 1",) * 9,
}
"""The paper's Table 1: rotation error in degrees at these gaps,"""
OURS = (
    ("m-icc", "identity"),
    ("paper", "identity"),
    ("default", "identity"),
    ("paper", "random"),
    ("default", "random"),
)
"""and what stands beside it."""
NEAR_GAP = 90
"""To this gap every pair must be right; beyond it the overlap says what can be asked."""
M_ICC_GAP = 60
"""To this gap the paper's M-ICC succeeds."""
EASY_GAP = 30
"""To this gap signatures that change with the silhouette might still match."""
OVERLAPS = ((0.15, 1.01, 0.95), (0.10, 0.15, 0.80), (0.0, 0.10, None))
"""From, below, and the share of pairs that must be right there."""
PROTOCOLS = {"identity": "the paper's start", "random": "any start"}


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template; the plot goes to the folder ``out``."""
    clean = of(records, noise=0.0)
    _draw(clean, out / "table1.png")
    noise = max(values_of(records, "noise"))
    return {
        "objects": " or ".join(values_of(records, "object")),
        "noise": f"{100 * noise:g} %" if noise else "",
        "basin": BASIN,
        "any_start": _from_any_start(of(clean, protocol="random")),
        "paper_start": _from_the_papers_start(of(clean, protocol="identity")),
        "near_gap": NEAR_GAP,
        "m_icc_gap": M_ICC_GAP,
        "easy_gap": EASY_GAP,
        **_floors(records),
        "paper_form": _paper_form(clean),
        "coarse": _coarse([r for r in records if "matches" in r.result]),
        "by_overlap": _by_overlap(beyond(of(records, protocol="random"), NEAR_GAP)),
        "all_gaps": dict(_all_gaps(records)),
        "seconds": grid("", BY_TITLE, {"seconds": records}, lambda m, r: _seconds(r, m)),
    }


def _from_any_start(records: Records) -> dict[str, str]:
    """The default beside the best of the others; nothing if the default was not tried."""
    if not answers(records, "default"):
        return {}
    near, far = up_to(records, NEAR_GAP), beyond(records, NEAR_GAP)

    def counts(method: str, words: str) -> str:
        told = f"{RIGHT.count(answers(near, method))}{words}"
        return told + (f" and {RIGHT.count(answers(far, method))}" if far else "")

    others = [m for m in METHODS if m not in ("default", *LIMIT_OF) and answers(records, m)]
    told = {
        "default": counts("default", f" pairs to {NEAR_GAP}°") + (" beyond" if far else ""),
        "best": "",
    }
    if others:
        best = max(others, key=lambda method: share_right(answers(records, method), RIGHT))
        told |= {"best": METHODS[best].title, "best_count": counts(best, "")}
    return told


def _from_the_papers_start(records: Records) -> dict[str, dict[str, str]]:
    """Right answers of the paper's methods, near and farther apart."""
    parts = {
        f"to {M_ICC_GAP}°": up_to(records, M_ICC_GAP),
        f"from there to {NEAR_GAP}°": beyond(up_to(records, NEAR_GAP), M_ICC_GAP),
    }
    return {
        where: {
            name: RIGHT.count(answers(inside, method))
            for name, method in (("m_icc", "m-icc"), ("mm_icc", "mm-icc"), ("paper", "paper"))
        }
        for where, inside in parts.items()
        if answers(inside, "m-icc")
    }


def _floors(records: Records) -> dict[str, str]:
    """Floors of the default, and the pairs that miss them."""
    rows: list[tuple[str, ...]] = []
    missed: list[Record] = []
    for asked, chosen, limit, floor in _asked(records):
        tried = [r for r in chosen if "default" in r.result["answers"]]
        wrong = [r for r in tried if not limit.holds(r.result["answers"]["default"])]
        if tried:
            num_right = len(tried) - len(wrong)
            verdict = "pass" if num_right >= floor * len(tried) else "**FAIL**"
            rows.append((asked, str(limit), f"{num_right}/{len(tried)}", percent(floor), verdict))
            missed += [r for r in wrong if r not in missed]
    headings = ("pair", "start", "noise", "overlap", "error of the default", "accepted")
    return {
        "floors": markdown_table(("default", "error", "pairs", "floor", ""), rows),
        "missed": markdown_table(headings, map(_missed_row, missed)) if missed else "",
    }


def _asked(records: Records) -> Iterator[tuple[str, Records, Limit, float]]:
    """What is asked of the default: in words, of which pairs, how exact, and of what share."""
    for noise in values_of(records, "noise"):
        chosen = of(records, noise=noise)
        for protocol, name in product(values_of(chosen, "protocol"), values_of(chosen, "object")):
            near = up_to(of(chosen, object=name, protocol=protocol), NEAR_GAP)
            where = f"{name}, {PROTOCOLS[protocol]}, to {NEAR_GAP}°, {_noise_title(noise)}"
            yield where, near, RIGHT, 1.0
        from_anywhere = of(chosen, protocol="random")
        far = beyond(from_anywhere, NEAR_GAP)
        asked = [(low, high, floor) for low, high, floor in OVERLAPS if floor is not None]
        for low, _, floor in asked:
            where = f"any start, any gap, overlap from {low:.2f}, {_noise_title(noise)}"
            yield where, overlapping(from_anywhere, low, 1.01), SUCCESS, floor
        for low, high, floor in asked:
            where = f"any start, beyond {NEAR_GAP}°, overlap {overlap_title(low, high)}"
            yield f"{where}, {_noise_title(noise)}", overlapping(far, low, high), SUCCESS, floor


def _missed_row(record: Record) -> tuple[str, ...]:
    unit, answer = record.unit, record.result["answers"]["default"]
    error = "no answer"
    if answer["deg"] is not None:
        error = f"{answer['deg']:.1f}°, {answer['percent']:.1f} %"
    return (
        f"{unit['object']}, {unit['azimuth']}° and {unit['azimuth'] + unit['gap']}°",
        PROTOCOLS[unit["protocol"]],
        _noise_title(unit["noise"]),
        f"{record.result['overlap']:.2f}",
        error,
        "yes" if answer["accepted"] else "no",
    )


def _paper_form(records: Records) -> str:
    """Median rotation error of all azimuths, as the paper prints one number for a gap."""
    gaps = [gap for gap in sorted(values_of(records, "gap")) if gap <= NEAR_GAP]
    rows: dict[tuple[str, ...], Sequence[str]] = {}
    if gaps == PRINTED_GAPS:
        rows = {(f"the paper: {title}", ""): printed for title, printed in PRINTED.items()}
    for name, (method, protocol) in product(values_of(records, "object"), OURS):
        chosen = of(records, object=name, protocol=protocol)
        title = (f"{METHODS[method].title}, {PROTOCOLS[protocol]}", name)
        rows[title] = [_middle_error(answers(of(chosen, gap=gap), method)) for gap in gaps]
    columns = {f"{gap}°": column for column, gap in enumerate(gaps)}
    return grid(("", "object"), rows, columns, lambda row, column: row[column])


def _middle_error(told: Sequence[Answer]) -> str:
    """As the paper prints it: "< 1", or whole degrees."""
    if not told:
        return ""
    middle = float(np.median([180.0 if each["deg"] is None else each["deg"] for each in told]))
    return "< 1" if middle < 1 else f"{middle:.0f}"


def _coarse(records: Records) -> dict[str, Any]:
    """What eq. 1 matches at each gap, and what becomes of it."""
    columns = {
        "keypoints": lambda r: f"{_mean_number(r, 'keypoints'):.0f}",
        "matches of eq. 1": lambda r: f"{_mean_number(r, 'matched'):.1f}",
        "of these right": lambda r: share_of_matches(r, "right"),
        "right by chance": lambda r: share_of_matches(r, "by_chance"),
        f"coarse pose {BASIN}": lambda r: _share(answers(r, "paper-coarse"), BASIN),
        f"after MM-ICC {BASIN}": lambda r: _share(answers(r, "paper"), BASIN),
        f"after MM-ICC {RIGHT}": lambda r: _share(answers(r, "paper"), RIGHT),
    }
    gaps = {f"{gap}°": of(records, gap=gap) for gap in sorted(values_of(records, "gap"))}
    coarse, wide = answers(records, "paper-coarse"), beyond(records, EASY_GAP)
    started = [r for r in records if BASIN.holds(r.result["answers"].get("paper-coarse", _NONE))]
    fine = answers(started, "paper")
    return {
        "table": grid("gap", gaps, columns, lambda chosen, of_column: of_column(chosen)),
        "tried": len(coarse),
        "started": len(started),
        "then_right": sum(map(RIGHT.holds, fine)),
        "right": share_of_matches(wide, "right") if wide else "",
        "by_chance": share_of_matches(wide, "by_chance"),
    }


_NONE: Answer = {"deg": None, "percent": None}


def _mean_number(records: Records, key: str) -> float:
    return float(np.mean([record.result["matches"][key] for record in records]))


def share_of_matches(records: Records, key: str) -> str:
    """Share of the matches of all pairs together that are right, or that chance would give."""
    matches = [r.result["matches"] for r in records]
    return percent(sum(m[key] for m in matches) / max(sum(m["matched"] for m in matches), 1))


def _share(told: Sequence[Answer], limit: Limit) -> str:
    return percent(share_right(told, limit)) if told else "-"


def _by_overlap(records: Records) -> str:
    """Pairs that are more than a right angle apart; nothing where there are none."""
    noises = values_of(records, "noise")
    rows = {
        (METHODS[method].title, _noise_title(noise)): (of(records, noise=noise), method)
        for noise, method in product(noises, METHODS)
    }
    columns = {f"overlap {overlap_title(low, high)}": (low, high) for low, high, _ in OVERLAPS}
    return grid(
        ("any start", ""),
        rows,
        columns,
        lambda row, edges: _cell(row[1], answers(overlapping(row[0], *edges), row[1])),
    )


def _all_gaps(records: Records) -> Iterator[tuple[str, str]]:
    """A heading and a table for each kind of start, object and noise."""
    kinds = (values_of(records, key) for key in ("noise", "protocol", "object"))
    for noise, protocol, name in product(*kinds):
        chosen = of(records, noise=noise, protocol=protocol, object=name)
        gaps = {f"{gap}°": of(chosen, gap=gap) for gap in sorted(values_of(chosen, "gap"))}
        title = f"{name}, {PROTOCOLS[protocol]}, {_noise_title(noise)}"
        if chosen:
            yield title, grid("", BY_TITLE, gaps, lambda m, at_gap: _cell(m, answers(at_gap, m)))


def _seconds(records: Records, method: str) -> str:
    told = [each["seconds"] for each in answers(records, method)]
    return f"{np.median(told):.2f}" if told else ""


def _cell(method: str, told: Sequence[Answer]) -> str:
    return cell(told, LIMIT_OF.get(method, RIGHT), BASIN)


def _noise_title(noise: float) -> str:
    return f"noise {100 * noise:g} %" if noise else "no noise"


def _draw(records: Records, path: Path) -> None:
    """Share of right answers against the gap, a panel for each kind of start."""
    panels = []
    for protocol in values_of(records, "protocol"):
        chosen = of(records, protocol=protocol)
        gaps = sorted(values_of(chosen, "gap"))
        shares = {
            method: [
                share_right(answers(of(chosen, gap=gap), method), LIMIT_OF.get(method, RIGHT))
                for gap in gaps
            ]
            for method in METHODS
        }
        curves = {
            METHODS[method].title: curve(method, gaps, of_method)
            for method, of_method in shares.items()
        }
        ticks = {gap: str(gap) for gap in gaps}
        panels.append(Panel(title=PROTOCOLS[protocol], curves=curves, ticks=ticks))
    draw_panels(path, [panels], "gap between the views (°)", "right answers (%)")
