"""The tables on the page of Table 1."""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from benchmarks.paper.lines import ORDER
from benchmarks.paper.methods import METHODS
from benchmarks.paper.pages import markdown_table, percent
from benchmarks.paper.picks import by_gap, of, overlap_title, overlapping, told_by, values
from benchmarks.paper.study import Record
from benchmarks.paper.success import Limit, Told, cell, share_right

RIGHT = Limit(deg=1, percent=1)
SUCCESS = Limit(deg=2, percent=1)
"""What the study calls a success; beyond a right angle the floors ask for that."""
BASIN = Limit(deg=5, percent=2)
LIMIT_OF = {"paper-coarse": BASIN}
"""What is not refined cannot be held to the tight limit."""
PRINTED_GAPS = tuple(range(10, 100, 10))
PRINTED = {
    "M-ICC": ("< 1", "< 1", "< 1", "< 1", "< 1", "< 1", "58", "58", "62"),
    "Proposed": ("< 1",) * 9,
}
"""The paper's Table 1: rotation error in degrees at these gaps."""
OURS = (
    ("m-icc", "identity"),
    ("paper", "identity"),
    ("default", "identity"),
    ("paper", "random"),
    ("default", "random"),
)
"""What stands beside it."""
NEAR_GAP = 90
"""To this gap every pair must be right; beyond it the overlap says what can be asked."""
OVERLAPS = ((0.15, 1.01, 0.95), (0.10, 0.15, 0.80), (0.0, 0.10, None))
"""From, below, and the share of pairs that must be right there."""
PROTOCOL_TITLES = {"identity": "the paper's start", "random": "any start"}
EASY_GAP = 30
"""To this gap signatures that change with the silhouette might still match."""


def paper_form(records: Sequence[Record]) -> str:
    """Median rotation error of all azimuths, as the paper prints one number for a gap."""
    gaps = [gap for gap in sorted(values(records, "gap")) if gap <= NEAR_GAP]
    rows: list[tuple[str, ...]] = []
    if tuple(gaps) == PRINTED_GAPS:
        rows += [(f"the paper: {title}", "", *printed) for title, printed in PRINTED.items()]
    for name, (method, protocol) in product(values(records, "object"), OURS):
        told = by_gap(of(records, object=name, protocol=protocol), method)
        if told:
            title = f"{METHODS[method].title}, {PROTOCOL_TITLES[protocol]}"
            rows.append((title, name, *(_middle_error(told.get(gap, [])) for gap in gaps)))
    text = """\
Rotation error in degrees; ours are medians over all azimuths, those that are wrong and those
without an answer (180) included. The paper names neither its object nor its azimuth.

"""
    return text + markdown_table(("", "object", *(f"{gap}°" for gap in gaps)), rows)


def published(records: Sequence[Record]) -> str:
    """What eq. 1 matches at each gap, and what becomes of it."""
    known = [r for r in records if "matches" in r.result]
    rows = [_published_row(gap, of(known, gap=gap)) for gap in sorted(values(known, "gap"))]
    headings = (
        *("gap", "keypoints", "matches of eq. 1", "of these right", "right by chance"),
        *(f"coarse pose {BASIN}", f"after MM-ICC {BASIN}", f"after MM-ICC {RIGHT}"),
    )
    text = """\
From the paper's start, without noise. Eq. 1 gives each PA-HKS keypoint its nearest signature and
refuses those above the threshold; a match is right if its two places lie within 5 % of the diameter
on the object. By chance: if each of these keypoints were matched with any of the other scan.

"""
    return text + markdown_table(headings, rows) + _published_words(known)


def _published_row(gap: int, records: Sequence[Record]) -> tuple[str, ...]:
    right, by_chance = _shares_of_matches(records)
    asked = (("paper-coarse", BASIN), ("paper", BASIN), ("paper", RIGHT))
    told = [(told_by(records, method), limit) for method, limit in asked]
    return (
        f"{gap}°",
        f"{np.mean([r.result['matches']['keypoints'] for r in records]):.0f}",
        f"{np.mean([r.result['matches']['matched'] for r in records]):.1f}",
        percent(right),
        percent(by_chance),
        *(percent(share_right(each, limit)) if each else "-" for each, limit in told),
    )


def _published_words(records: Sequence[Record]) -> str:
    """Where the published recipe breaks."""
    coarse = told_by(records, "paper-coarse")
    if not coarse:
        return ""
    started = [r for r in records if BASIN.holds(r.result["answers"]["paper-coarse"])]
    text = f"\n{len(started)} of {len(coarse)} coarse poses lie within {BASIN}"
    if started:
        num_right = sum(RIGHT.holds(told) for told in told_by(started, "paper"))
        text += f", and MM-ICC makes {num_right} of these right"
    wide = beyond(records, EASY_GAP)
    if wide:
        right, by_chance = (percent(share) for share in _shares_of_matches(wide))
        text += (
            f". Beyond {EASY_GAP}° {right} of the matches are right, where chance gives {by_chance}"
        )
    return text + ".\n"


def _shares_of_matches(records: Sequence[Record]) -> tuple[float, float]:
    """Shares of the matches of all pairs together that are right, and that chance would give."""
    matches = [r.result["matches"] for r in records]
    matched, right, by_chance = (
        sum(each[key] for each in matches) for key in ("matched", "right", "by_chance")
    )
    return right / max(matched, 1), by_chance / max(matched, 1)


def by_overlap(records: Sequence[Record]) -> str:
    """Pairs that are more than a right angle apart."""
    far = beyond(of(records, protocol="random"), NEAR_GAP)
    if not far:
        return f"No pair here is more than {NEAR_GAP}° apart.\n"
    rows = []
    for noise, method in product(values(far, "noise"), ORDER):
        chosen = of(far, noise=noise)
        told = [told_by(overlapping(chosen, low, high), method) for low, high, _ in OVERLAPS]
        if any(told):
            cells = (_cell(method, each) for each in told)
            rows.append((METHODS[method].title, noise_title(noise), *cells))
    titles = (f"overlap {overlap_title(low, high)}" for low, high, _ in OVERLAPS)
    return markdown_table(("any start", "", *titles), rows)


def all_gaps(records: Sequence[Record]) -> Iterator[str]:
    """A heading and a table for each kind of start, object and noise."""
    kinds = (values(records, key) for key in ("noise", "protocol", "object"))
    for noise, protocol, name in product(*kinds):
        chosen = of(records, noise=noise, protocol=protocol, object=name)
        gaps = sorted(values(chosen, "gap"))
        told = {method: by_gap(chosen, method) for method in ORDER}
        rows = [
            (METHODS[method].title, *(_cell(method, each.get(gap, [])) for gap in gaps))
            for method, each in told.items()
            if each
        ]
        if rows:
            yield f"### {name}, {PROTOCOL_TITLES[protocol]}, {noise_title(noise)}\n"
            yield markdown_table(("", *(f"{gap}°" for gap in gaps)), rows)


def seconds(records: Sequence[Record]) -> str:
    """What the methods cost."""
    told = {method: told_by(records, method) for method in ORDER}
    rows = [
        (METHODS[method].title, f"{np.median([each['seconds'] for each in answers]):.2f}")
        for method, answers in told.items()
        if answers
    ]
    text = "Medians on one core, both scans prepared, and whatever else a method needs included.\n"
    return text + "\n" + markdown_table(("", "seconds"), rows)


def up_to(records: Sequence[Record], gap: int) -> list[Record]:
    """The pairs that are not farther apart."""
    return [r for r in records if r.unit["gap"] <= gap]


def beyond(records: Sequence[Record], gap: int) -> list[Record]:
    """The pairs that are farther apart."""
    return [r for r in records if r.unit["gap"] > gap]


def noise_title(noise: float) -> str:
    """The noise in words."""
    return f"noise {small_percent(noise)}" if noise else "no noise"


def small_percent(share: float) -> str:
    """A share as a percentage, with its decimals."""
    return f"{100 * share:g} %"


def _cell(method: str, told: Sequence[Told]) -> str:
    return cell(told, LIMIT_OF.get(method, RIGHT), BASIN)


def _middle_error(told: Sequence[Told]) -> str:
    """As the paper prints it: "< 1", or whole degrees."""
    if not told:
        return ""
    middle = float(np.median([180.0 if each["deg"] is None else each["deg"] for each in told]))
    return "< 1" if middle < 1 else f"{middle:.0f}"
