"""The numbers of docs/method.md that were measured, each by its name in the template."""

from collections.abc import Callable, Sequence
from functools import partial
from statistics import mean, mode
from typing import Any, Literal

import numpy as np
from scanweld.pairs.alternatives import schedules

from benchmarks.paper.method_page import Results
from benchmarks.paper.method_reasons import REASONS
from benchmarks.paper.pages import percent
from benchmarks.paper.settings import SETTINGS, is_converged
from benchmarks.paper.study import Record
from benchmarks.paper.success import Limit, auc
from benchmarks.paper.table2 import SWEEP_DEG
from scanweld.config import Config
from scanweld.evidence.evidence import Evidence

Answer = dict[str, Any]
"""A record of benchmarks/pairs.py."""

WIDE, THIN = (0.10, 1.01), (0.05, 0.10)
"""Overlaps of real pairs."""
FEATURE_GAPS = (30, 50, 70, 90)
MAX_GAP = 90
"""What the paper claims to reach."""
RIGHT, NEAR = Limit(deg=2.0, percent=1.0), Limit(deg=5.0, percent=2.0)
SIMPLE = ("i", "iv")


def answers(results: Results, anchors: str = "mixed") -> list[Answer]:
    """First answers on real pairs, of one kind of anchors."""
    return [a for a in results.data("pairs") if a["anchors"] == anchors and a["score"] is not None]


def is_right(answer: Answer) -> bool:
    """Whether the first answer is."""
    return answer["rank"] == 1


def evidence(answer: Answer) -> Evidence:
    """What speaks for and against it."""
    return Evidence(**answer["evidence"])


def _right_pairs(results: Results, anchors: str, overlap: tuple[float, float]) -> str:
    of = [a for a in results.data("pairs") if a["anchors"] == anchors]
    inside = [is_right(a) for a in of if overlap[0] <= a["overlap"] < overlap[1]]
    return f"{sum(inside)} of {len(inside)}"


def _pair_seconds(results: Results, anchors: str) -> str:
    return f"{mean(a['seconds'] for a in answers(results, anchors)):.2f}"


def _free_of_right(results: Results) -> str:
    free = [evidence(a).free for a in answers(results) if is_right(a)]
    return percent(float(np.quantile(free, 0.9)))


def _auc(results: Results, score: Callable[[Evidence], float]) -> str:
    of = answers(results)
    return f"{auc([score(evidence(a)) for a in of], [is_right(a) for a in of]):.3f}"


def _good(results: Results, right: bool) -> str:
    return str(sum(a["kind"] == "good" and is_right(a) is right for a in answers(results)))


def _scored(results: Results) -> list[Answer]:
    return [a for a in answers(results) if a["score"] >= Config().pairs.min_score]


def _least_observability(results: Results) -> str:
    return f"{min(a['observability'] for a in _scored(results) if is_right(a)):.1e}"


def _sets(results: Results, standing: str) -> str:
    runs = results.data("sets")
    total = sum(len(run["scans"]) for run in runs)
    count = sum(run[standing] for run in runs)
    return f"{count} of {total}" if standing == "right" else str(count)


def _heat_hypotheses(results: Results) -> str:
    keypoints = mean(record["keypoints"] for record in results.data("keypoints"))
    return f"{keypoints**2 * Config().pairs.num_turns:,.0f}"


def _even_hypotheses(results: Results) -> str:
    return f"{Config().pairs.num_anchors ** 2 * Config().pairs.num_turns:,}"


def _table1(
    results: Results, method: str, limit: Limit, protocol: Literal["identity", "random"]
) -> str:
    """Right noise-free answers of a method, gaps as the paper has them."""
    told = [
        record.result["answers"][method]
        for record in results.table("table1")
        if record.unit["protocol"] == protocol
        and not record.unit["noise"]
        and record.unit["gap"] <= MAX_GAP
        and method in record.result["answers"]
    ]
    return f"{sum(map(limit.holds, told))} of {len(told)}"


def _eq1(results: Results, part: str, whole: str) -> str:
    told = [record.result.get("matches") for record in results.table("table1")]
    matches = [m for m in told if m is not None]
    return percent(sum(m[part] for m in matches) / sum(m[whole] for m in matches))


def _keypoints_matched(results: Results) -> str:
    told = [record.result.get("matches") for record in results.table("table1")]
    matches = [m for m in told if m is not None]
    return (
        f"{mean(m['matched'] for m in matches):.0f} of {mean(m['keypoints'] for m in matches):.0f}"
    )


def _features(results: Results, place: int, of: Callable[[Record], Sequence[float]]) -> str:
    """Shares by gap: right (0) or by chance (2) of those asked (1)."""
    shares = []
    for gap in FEATURE_GAPS:
        told = [of(r) for r in results.table("features") if r.unit["gap"] == gap]
        shares.append(percent(sum(t[place] for t in told) / sum(t[1] for t in told)))
    return f"{', '.join(shares[:-1])} and {shares[-1]}"


def _repeated(record: Record) -> Sequence[float]:
    return record.result["detectors"]["PA-HKS"]["repeated"]


def _nearest(record: Record) -> Sequence[float]:
    return record.result["own"]["PA-HKS"]["nearest"]


def _table2(results: Results, method: str) -> list[Record]:
    return [
        record
        for record in results.table("table2")
        if record.unit["part"] == "final"
        and record.unit["method"] == method
        and not record.unit["noise"]
    ]


def _converged(results: Results, method: str, simple: bool) -> str:
    """From the given starts: the coarse pose is not one that every setting has."""
    runs = [
        run
        for record in _table2(results, method)
        if (record.unit["setting"] in SIMPLE) is simple
        for run in record.result["runs"]
        if run["start"] != "coarse"
    ]
    return f"{sum(map(_has_converged, runs))} of {len(runs)}"


def _has_converged(run: dict[str, Any]) -> bool:
    """A run without errors did not place all views."""
    return "rotation_deg" in run and is_converged(run["rotation_deg"], run["translation_percent"])


def _sweep(results: Results, method: str, key: str) -> str:
    """Converged runs of the tuning's sweep by one setting, the others at their middle."""
    records = [
        record
        for record in results.table("table2")
        if record.unit["part"] == "sweep" and record.unit["method"] == method
    ]
    # One setting is changed at a time, so that the middle is what most records have.
    middle = {k: mode(record.unit[k] for record in records) for k in ("tau", "renders", "trim")}
    runs: dict[Any, list[dict[str, Any]]] = {}
    for record in records:
        if all(record.unit[k] == middle[k] for k in middle if k != key):
            runs.setdefault(record.unit[key], []).extend(record.result["runs"])
    values = sorted(runs, key=lambda value: (value is None, value or 0.0))
    shares = [
        f"{sum(map(_has_converged, runs[value]))} of {len(runs[value])} with "
        + ("one found anew" if value is None else f"{value:g}")
        for value in values
    ]
    return ", ".join(shares)


def _below_the_paper(results: Results) -> str:
    records = _table2(results, "default")
    printed = [(SETTINGS[record.unit["setting"]].printed or (0.0, 0.0))[1] for record in records]
    below = [_rms(r) < limit for r, limit in zip(records, printed, strict=True)]
    return f"{sum(below)} of {len(below)}"


def _rms(record: Record) -> float:
    """Mean RMS of the runs that converged, in the mesh's unit; NaN if none did."""
    percents = [run["rms_percent"] for run in record.result["runs"] if _has_converged(run)]
    return float(np.mean(percents)) * record.result["diameter"] / 100 if percents else np.nan


def _radii(which: int) -> str:
    schedule = schedules(1.0)[which]
    return f"{schedule.first_radius:g} to {schedule.last_radius:g}"


NUMBERS: dict[str, Callable[[Results], str]] = {
    "free-of-right": _free_of_right,
    "repeated": partial(_features, place=0, of=_repeated),
    "repeated-chance": partial(_features, place=2, of=_repeated),
    "precision": partial(_features, place=0, of=_nearest),
    "precision-chance": partial(_features, place=2, of=_nearest),
    "coarse-matched": _keypoints_matched,
    "coarse-right": partial(_eq1, part="right", whole="matched"),
    "coarse-chance": partial(_eq1, part="by_chance", whole="matched"),
    "coarse-identity": partial(_table1, method="paper-coarse", limit=NEAR, protocol="identity"),
    "paper-identity": partial(_table1, method="paper", limit=RIGHT, protocol="identity"),
    "m-icc-identity": partial(_table1, method="m-icc", limit=RIGHT, protocol="identity"),
    "default-identity": partial(_table1, method="default", limit=RIGHT, protocol="identity"),
    "default-random": partial(_table1, method="default", limit=RIGHT, protocol="random"),
    "even-hypotheses": _even_hypotheses,
    "heat-hypotheses": _heat_hypotheses,
    "auc-agree": partial(_auc, score=lambda e: e.agree),
    "auc-built": partial(_auc, score=lambda e: e.score),
    "good-right": partial(_good, right=True),
    "good-wrong": partial(_good, right=False),
    "num-pairs": lambda results: str(len(answers(results))),
    "scored-right": lambda results: str(sum(map(is_right, _scored(results)))),
    "scored-wrong": lambda results: str(sum(not is_right(a) for a in _scored(results))),
    "least-observability": _least_observability,
    "sets-right": partial(_sets, standing="right"),
    "sets-wrong": partial(_sets, standing="wrong"),
    "m-icc-converged-simple": partial(_converged, method="m-icc", simple=True),
    "m-icc-converged-complex": partial(_converged, method="m-icc", simple=False),
    "mm-icc-converged-simple": partial(_converged, method="mm-icc", simple=True),
    "mm-icc-converged-complex": partial(_converged, method="mm-icc", simple=False),
    "table2-below": _below_the_paper,
    "sweep-deg": lambda _: str(SWEEP_DEG),
    "mm-icc-tau": partial(_sweep, method="mm-icc", key="tau"),
    "m-icc-tau": partial(_sweep, method="m-icc", key="tau"),
    "mm-icc-trim": partial(_sweep, method="mm-icc", key="trim"),
    "icp-far-rounds": lambda _: str(schedules(1.0)[0].num_rounds),
    "icp-near-rounds": lambda _: str(schedules(1.0)[1].num_rounds),
    "icp-far-radii": lambda _: _radii(0),
    "icp-near-radii": lambda _: _radii(1),
    **{
        f"{anchors}-right{suffix}": partial(_right_pairs, anchors=anchors, overlap=overlap)
        for anchors in ("heat", "even", "mixed")
        for suffix, overlap in (("", WIDE), ("-thin", THIN))
    },
    **{
        f"{anchors}-seconds": partial(_pair_seconds, anchors=anchors)
        for anchors in ("heat", "even", "mixed")
    },
    **REASONS,
}
"""Name in the template -> what computes its text."""
