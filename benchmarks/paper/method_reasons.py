"""Why the readings of docs/method.md were taken: numbers of the ablations and the basins."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.paper import basins
from benchmarks.paper.ablations import coarse, contours, heat, search, terms
from benchmarks.paper.method_results import Results
from benchmarks.paper.pages import percent
from benchmarks.paper.study import Record
from benchmarks.paper.success import Limit

WIDE_GAP, FAR_START = 90, 40
"""Where basins are told of, in degrees."""

Told = Mapping[str, Any]
Reason = Callable[[Results], str]


def _right(told: Sequence[Told], limit: Limit) -> str:
    return f"{sum(map(limit.holds, told))} of {len(told)}"


def _of(results: Results, part: str) -> list[Record]:
    return [record for record in results.table("ablations") if record.unit["part"] == part]


def _basin(results: Results, method: str) -> str:
    """Right answers of a method from far off at the widest gap."""
    at_gap = [r for r in results.table("basins") if r.unit["gap"] == WIDE_GAP]
    told = [record.result["answers"][str(FAR_START)][method] for record in at_gap]
    return _right(told, basins.CONVERGED)


def _contour_runs(results: Results, variant: str) -> list[Told]:
    return [e for record in _of(results, "contours") for e in record.result["errors"][variant]]


def _contours(results: Results, variant: str) -> str:
    """Runs of a variant of MM-ICC that come right."""
    return _right(_contour_runs(results, variant), contours.CONVERGED)


def _contour_error(results: Results, variant: str) -> str:
    """Median error of these, in degrees and in % of the diameter."""
    told = [e for e in _contour_runs(results, variant) if contours.CONVERGED.holds(e)]
    if not told:
        return "-"
    deg, shift = (np.median([e[key] for e in told]) for key in ("deg", "percent"))
    return f"{deg:.2f} deg and {shift:.2f} %"


def _apart(results: Results, prunings: str) -> str:
    """90th percentile of the distance of true contours at the widest gap, in pixels."""
    at_gap = [r for r in _of(results, "contours") if r.unit["gap"] == WIDE_GAP]
    return f"{np.median([r.result['apart'][prunings][-1] for r in at_gap]):.1f}"


def _heat(results: Results, variant: str, what: str) -> str:
    """Share of keypoints repeated, or rightly matched by eq. 1; in brackets by chance."""
    told = [record.result[variant][what] for record in _of(results, "heat")]
    right, asked, by_chance = np.sum(told, axis=0)
    return f"{percent(right / asked)} ({percent(by_chance / asked)})"


def _coarse(results: Results, variant: str) -> str:
    """Right coarse poses in a reading of the published step."""
    told = [record.result[variant] for record in _of(results, "coarse")]
    return _right(told, coarse.RIGHT)


def _first(results: Results, score: str) -> str:
    """Pairs whose right pose comes first by a score, of those that the default keeps; and AUC."""
    firsts, value = search.rescored(_of(results, "search"), search.SCORES[score])
    return f"{sum(firsts)} of {len(firsts)} (AUC {value:.3f})"


def _kept_median(results: Results, right: bool, kinds: Sequence[str]) -> str:
    """Median share of samples of some kinds over the right or the wrong poses that are kept."""
    kept = [pose for record in _of(results, "search") for pose in record.result["mixed"]]
    shares = [sum(p[kind] for kind in kinds) for p in kept if search.RIGHT.holds(p) is right]
    return percent(float(np.median(shares)))


def _terms(results: Results, name: str) -> str:
    """Median rotation error by gap with some of the terms of the joint refinement."""
    of = _of(results, "terms")
    gaps = dict.fromkeys(record.unit["gap"] for record in of)
    middle = [
        float(np.median([r.result["errors"][name][0] for r in of if r.unit["gap"] == gap]))
        for gap in gaps
    ]
    return " / ".join(f"{value:.2f}" for value in middle)


def _gaps(results: Results) -> str:
    return " / ".join(str(g) for g in dict.fromkeys(r.unit["gap"] for r in _of(results, "terms")))


_CONTOURS = {
    "published": contours.PUBLISHED,
    "without-1": "without pruning 1",
    "without-2": "without pruning 2",
    "without-3": "without pruning 3",
    "unpruned": "without any pruning",
    "eq4-place": "eq. 4 by place",
    "eq6-depth": "eq. 6 by depth",
    "eq6-observed": "eq. 6 by the observed normal",
    "eq6-printed": "eq. 6 as printed",
    "mutual": "mutual matches",
    "untrimmed": "all matches, untrimmed",
    "image": "distance in the image",
    "point": "distance in space",
    "outline": "then across the outline",
}
_HEAT = {
    "closed": heat.CLOSED,
    "bridged": "closed, jumps bridged",
    "open": "open (Neumann)",
    "cold": "open, cold rims (Dirichlet)",
    "sun": "closed, times of Sun et al.",
}
_COARSE = {
    "taken": coarse.TAKEN,
    "half": "the better half of the matches",
    "quarter": "the better quarter of the matches",
    "mutual": "mutual matches",
    "keypoints": "ICP of the keypoints alone",
    "trimmed": "trimmed ICP",
    "consensus": "ours: start where the nearest signatures agree",
    "evidence": "ours: start where the evidence is best",
    "consensus-trimmed": "the former, trimmed ICP",
    "evidence-trimmed": "the latter, trimmed ICP",
}
_TERMS = {"contours": terms.ALONE, "surfaces": "surfaces alone", "both": "both"}
_KINDS = {"agree": ("agree",), "violated": ("front", "contradict", "free")}
_SCORES = {
    "full": "as it stands",
    "alike": "violations weighted like agreement",
    "no-front": "without what lies in front",
    "no-contradict": "without contradicting normals",
    "no-free": "without free space",
    "agree": "agreement alone",
}

REASONS: dict[str, Reason] = {
    "wide-gap": lambda _: str(WIDE_GAP),
    "far-start": lambda _: str(FAR_START),
    "terms-gaps": _gaps,
    "terms-start": lambda _: f"{terms.START_DEG:g}",
    **{
        f"{name}-error": partial(_contour_error, variant=_CONTOURS[name])
        for name in ("published", "image", "point", "outline")
    },
    "apart-none": partial(_apart, prunings="none"),
    "apart-12": partial(_apart, prunings="1 and 2"),
    "apart-123": partial(_apart, prunings="1, 2 and 3"),
    **{
        f"basin-{method}": partial(_basin, method=method)
        for method in (*basins.FROM_A_START, basins.JOINT)
        if method != "icp"
    },
    **{f"contours-{name}": partial(_contours, variant=v) for name, v in _CONTOURS.items()},
    **{
        f"heat-{name}-{what}": partial(_heat, variant=variant, what=what)
        for name, variant in _HEAT.items()
        for what in ("repeated", "matched")
    },
    **{
        f"kept-{name}-{what}": partial(_kept_median, right=name == "right", kinds=kinds)
        for name in ("right", "wrong")
        for what, kinds in _KINDS.items()
    },
    **{f"coarse-{name}": partial(_coarse, variant=v) for name, v in _COARSE.items()},
    **{f"terms-{name}": partial(_terms, name=term) for name, term in _TERMS.items()},
    **{f"score-{name}": partial(_first, score=score) for name, score in _SCORES.items()},
}
"""Name in the template -> what computes its text."""
