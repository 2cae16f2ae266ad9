"""One run of the main job on a scene, and what it asserts held against the truth."""

import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from benchmarks.judging.outcomes import CRASH, ERROR, Outcome, PairOutcome, ScanOutcome
from benchmarks.kept import Result, Unit
from benchmarks.seeds import FIRST_FRESH
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Scene, make_scene
from scanweld.config import Config, FusionConfig
from scanweld.errors import ScanweldError
from scanweld.evaluation.metrics import PoseErrors, evaluate_poses
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet
from scanweld.pipeline.run import run
from scanweld.reconstruction import PairReport, Reconstruction

CONFIG = Config(fusion=FusionConfig(max_voxels_across=100))
"""The defaults, but for a coarse model: only poses are looked at."""
CUT = "cut: "
"""How the note begins that says what was cut off a scan."""
PAIR_DEG, PAIR_PERCENT = 5.0, 3.0
"""A pair's pose is right within these; the joint refinement comes after it."""
MAX_REASON = 160
"""Characters of a reason that are kept."""
QUICK: Mapping[str, int] = {"64 pixels across": 1}
"""Runs that show whether all works."""


@dataclass(kw_only=True)
class Runs:
    """Runs of scenarios by seeds, as units that are kept when done."""

    scenarios: Sequence[str] = tuple(SCENARIOS)  # Names
    seeds: int = 10**6  # How many of each, at most
    first_seed: int = FIRST_FRESH  # The first seed of each
    times: int = 1  # As many runs as the scenarios ask for
    NAME: str = "trust"

    def units(self, quick: bool) -> list[Unit]:
        """Scenario by scenario and seed by seed; one of a few if quick."""
        counts = {n: min(self.seeds, self.times * SCENARIOS[n].seeds) for n in self.scenarios}
        return seeded(QUICK if quick else counts, self.first_seed)

    def measure(self, unit: Unit) -> Result:
        """One run, on one core."""
        return try_out(unit["scenario"], unit["seed"]).record()


def seeded(counts: Mapping[str, int], first_seed: int) -> list[Unit]:
    """Units of so many runs of each scenario."""
    return [
        {"scenario": name, "seed": first_seed + k} for name, n in counts.items() for k in range(n)
    ]


def try_out(scenario: str, seed: int) -> Outcome:
    """Make the scans, run the main job on them on one core, and judge what it asserts."""
    scene = make_scene(SCENARIOS[scenario], seed)
    names = sorted(scene.sources)
    scans = tuple(_scan(name, scene) for name in names)
    pairs: tuple[PairOutcome | None, ...] = (None,) * (len(names) * (len(names) - 1) // 2)
    reason, start = "", time.process_time()
    try:
        found = run(scene.scans, CONFIG, workers=1)
        verdict, (scans, pairs) = str(found.verdict), judge(found, scene)
        cut = {n for scan in found.scans.values() for n in scan.notes if n.startswith(CUT)}
        reason = "; ".join([*found.reasons, *sorted(cut)[:1]])
    except ScanweldError as error:
        verdict, reason = ERROR, str(error)
    except Exception:
        # A crash is what this benchmark looks for: it is kept, and the other runs go on.
        verdict, reason = CRASH, traceback.format_exc()
    told = {"scenario": scenario, "seed": seed, "verdict": verdict, "reason": reason}
    return Outcome(**told, scans=scans, pairs=pairs, seconds=time.process_time() - start)


def judge(
    found: Reconstruction, scene: Scene
) -> tuple[tuple[ScanOutcome, ...], tuple[PairOutcome | None, ...]]:
    """What became of every scan and every pair, in the order of their names."""
    estimate = PoseSet(poses=dict(found.poses), components=found.components)
    errors = evaluate_poses(
        estimate,
        scene.truth,
        centroids=scene.centroids,
        diameter=scene.diameter,
        limits=scene.limits,
    )
    names = sorted(scene.sources)
    reports = {(pair.i, pair.j): pair for pair in found.pairs}
    return (
        tuple(_scan_outcome(name, found, errors, scene) for name in names),
        tuple(_pair_outcome(reports.get(edge), scene) for edge in combinations(names, 2)),
    )


def is_right_pair(i: str, j: str, i_from_j: Pose, scene: Scene) -> bool:
    """Whether a pose between the frames of two scans is true, and what they show determines it."""
    is_one_world = {i, j} <= set(scene.truth) and scene.worlds[i] == scene.worlds[j]
    if not is_one_world or {i, j} & scene.is_open:
        return False
    off = (scene.truth[i].inverse() @ scene.truth[j]).inverse() @ i_from_j
    shift_percent = 100.0 * off.shift_at(scene.centroids[j]) / scene.diameter
    max_deg, max_percent = np.maximum(scene.limits, (PAIR_DEG, PAIR_PERCENT))
    return bool(off.angle_deg() <= max_deg and shift_percent <= max_percent)


def _scan(name: str, scene: Scene, **found: Any) -> ScanOutcome:
    """What a scan is, and what was found of it."""
    world = scene.worlds[name] if name in scene.truth else None
    is_open, factor = name in scene.is_open, scene.factors.get(name, 1.0)
    return ScanOutcome(scene.sources[name], world, is_open, factor, **found)


def _scan_outcome(
    name: str, found: Reconstruction, errors: PoseErrors, scene: Scene
) -> ScanOutcome:
    report, error = found.scans[name], errors.scans.get(name)
    told: dict[str, Any] = {"verdict": str(report.verdict), "confidence": report.confidence}
    if error is not None:
        told["standing"] = str(error.standing)
        if np.isfinite(error.rotation_deg):
            told["rotation_deg"] = error.rotation_deg
            told["translation_percent"] = 100 * error.translation / scene.diameter
    if report.translation_bound is not None:
        told["rotation_bound_deg"] = report.rotation_bound_deg
        told["translation_bound_percent"] = 100 * report.translation_bound / scene.diameter
    # Apart from the component with the most scans of its world.
    world = {n for n in scene.truth if scene.worlds[n] == scene.worlds[name]}
    main = max(found.components, key=lambda c: len(world & set(c)), default=())
    told["is_apart"] = name in found.poses and name not in main
    outcome = _scan(name, scene, **told)
    if outcome.is_good and outcome.is_right and not outcome.is_open:
        return outcome
    return outcome._replace(reason="; ".join([report.reason, *report.notes])[:MAX_REASON])


def _pair_outcome(report: PairReport | None, scene: Scene) -> PairOutcome | None:
    if report is None or report.i_from_j is None:
        return None
    is_right = is_right_pair(report.i, report.j, report.i_from_j, scene)
    is_open = bool({report.i, report.j} & scene.is_open)
    return PairOutcome(report.confidence, report.kind, report.accepted, is_right, is_open)
