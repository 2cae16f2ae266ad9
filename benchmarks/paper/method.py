"""docs/method.md: its template, and what that asks of the records of all benchmarks."""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

from benchmarks.paper import settings
from benchmarks.paper.ablations import search
from benchmarks.paper.pages import ablations, basins, features, table1, table2
from benchmarks.paper.settings import CONVERGED, SETTINGS, TUNED
from benchmarks.scores import Stated
from benchmarks.study.pages import rendered
from benchmarks.study.records import Records, grouped, of, values_of
from benchmarks.study.study import Record, measured_by, read_records
from scanweld.config import Config
from scanweld.evidence.evidence import Evidence
from scanweld.io.atomic import write_whole
from scanweld.pairs.problem import schedules

TEMPLATE = Path(__file__).with_name("method_template.md")
OTHERS = Path(__file__).parents[2] / "docs/data"

Found = Mapping[str, Any]
"""What the other benchmarks say of a pair of real scans."""

WIDE, THIN = (0.10, 1.01), (0.05, 0.10)
"""Overlaps of real pairs."""
FEATURE_GAPS = (30, 50, 70, 90)
MAX_GAP = 90
"""What the paper claims to reach."""
WIDE_GAP, FAR_START = 90, 40
"""Where basins are told of, in degrees."""
AGREE, VIOLATED = ("agree",), ("front", "contradict", "free")
RIGHT, BY_CHANCE = 0, 2
"""Places in the counts of features."""
FAR_ICP, NEAR_ICP, *_ = schedules(1.0)


def write_method(folder: Path) -> None:
    """Write method.md beside the folder of the study's pages."""
    write_whole(folder.parent / "method.md", method_text(folder).encode())


def method_text(folder: Path, others: Path = OTHERS) -> str:
    """The page, of the study in a folder and the records of the other benchmarks in another."""
    names = vars(settings) | vars(basins) | vars(table1) | vars(ablations) | globals()
    records = {"study": partial(study, folder), "other": partial(other, others)}
    return rendered(TEMPLATE, names | records)


def study(folder: Path, name: str) -> Records:
    """The records of a table of the study."""
    with measured_by(f"python -m benchmarks.paper --only {name}"):
        return read_records(folder, name)


def other(folder: Path, name: str) -> list[Found]:
    """The records of another benchmark."""
    with measured_by("make benchmarks"):
        return json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))["records"]


def right_pairs(pairs: Sequence[Found], anchors: str, overlap: tuple[float, float]) -> str:
    """First answers that are right, of the real pairs of some overlap."""
    low, high = overlap
    chosen = [a for a in pairs if a["anchors"] == anchors and low <= a["overlap"] < high]
    return f"{num_right(chosen)} of {len(chosen)}"


def mean_seconds(pairs: Sequence[Found], anchors: str) -> str:
    """A pair, where there is any answer."""
    told = (a for a in pairs if a["anchors"] == anchors and a["score"] is not None)
    return f"{mean(a['seconds'] for a in told):.2f}"


def first_answers(pairs: Sequence[Found]) -> list[Found]:
    """What the default says first of each pair."""
    return [a for a in pairs if a["anchors"] == "mixed" and a["score"] is not None]


def num_right(answers: Iterable[Found]) -> int:
    """How many first answers are right."""
    return sum(answer["rank"] == 1 for answer in answers)


def free_of_right(answers: Sequence[Found]) -> float:
    """What free space is violated by nine of ten right answers at most."""
    return float(np.quantile([a["evidence"]["free"] for a in answers if a["rank"] == 1], 0.9))


def auc(answers: Sequence[Found], what: str) -> str:
    """How well a number of the evidence tells right from wrong."""
    told = ((getattr(Evidence(**a["evidence"]), what), a["rank"] == 1) for a in answers)
    return f"{Stated.of(told).auc:.3f}"


def num_hypotheses(num_anchors: float) -> str:
    """Hypotheses of a pair by the number of anchors of each scan."""
    return f"{num_anchors**2 * Config().pairs.num_turns:,.0f}"


def feature_shares(records: Records, group: str, question: str, place: int) -> str:
    """Shares at the gaps, of repeated keypoints or of nearest descriptors."""
    by_gap = [of(records, gap=gap) for gap in FEATURE_GAPS]
    counts = [features.pooled(pairs, group, question, "PA-HKS") for pairs in by_gap]
    *first, last = (f"{100 * of_gap[place] / of_gap[1]:.0f} %" for of_gap in counts)
    return f"{', '.join(first)} and {last}"


def converged(records: Records, kind: str | None = None) -> str:
    """Runs that converge from the given starts: not every setting has the coarse pose."""
    chosen = [r for r in records if kind in (None, SETTINGS[r.unit["setting"]].kind)]
    runs = [run for run in table2.runs(chosen) if run["start"] != "coarse"]
    return f"{table2.count(runs)} of {len(runs)}"


def below_the_paper(records: Records) -> str:
    """Settings whose RMS beats the paper's."""

    def is_below(record: Record) -> bool:
        return table2.rms_mm(record) < SETTINGS[record.unit["setting"]].printed[1]

    return f"{sum(map(is_below, records))} of {len(records)}"


def swept(records: Records, method: str, key: str) -> str:
    """Converged runs of the sweep by one part of the tuning, the others as in use."""
    fixed = {k: value for k, value in TUNED[method].items() if k != key}
    chosen = of(of(records, part="sweep", method=method), **fixed)
    tried = sorted(values_of(chosen, key), key=lambda value: (value is None, value or 0.0))
    return ", ".join(
        f"{converged(of(chosen, **{key: value}))} with "
        + ("one found anew" if value is None else f"{value:g}")
        for value in tried
    )


def middle_error(records: Records, variant: str) -> str:
    """Median error of the right runs of a variant of MM-ICC."""
    right = CONVERGED.among(ablations.contour_errors(records, variant))
    deg, shift = (np.median([error[key] for error in right]) for key in ("deg", "percent"))
    return f"{deg:.2f} deg and {shift:.2f} %"


def term_errors_by_gap(records: Records, terms: str) -> str:
    """Median rotation errors with some of the terms of the joint refinement."""
    middles = [ablations.term_middles(pairs)[terms] for pairs in grouped(records, "gap").values()]
    return " / ".join(f"{middle:.2f}" for middle in middles)


def middle_share(records: Records, kinds: Sequence[str], is_right: bool) -> float:
    """Median share of evidence of some kinds, over the right or the wrong poses kept."""
    kept = [pose for record in records for pose in record.result["mixed"]]
    chosen = [pose for pose in kept if search.RIGHT.holds(pose) is is_right]
    return float(np.median([sum(pose[kind] for kind in kinds) for pose in chosen]))


def scored_anew(records: Records, score: str) -> str:
    """Pairs whose right pose comes first by a score."""
    firsts, value = search.rescored(records, score)
    return f"{sum(firsts)} of {len(firsts)} (AUC {value:.3f})"
