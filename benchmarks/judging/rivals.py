"""What other tools say of their own answers, on pairs of the same scans."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.judging.measures import risk_coverage
from benchmarks.judging.table import FIRST_SEED, seeds_of
from benchmarks.judging.trial import CONFIG, Outcome, is_right_pair
from benchmarks.paper.baselines.fpfh import fpfh_ransac
from benchmarks.paper.baselines.kiss import kiss_gicp
from benchmarks.paper.baselines.records import Method, ScanPair
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.success import auc
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import make_scene
from scanweld.geometry.pose import Pose
from scanweld.preparation.prepare import prepare
from scanweld.work.threads import single_threaded_algebra

CODE = (
    *(
        "src/scanweld/geometry/*.py",
        "src/scanweld/preparation/*.py",
        "src/scanweld/evaluation/*.py",
    ),
    *("benchmarks/virtual/*.py", "benchmarks/judging/rivals.py"),
    "benchmarks/paper/baselines/*.py",
)
SEEDS: Mapping[str, int] = {
    "ring of 6": 4,
    **dict.fromkeys(
        (
            *("noise 0.25 %", "outliers 20 %", "dropouts 30 %", "flying pixels"),
            *("resolutions 1:4", "crop at a height", "table", "hand", "2 of a like object"),
            *("mirrored scan", "figure with a mirror plane", "vase", "box", "gear"),
        ),
        1,
    ),
}
"""Runs of each scenario whose pairs are compared."""
QUICK = ("64 pixels across",)
METHODS: Mapping[str, Method] = {"fpfh": fpfh_ransac, "kiss": kiss_gicp}
TITLES = {
    "own": "scanweld: confidence",
    "fpfh": "Open3D, FPFH and RANSAC, ICP: fitness",
    "kiss": "KISS-Matcher, GICP: inliers",
}

Answers = list[tuple[float, bool]]
"""Of every pair that has a pose: what the tool says of it, and whether it is right."""


@dataclass(kw_only=True)
class Rivals:
    """Pairs of the scans of some runs, registered by other tools."""

    NAME: str = "rivals"
    TITLE: str = "Rivals"

    def units(self, quick: bool) -> list[Unit]:
        """Scenario by scenario and seed by seed."""
        if quick:
            return [{"scenario": name, "seed": FIRST_SEED} for name in QUICK]
        return [
            {"scenario": n, "seed": seed} for n, count in SEEDS.items() for seed in seeds_of(count)
        ]

    def measure(self, unit: Unit) -> Result:
        """Score and truth of every pair in the order of the names, by tool; None without a pose."""
        scene = make_scene(SCENARIOS[unit["scenario"]], unit["seed"])
        with single_threaded_algebra():
            prepared = {scan.name: prepare(scan, CONFIG.prepare) for scan in scene.scans}
            told: dict[str, list[Any]] = {name: [] for name in METHODS}
            for i, j in combinations(sorted(prepared), 2):
                pair = ScanPair(i=prepared[i], j=prepared[j], diameter=scene.diameter)
                for name, method in METHODS.items():
                    answer = method(pair, Pose.identity(), 0)
                    if answer.i_from_j is None:
                        told[name].append(None)
                        continue
                    sensors = prepared[i].scan_from_sensor, prepared[j].scan_from_sensor.inverse()
                    found = sensors[0] @ answer.i_from_j @ sensors[1]
                    is_right = not {i, j} & scene.is_open and is_right_pair(i, j, found, scene)
                    told[name].append([answer.score, int(is_right)])
        return told

    def page(self, records: Sequence[Record], out: Path) -> str:
        """Nothing: the page is written by its blocks."""
        return ""


def rival_table(records: Sequence[Record], outcomes: Sequence[Outcome]) -> str:
    """How well what each tool says of its answers tells right from wrong."""
    told = answers_by_tool(records, outcomes)
    rows = []
    for name, answers in told.items():
        scores, is_right = [s for s, _ in answers], [r for _, r in answers]
        rows.append(
            (
                *(TITLES[name], str(len(answers)), str(sum(is_right))),
                f"{auc(scores, is_right):.3f}",
                f"{100 * _sure(scores, is_right):.0f}",
            )
        )
    return markdown_table(
        ("tool, and what it says", "pairs with a pose", "right", "AUC", "sure %"), rows
    )


def answers_by_tool(records: Sequence[Record], outcomes: Sequence[Outcome]) -> dict[str, Answers]:
    """The answers of each tool to the pairs that all were given."""
    runs = {(outcome.scenario, outcome.seed): outcome for outcome in outcomes}
    common = [r for r in records if (r.unit["scenario"], r.unit["seed"]) in runs]
    own = [
        (pair.confidence, pair.is_right)
        for record in common
        for pair in runs[record.unit["scenario"], record.unit["seed"]].pairs
        if pair is not None
    ]
    others = {
        name: [
            (told[0], bool(told[1]))
            for record in common
            for told in record.result[name]
            if told is not None
        ]
        for name in METHODS
    }
    return {"own": own, **others}


def _sure(scores: Sequence[float], is_right: Sequence[bool]) -> float:
    """Share of a tool's right answers of which it is surer than of any wrong one."""
    if not any(is_right):
        return float("nan")
    coverage, risk = risk_coverage(scores, is_right)
    taken = coverage[risk == 0]
    return float(taken.max(initial=0.0)) * len(scores) / int(np.sum(is_right))
