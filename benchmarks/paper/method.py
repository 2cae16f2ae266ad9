"""docs/method.md: its template, filled with one JSON of numbers that come from all records."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

from benchmarks.paper import basins
from benchmarks.paper.ablations import parts, search
from benchmarks.paper.pages import ablations as told
from benchmarks.paper.pages import features, table1, table2
from benchmarks.paper.pages.basins import answers_from
from benchmarks.paper.settings import COARSE_RIGHT, CONVERGED, SETTINGS, SWEEP, SWEEP_DEG, TUNED
from benchmarks.scores import Stated
from benchmarks.study.pages import percent, rendered
from benchmarks.study.records import Limit, Records, answers, grouped, of, up_to, values_of
from benchmarks.study.study import Record, measured_by, read_records
from scanweld.config import Config
from scanweld.evidence.evidence import Evidence
from scanweld.io.atomic import write_whole
from scanweld.pairs.problem import schedules

TEMPLATE = Path(__file__).with_name("method_template.md")
OTHERS = Path(__file__).parents[2] / "docs/data"

Numbers = dict[str, Any]

WIDE, THIN = (0.10, 1.01), (0.05, 0.10)
"""Overlaps of real pairs."""
FEATURE_GAPS = (30, 50, 70, 90)
MAX_GAP = 90
"""What the paper claims to reach."""
RIGHT, NEAR = Limit(deg=2.0, percent=1.0), Limit(deg=5.0, percent=2.0)
WIDE_GAP, FAR_START = 90, 40
"""Where basins are told of, in degrees."""
KINDS = {"agree": ("agree",), "violated": ("front", "contradict", "free")}


def write_method(study: Path) -> None:
    """Write method.md beside the folder of the study's pages, and its numbers as JSON into it.

    Raises:
        InputError: If a result is missing.
    """
    numbers = method_numbers(study)
    text = json.dumps(numbers, indent=1, ensure_ascii=False) + "\n"
    write_whole(study / "data/method.json", text.encode())
    write_whole(study.parent / "method.md", method_text(numbers).encode())


def method_text(numbers: Numbers) -> str:
    """The page.

    Raises:
        ValueError: If the template names a constant that is not there.
        jinja2.UndefinedError: If it names a number that is not there.
    """
    return rendered(TEMPLATE, numbers)


def method_numbers(study: Path, others: Path = OTHERS) -> Numbers:
    """All numbers of the page that were measured, by the part of the study that measured them.

    Args:
        study: Where the study's pages are, and in ``data`` below their records.
        others: Where the records of the other benchmarks are.

    Raises:
        InputError: If a result is missing.
    """

    def table(name: str) -> Records:
        with measured_by(f"python -m benchmarks.paper --only {name}"):
            return read_records(study, name)

    def other(name: str) -> list[dict[str, Any]]:
        with measured_by("make benchmarks"):
            text = (others / f"{name}.json").read_text(encoding="utf-8")
            return json.loads(text)["records"]

    ablations = table("ablations")
    return {
        "pairs": _pairs(other("pairs")),
        "sets": _sets(other("sets")),
        "search": _search(other("keypoints")),
        "features": _features(table("features")),
        "table1": _table1(table("table1")),
        "table2": _table2(table("table2")),
        "basins": _basins(table("basins")),
        "contours": _contours(of(ablations, part="contours")),
        "terms": _terms(of(ablations, part="terms")),
        "heat": _heat(of(ablations, part="heat")),
        "coarse": _coarse(of(ablations, part="coarse")),
        "scores": _scores(of(ablations, part="search")),
    }


def _pairs(records: Sequence[Mapping[str, Any]]) -> Numbers:
    """Pairs of real scans: by the kind of anchors, and what the evidence says of first answers."""
    by_anchors = {
        kind: [a for a in records if a["anchors"] == kind] for kind in ("heat", "even", "mixed")
    }
    told = [a for a in by_anchors["mixed"] if a["score"] is not None]
    evidence = [Evidence(**a["evidence"]) for a in told]
    is_right = [a["rank"] == 1 for a in told]
    scored = [a for a in told if a["score"] >= Config().pairs.min_score]
    scored_right = [a for a in scored if a["rank"] == 1]
    good = [a["rank"] == 1 for a in told if a["kind"] == "good"]

    def auc(scores: Iterable[float]) -> float:
        return Stated.of(zip(scores, is_right, strict=True)).auc

    free_of_right = [e.free for e, right in zip(evidence, is_right, strict=True) if right]
    return {
        **{kind: _anchors(answers) for kind, answers in by_anchors.items()},
        "num": len(told),
        "free_of_right": percent(float(np.quantile(free_of_right, 0.9))),
        "auc_agree": f"{auc(e.agree for e in evidence):.3f}",
        "auc_built": f"{auc(e.score for e in evidence):.3f}",
        "good_right": sum(good),
        "good_wrong": len(good) - sum(good),
        "scored_right": len(scored_right),
        "scored_wrong": len(scored) - len(scored_right),
        "least_observability": f"{min(a['observability'] for a in scored_right):.1e}",
    }


def _anchors(records: Sequence[Mapping[str, Any]]) -> Numbers:
    def right(overlap: tuple[float, float]) -> str:
        inside = [a["rank"] == 1 for a in records if overlap[0] <= a["overlap"] < overlap[1]]
        return f"{sum(inside)} of {len(inside)}"

    seconds = mean(a["seconds"] for a in records if a["score"] is not None)
    return {"right": right(WIDE), "thin": right(THIN), "seconds": f"{seconds:.2f}"}


def _sets(records: Sequence[Mapping[str, Any]]) -> Numbers:
    total = sum(len(run["scans"]) for run in records)
    return {
        "right": f"{sum(run['right'] for run in records)} of {total}",
        "wrong": sum(run["wrong"] for run in records),
    }


def _search(keypoints: Sequence[Mapping[str, Any]]) -> Numbers:
    """How many hypotheses, and the rounds and radii of the ICP that follows."""
    config = Config().pairs
    num_keypoints = mean(record["keypoints"] for record in keypoints)
    far, near = (
        {"rounds": s.num_rounds, "radii": f"{s.first_radius:g} to {s.last_radius:g}"}
        for s in schedules(1.0)[:2]
    )
    return {
        "even": f"{config.num_anchors**2 * config.num_turns:,}",
        "heat": f"{num_keypoints**2 * config.num_turns:,.0f}",
        "far": far,
        "near": near,
    }


def _features(records: Records) -> Numbers:
    """Shares by gap, right and by chance, of repeated keypoints and of nearest descriptors."""

    def shares(group: str, question: str, place: int) -> str:
        by_gap = [of(records, gap=gap) for gap in FEATURE_GAPS]
        counts = [features.pooled(pairs, group, question, "PA-HKS") for pairs in by_gap]
        *first, last = (percent(of_gap[place] / of_gap[1]) for of_gap in counts)
        return f"{', '.join(first)} and {last}"

    return {
        "repeated": shares("detectors", "repeated", 0),
        "repeated_chance": shares("detectors", "repeated", 2),
        "nearest": shares("own", "nearest", 0),
        "nearest_chance": shares("own", "nearest", 2),
    }


def _table1(records: Records) -> Numbers:
    """Right noise-free answers, gaps as the paper has them, and what eq. 1 matches."""
    clean = up_to(of(records, noise=0.0), MAX_GAP)
    from_identity, from_random = (of(clean, protocol=p) for p in ("identity", "random"))
    matched = [r for r in records if "matches" in r.result]
    number = {k: mean(r.result["matches"][k] for r in matched) for k in ("matched", "keypoints")}
    return {
        "coarse": NEAR.count(answers(from_identity, "paper-coarse")),
        "paper": RIGHT.count(answers(from_identity, "paper")),
        "m_icc": RIGHT.count(answers(from_identity, "m-icc")),
        "default": RIGHT.count(answers(from_identity, "default")),
        "default_random": RIGHT.count(answers(from_random, "default")),
        "matched": f"{number['matched']:.0f} of {number['keypoints']:.0f}",
        "matched_right": table1.share_of_matches(matched, "right"),
        "matched_chance": table1.share_of_matches(matched, "by_chance"),
    }


def _table2(records: Records) -> Numbers:
    """Runs that converge, by the kind of views and in the sweep, and whose RMS beats the paper."""
    final, sweep = of(records, part="final", noise=0.0), of(records, part="sweep")
    by_default = of(final, method="default")
    below = [table2.rms_mm(r) < SETTINGS[r.unit["setting"]].printed[1] for r in by_default]
    return {
        "converged": {
            method: {
                kind: _converged([r for r in of(final, method=method) if _kind(r) == kind])
                for kind in ("simple", "complex")
            }
            for method in SWEEP
        },
        "below": f"{sum(below)} of {len(below)}",
        "sweep_deg": SWEEP_DEG,
        "sweep": {
            method: {key: _swept(of(sweep, method=method), key) for key in TUNED[method]}
            for method in SWEEP
        },
    }


def _kind(record: Record) -> str:
    return SETTINGS[record.unit["setting"]].kind


def _converged(records: Records) -> str:
    """From the given starts: the coarse pose is not one that every setting has."""
    runs = [run for run in table2.runs(records) if run["start"] != "coarse"]
    return f"{table2.count(runs)} of {len(runs)}"


def _swept(records: Records, key: str) -> str:
    """Converged runs of the sweep by one part of the tuning, the others as in use."""
    [method] = values_of(records, "method")
    fixed = {k: value for k, value in TUNED[method].items() if k != key}
    tried = sorted(values_of(of(records, **fixed), key), key=lambda v: (v is None, v or 0.0))
    return ", ".join(
        f"{_converged(of(records, **fixed, **{key: value}))} with "
        + ("one found anew" if value is None else f"{value:g}")
        for value in tried
    )


def _basins(records: Records) -> Numbers:
    """Right answers from far off at the widest gap."""
    far = of(records, gap=WIDE_GAP)
    methods = (*basins.FROM_A_START, basins.JOINT)
    right = {m: CONVERGED.count(answers_from(far, FAR_START, m)) for m in methods}
    return {"gap": WIDE_GAP, "start": FAR_START, **right}


def _contours(records: Records) -> Numbers:
    """Runs of the variants that come right, their median error, and how far contours lie apart."""
    far = of(records, gap=WIDE_GAP)
    return {
        "right": {n: CONVERGED.count(told.contour_errors(records, n)) for n in parts.CONTOURS},
        "error": {name: _median_error(records, name) for name in parts.CONTOURS},
        "apart": {name: told.apart(far, name)[-1] for name in parts.PRUNED},
    }


def _median_error(records: Records, variant: str) -> str:
    right = CONVERGED.among(told.contour_errors(records, variant))
    if not right:
        return "-"
    deg, shift = (np.median([error[key] for error in right]) for key in ("deg", "percent"))
    return f"{deg:.2f} deg and {shift:.2f} %"


def _terms(records: Records) -> Numbers:
    """Median rotation error by gap with some of the terms of the joint refinement."""
    by_gap = {gap: told.term_middles(pairs) for gap, pairs in grouped(records, "gap").items()}
    names = (parts.ALONE, *parts.TERMS)
    return {
        "gaps": " / ".join(by_gap),
        "start": f"{parts.TERMS_START_DEG:g}",
        **{name: " / ".join(f"{m[name]:.2f}" for m in by_gap.values()) for name in names},
    }


def _heat(records: Records) -> Numbers:
    return {
        what: {name: told.heat_cell(records, name, what) for name in parts.HEAT}
        for what in ("repeated", "matched")
    }


def _coarse(records: Records) -> Numbers:
    return {n: COARSE_RIGHT.count([r.result[n] for r in records]) for n in parts.COARSE}


def _scores(records: Records) -> Numbers:
    """Pairs whose right pose comes first by a score, and the evidence of the poses kept."""
    kept = [pose for record in records for pose in record.result["mixed"]]

    def share(kinds: Sequence[str], is_right: bool) -> str:
        of_kind = [p for p in kept if search.RIGHT.holds(p) is is_right]
        return percent(float(np.median([sum(p[kind] for kind in kinds) for p in of_kind])))

    def first(name: str) -> str:
        firsts, value = search.rescored(records, name)
        return f"{sum(firsts)} of {len(firsts)} (AUC {value:.3f})"

    return {
        "first": {name: first(name) for name in search.WEIGHTS},
        "right": {name: share(kinds, True) for name, kinds in KINDS.items()},
        "wrong": {name: share(kinds, False) for name, kinds in KINDS.items()},
    }
