"""What the page of the ablations tells of its records."""

from collections.abc import Sequence

import numpy as np

from benchmarks.paper.ablations import parts
from benchmarks.paper.ablations.search import RIGHT
from benchmarks.study.pages import percent
from benchmarks.study.records import Answer, Records, grouped, of, values_of
from scanweld.geometry.arrays import FloatArray

KEYPOINTS = {"repeated": "repeated", "right by eq. 1": "matched"}
"""What is asked of keypoints, by its title."""


def widest(records: Records) -> Records:
    """The pairs at the widest gap."""
    return of(records, gap=max(values_of(records, "gap")))


def gaps_and_all(records: Records) -> dict[str, Records]:
    """The pairs by their gap, and all together."""
    return {**grouped(records, "gap", "{}° apart"), "all": records}


def contour_errors(records: Records, variant: str) -> list[Answer]:
    """Errors of a variant of MM-ICC from all starts."""
    return [error for record in records for error in record.result["errors"][variant]]


def apart(records: Records, prunings: str) -> list[str]:
    """Percentiles of the distance of true contours in pixels, medians over the pairs."""
    told = np.median([record.result["apart"][prunings] for record in records], axis=0)
    return [f"{value:.1f}" for value in told]


def term_errors(records: Records, name: str) -> FloatArray:
    """Errors with some of the terms: (2, N) degrees and % of the diameter."""
    return np.array([record.result["errors"][name] for record in records]).T


def term_middles(records: Records) -> dict[str, float]:
    """Median rotation errors by the terms."""
    names = (parts.ALONE, *parts.TERMS)
    return {name: float(np.median(term_errors(records, name)[0])) for name in names}


def term_cell(records: Records, name: str) -> str:
    """Median and 90th percentile of the rotation, median of the shift."""
    deg, shift = term_errors(records, name)
    return f"{np.median(deg):.3f} ({np.percentile(deg, 90):.2f}), {np.median(shift):.3f} %"


def with_overlap(records: Records) -> dict[str, Records]:
    """The pairs by their gap, with the median overlap in the titles."""
    return {
        f"{gap}° (overlap {np.median([r.result['overlap'] for r in pairs]):.2f})": pairs
        for gap, pairs in grouped(records, "gap").items()
    }


def heat_totals(records: Records, name: str, what: str) -> FloatArray:
    """Right, asked and by chance right (3,) on a surface that heat spreads on."""
    return np.sum([record.result[name][what] for record in records], axis=0)


def heat_cell(records: Records, name: str, what: str) -> str:
    """The share that is right, in brackets by chance."""
    right, asked, by_chance = heat_totals(records, name, what)
    return f"{percent(right / asked)} ({percent(by_chance / asked)})" if asked else "-"


def heat_gains(records: Records) -> dict[str, float]:
    """How far above chance keypoints repeat, by the surface, in points; the most first."""
    gains = {}
    for name in parts.HEAT:
        right, asked, by_chance = heat_totals(records, name, "repeated")
        gains[name] = 100 * (right - by_chance) / asked if asked else 0.0
    return dict(sorted(gains.items(), key=lambda entry: -entry[1]))


def keypoints_a_view(records: Records, name: str) -> str:
    """Mean number of keypoints on a surface."""
    return f"{np.mean([k for r in records for k in r.result[name]['keypoints']]):.0f}"


def coarse_errors(records: Records, name: str) -> list[Answer]:
    """Errors of the coarse pose in a reading of the published step."""
    return [record.result[name] for record in records]


def by_kind(records: Records) -> dict[str, Records]:
    """Virtual views by their gap, real pairs by their object, and all together."""
    virtual = [r for r in records if "gap" in r.unit]
    real = [r for r in records if "gap" not in r.unit]
    scans = {
        f"{name.removeprefix('stanford-')} scans": own
        for name, own in grouped(real, "object").items()
    }
    return {**grouped(virtual, "gap", "{}° apart"), **scans, "all": records}


def first_right(records: Records, anchors: str) -> str:
    """How often the first answer is right with some of the anchors."""
    kept = [record.result[anchors][:1] for record in records]
    return fraction([any(map(RIGHT.holds, each)) for each in kept])


def fraction(is_right: Sequence[bool]) -> str:
    """How many of all are right."""
    return f"{sum(is_right)}/{len(is_right)}"
