"""What other tools say of their own answers, on pairs of the same scans."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from benchmarks.judging.outcomes import Outcome, stated_pairs
from benchmarks.judging.trial import CONFIG, QUICK, is_right_pair, seeded
from benchmarks.kept import Record, Result, Unit
from benchmarks.paper.baselines.fpfh import fpfh_ransac
from benchmarks.paper.baselines.kiss import kiss_gicp
from benchmarks.paper.baselines.records import Method, ScanPair
from benchmarks.scores import Stated
from benchmarks.seeds import FIRST_FRESH
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import make_scene
from scanweld.geometry.pose import Pose
from scanweld.preparation.prepare import prepare

ONCE = (
    *("noise 0.25 %", "outliers 20 %", "dropouts 30 %", "flying pixels", "resolutions 1:4"),
    *("crop at a height", "table", "hand", "2 of a like object", "mirrored scan"),
    *("figure with a mirror plane", "vase", "box", "gear"),
)
COUNTS = {"ring of 6": 4, **dict.fromkeys(ONCE, 1)}
"""Runs of each scenario whose pairs are compared."""
METHODS: Mapping[str, Method] = {"fpfh": fpfh_ransac, "kiss": kiss_gicp}
TITLES = {
    "own": "scanweld: confidence",
    "fpfh": "Open3D, FPFH and RANSAC, ICP: fitness",
    "kiss": "KISS-Matcher, GICP: inliers",
}


@dataclass(kw_only=True)
class OtherTools:
    """Pairs of the scans of some runs, registered by other tools."""

    first_seed: int = FIRST_FRESH
    NAME: str = "rivals"

    def units(self, quick: bool) -> list[Unit]:
        """Scenario by scenario and seed by seed."""
        return seeded(QUICK if quick else COUNTS, self.first_seed)

    def measure(self, unit: Unit) -> Result:
        """Score and truth of every pair in the order of the names, by tool; None without a pose."""
        scene = make_scene(SCENARIOS[unit["scenario"]], unit["seed"])
        prepared = {scan.name: prepare(scan, CONFIG.prepare) for scan in scene.scans}
        told: dict[str, list[Any]] = {name: [] for name in METHODS}
        for i, j in combinations(sorted(prepared), 2):
            pair = ScanPair(i=prepared[i], j=prepared[j], diameter=scene.diameter)
            from_sensors = prepared[i].scan_from_sensor, prepared[j].scan_from_sensor.inverse()
            for name, method in METHODS.items():
                answer = method(pair, Pose.identity(), 0)
                if answer.i_from_j is None:
                    told[name].append(None)
                    continue
                found = from_sensors[0] @ answer.i_from_j @ from_sensors[1]
                told[name].append([answer.score, int(is_right_pair(i, j, found, scene))])
        return told


def answers_by_tool(records: Sequence[Record], outcomes: Sequence[Outcome]) -> dict[str, Stated]:
    """The answers of each tool to the pairs that all were given."""
    runs = {(outcome.scenario, outcome.seed): outcome for outcome in outcomes}
    keys = [(record.unit["scenario"], record.unit["seed"]) for record in records]
    common = [record for record, key in zip(records, keys, strict=True) if key in runs]
    others = {
        name: Stated.of(told for record in common for told in record.result[name] if told)
        for name in METHODS
    }
    return {"own": stated_pairs(runs[key] for key in keys if key in runs), **others}
