"""What the page of Table 1 tells of its records."""

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.paper.methods import BY_TITLE, METHODS, curve
from benchmarks.study.pages import grid, markdown_table, percent
from benchmarks.study.plots import Panel, draw_panels
from benchmarks.study.records import (
    Answer,
    Limit,
    Records,
    answers,
    beyond,
    grouped,
    of,
    overlap_title,
    overlapping,
    up_to,
    values_of,
)
from benchmarks.study.study import Record

RIGHT = Limit(deg=1, percent=1)
SUCCESS = Limit(deg=2, percent=1)
"""What the study calls a success; beyond a right angle the floors ask for that."""
BASIN = Limit(deg=5, percent=2)
LIMIT_OF = dict.fromkeys(METHODS, RIGHT) | {"paper-coarse": BASIN}
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
STARTS = {"identity": "the paper's start", "random": "any start"}


def best_but_default(records: Records) -> str | None:
    """The other method that is right most often; None if no other was tried."""
    others = [m for m, limit in LIMIT_OF.items() if limit is RIGHT and m != "default"]
    tried = [method for method in others if answers(records, method)]
    return max(tried, key=lambda m: RIGHT.share(answers(records, m)), default=None)


def floors(records: Records) -> tuple[str, list[Record]]:
    """The table of what must hold of the default, and the pairs that miss it."""
    rows: list[tuple[str, ...]] = []
    missed: list[Record] = []
    for asked, chosen, limit, floor in _asked(records):
        tried = [r for r in chosen if "default" in r.result["answers"]]
        wrong = [r for r in tried if not limit.holds(r.result["answers"]["default"])]
        if tried:
            right = len(tried) - len(wrong)
            verdict = "pass" if right >= floor * len(tried) else "**FAIL**"
            rows.append((asked, str(limit), f"{right}/{len(tried)}", percent(floor), verdict))
            missed += [r for r in wrong if r not in missed]
    return markdown_table(("default", "error", "pairs", "floor", ""), rows), missed


def _asked(records: Records) -> Iterator[tuple[str, Records, Limit, float]]:
    """What is asked of the default: in words, of which pairs, how exact, and of what share."""
    floors = [(low, high, floor) for low, high, floor in OVERLAPS if floor is not None]
    for value in values_of(records, "noise"):
        noise, chosen = noise_title(value), of(records, noise=value)
        for protocol, name in product(values_of(chosen, "protocol"), values_of(chosen, "object")):
            near = up_to(of(chosen, object=name, protocol=protocol), NEAR_GAP)
            yield f"{name}, {STARTS[protocol]}, to {NEAR_GAP}°, {noise}", near, RIGHT, 1.0
        pairs = of(chosen, protocol="random")
        for low, _, floor in floors:
            where = f"any start, any gap, overlap from {low:.2f}, {noise}"
            yield where, overlapping(pairs, low, 1.01), SUCCESS, floor
        for low, high, floor in floors:
            where = f"any start, beyond {NEAR_GAP}°, overlap {overlap_title(low, high)}, {noise}"
            yield where, overlapping(beyond(pairs, NEAR_GAP), low, high), SUCCESS, floor


def paper_form(records: Records) -> str:
    """Median rotation error of all azimuths, as the paper prints one number for a gap."""
    gaps = [gap for gap in values_of(records, "gap") if gap <= NEAR_GAP]
    rows: dict[tuple[str, ...], Sequence[str]] = {}
    if gaps == PRINTED_GAPS:
        rows = {(f"the paper: {title}", ""): printed for title, printed in PRINTED.items()}
    for name, (method, protocol) in product(values_of(records, "object"), OURS):
        chosen = of(records, object=name, protocol=protocol)
        title = (f"{METHODS[method].title}, {STARTS[protocol]}", name)
        rows[title] = [_middle_error(answers(of(chosen, gap=gap), method)) for gap in gaps]
    columns = {f"{gap}°": column for column, gap in enumerate(gaps)}
    return grid(("", "object"), rows, columns, lambda row, column: row[column])


def _middle_error(told: Sequence[Answer]) -> str:
    """As the paper prints it: "< 1", or whole degrees."""
    if not told:
        return ""
    middle = float(np.median([180.0 if each["deg"] is None else each["deg"] for each in told]))
    return "< 1" if middle < 1 else f"{middle:.0f}"


def mean_matches(records: Records, key: str) -> float:
    """Mean number of keypoints, or of matches of eq. 1, of a pair."""
    return float(np.mean([record.result["matches"][key] for record in records]))


def share_of_matches(records: Records, key: str) -> str:
    """Share of the matches of all pairs together that are right, or that chance would give."""
    matches = [r.result["matches"] for r in records]
    return percent(sum(m[key] for m in matches) / max(sum(m["matched"] for m in matches), 1))


COARSE = {
    "keypoints": lambda r: f"{mean_matches(r, 'keypoints'):.0f}",
    "matches of eq. 1": lambda r: f"{mean_matches(r, 'matched'):.1f}",
    "of these right": lambda r: share_of_matches(r, "right"),
    "right by chance": lambda r: share_of_matches(r, "by_chance"),
    f"coarse pose {BASIN}": lambda r: _share(r, "paper-coarse", BASIN),
    f"after MM-ICC {BASIN}": lambda r: _share(r, "paper", BASIN),
    f"after MM-ICC {RIGHT}": lambda r: _share(r, "paper", RIGHT),
}
"""What eq. 1 matches, and what becomes of it."""


def _share(records: Records, method: str, limit: Limit) -> str:
    told = answers(records, method)
    return percent(limit.share(told)) if told else "-"


def started(records: Records) -> Records:
    """The pairs whose coarse pose could be refined."""
    return [r for r in records if any(map(BASIN.holds, answers([r], "paper-coarse")))]


def by_overlap(records: Records) -> str:
    """A row for each method and noise."""
    rows = {
        (METHODS[method].title, noise_title(noise)): (of(records, noise=noise), method)
        for noise, method in product(values_of(records, "noise"), METHODS)
    }
    columns = {f"overlap {overlap_title(low, high)}": (low, high) for low, high, _ in OVERLAPS}

    def cell(row: tuple[Records, str], edges: tuple[float, float]) -> str:
        return method_cell(overlapping(row[0], *edges), row[1])

    return grid(("any start", ""), rows, columns, cell)


def method_cell(records: Records, method: str) -> str:
    """Right answers of a method, and those from where a refinement could put them right."""
    return LIMIT_OF[method].cell(answers(records, method), BASIN)


def noise_title(noise: float) -> str:
    """Standard deviation of the depth in words."""
    return f"noise {100 * noise:g} %" if noise else "no noise"


def draw(records: Records, out: Path) -> None:
    """Share of right answers against the gap, a panel for each kind of start."""
    panels = []
    for protocol, chosen in grouped(of(records, noise=0.0), "protocol").items():
        gaps = grouped(chosen, "gap")
        panel = Panel(STARTS[protocol], {int(gap): gap for gap in gaps})
        for title, method in BY_TITLE.items():
            limit = LIMIT_OF[method]
            shares = [limit.share(answers(at_gap, method)) for at_gap in gaps.values()]
            panel.curves[title] = curve(method, shares)
        panels.append(panel)
    draw_panels(out / "table1.png", [panels], "gap between the views (°)", "right answers (%)")
