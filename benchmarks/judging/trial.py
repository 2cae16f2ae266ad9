"""One run of the main job on a scene, and what it asserts held against the truth.

A scan is *right* if its pose lies within 3 degrees and 1.5 % of the object's diameter of the truth
in the largest component that has scans of its world. It is *falsely good* if it is called good but
is not right, or if nothing that it shows determines its pose. A pair is right if its pose lies
within 5 degrees and 3 %, and is determined.
"""

import time
import traceback
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields, replace
from itertools import combinations
from typing import Any, Self

import numpy as np

from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Scene, make_scene
from scanweld.config import Config, FusionConfig
from scanweld.errors import ScanweldError
from scanweld.evaluation.metrics import PoseErrors, Standing, evaluate_poses
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet
from scanweld.pairs.result import PairKind
from scanweld.pipeline.run import run
from scanweld.reconstruction import PairReport, Reconstruction, ScanReport, ScanVerdict

CONFIG = Config(fusion=FusionConfig(max_voxels_across=100))
"""The defaults, but for a coarse model: only poses are looked at."""
PAIR_DEG, PAIR_PERCENT = 5.0, 3.0
"""A pair's pose is right within these; the joint refinement comes after it."""
MAX_REASON = 160
"""Characters of a reason that are kept."""
CRASH, ERROR = "crash", "error"


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanOutcome:
    """What became of a scan.

    Attributes:
        source: What it was made from, in words.
        world: Number of its world; None if it belongs nowhere.
        is_open: Whether nothing that it shows determines its pose.
        factor: By which it is too large.
        verdict: Good, doubtful or unplaced.
        standing: Right, wrong or unplaced.
        is_apart: Whether it lies in another component than most of its world.
        confidence: That its pose is right, as the report says; None if it is unplaced.
        rotation_deg: Error of its pose; None where there is none.
        translation_percent: The same, in percent of the object's diameter.
        reason: What the report says of it, where it is not both good and right.
    """

    source: str
    world: int | None
    is_open: bool
    factor: float
    verdict: str
    standing: str
    is_apart: bool
    confidence: float | None
    rotation_deg: float | None
    translation_percent: float | None
    reason: str

    @property
    def is_right(self) -> bool:
        """Whether it lies where it belongs, with the others."""
        return self.standing == Standing.RIGHT and not self.is_apart

    @property
    def is_good(self) -> bool:
        """Whether it is called good."""
        return self.verdict == ScanVerdict.GOOD

    @property
    def is_false(self) -> bool:
        """Whether it is placed although it is wrong, or although its pose is open."""
        is_placed = self.standing != Standing.UNPLACED
        return self.standing == Standing.WRONG or (self.is_open and is_placed)

    def brief(self) -> list[Any]:
        """For JSON."""
        return [float(f"{v:.3g}") if isinstance(v, float) else v for v in astuple(self)]

    @classmethod
    def of(cls, values: list[Any]) -> Self:
        """From ``brief``."""
        return cls(**dict(zip((f.name for f in fields(cls)), values, strict=True)))


@dataclass(frozen=True, kw_only=True, slots=True)
class PairOutcome:
    """What became of a pair that has a pose.

    Attributes:
        confidence: That its pose is right, as the report says.
        kind: What the two scans alone say.
        is_accepted: Whether the view graph uses it.
        is_right: Whether its pose is right.
        is_open: Whether nothing that the two show determines it.
    """

    confidence: float
    kind: str
    is_accepted: bool
    is_right: bool
    is_open: bool

    def brief(self) -> list[Any]:
        """For JSON: thousands of these stand in it."""
        flags = (self.is_accepted, self.is_right, self.is_open)
        return [round(self.confidence, 4), self.kind[0], *map(int, flags)]

    @classmethod
    def of(cls, values: list[Any]) -> Self:
        """From ``brief``."""
        confidence, initial, *flags = values
        kind = next(kind for kind in PairKind if kind.startswith(initial))
        accepted, right, is_open = map(bool, flags)
        return cls(
            confidence=confidence,
            kind=str(kind),
            is_accepted=accepted,
            is_right=right,
            is_open=is_open,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """A run: its verdict in a word, its scans, its pairs in order (None: no pose), CPU seconds."""

    scenario: str
    seed: int
    verdict: str
    scans: tuple[ScanOutcome, ...]
    pairs: tuple[PairOutcome | None, ...]
    seconds: float
    reason: str = ""

    def record(self) -> dict[str, Any]:
        """For JSON, without the scenario and the seed."""
        return {
            "verdict": self.verdict,
            "seconds": self.seconds,
            "reason": self.reason,
            "scans": [scan.brief() for scan in self.scans],
            "pairs": [pair and pair.brief() for pair in self.pairs],
        }

    @classmethod
    def of(cls, unit: Mapping[str, Any], record: Mapping[str, Any]) -> Self:
        """From a record."""
        return cls(
            scenario=unit["scenario"],
            seed=unit["seed"],
            verdict=record["verdict"],
            seconds=record["seconds"],
            reason=record["reason"],
            scans=tuple(ScanOutcome.of(values) for values in record["scans"]),
            pairs=tuple(values and PairOutcome.of(values) for values in record["pairs"]),
        )


def try_out(scenario: str, seed: int) -> Outcome:
    """Make the scans, run the main job on them on one core, and judge what it asserts."""
    scene = make_scene(SCENARIOS[scenario], seed)
    start = time.process_time()
    try:
        found = run(scene.scans, CONFIG, workers=1)
    except ScanweldError as error:
        return _failure(scenario, seed, ERROR, str(error), scene, start)
    except Exception:
        # A crash is what this benchmark looks for: it is kept, and the other runs go on.
        return _failure(scenario, seed, CRASH, traceback.format_exc(), scene, start)
    scans, pairs = judge(found, scene)
    return Outcome(
        scenario=scenario,
        seed=seed,
        verdict=str(found.verdict),
        scans=scans,
        pairs=pairs,
        seconds=time.process_time() - start,
    )


def judge(
    found: Reconstruction, scene: Scene
) -> tuple[tuple[ScanOutcome, ...], tuple[PairOutcome | None, ...]]:
    """What became of every scan and every pair, in the order of their names."""
    estimate = PoseSet(poses=dict(found.poses), components=found.components)
    truth = nearest_truth(estimate, scene)
    errors = evaluate_poses(estimate, truth, centroids=scene.centroids, diameter=scene.diameter)
    names = sorted(scene.sources)
    reports = {(pair.i, pair.j): pair for pair in found.pairs}
    return (
        tuple(_scan_outcome(name, found, errors, scene) for name in names),
        tuple(_pair_outcome(reports.get(edge), scene) for edge in combinations(names, 2)),
    )


def nearest_truth(estimate: PoseSet, scene: Scene) -> dict[str, Pose]:
    """The true poses; of a symmetric object, the equivalent ones that are nearest the estimate.

    Each component is first moved so that its first scan is right.
    """
    truth = dict(scene.truth)
    if not scene.symmetry:
        return truth
    for component in estimate.components:
        first = component[0]
        world_from_component = truth[first] @ estimate.poses[first].inverse()
        for name in component:
            placed = world_from_component @ estimate.poses[name]
            options = [scene.truth[name], *(g @ scene.truth[name] for g in scene.symmetry)]
            centre = scene.centroids[name]
            turned = [np.linalg.norm(o.rotation - placed.rotation) for o in options]
            shifts = [np.linalg.norm(o.apply(centre) - placed.apply(centre)) for o in options]
            apart = np.array(turned) + np.array(shifts) / scene.diameter
            truth[name] = options[int(np.argmin(apart))]
    return truth


def _scan_outcome(
    name: str, found: Reconstruction, errors: PoseErrors, scene: Scene
) -> ScanOutcome:
    report, error = found.scans[name], errors.scans.get(name)
    is_known = error is not None and np.isfinite(error.rotation_deg)
    outcome = ScanOutcome(
        source=scene.sources[name],
        world=scene.worlds[name] if name in scene.truth else None,
        is_open=name in scene.is_open,
        factor=scene.factors.get(name, 1.0),
        verdict=str(report.verdict),
        standing=str(error.standing if error else Standing.UNPLACED),
        is_apart=_is_apart(name, found, scene),
        confidence=report.confidence,
        rotation_deg=error.rotation_deg if error and is_known else None,
        translation_percent=100 * error.translation / scene.diameter
        if error and is_known
        else None,
        reason=_reason(report),
    )
    is_fine = outcome.is_good and outcome.is_right and not outcome.is_open
    return replace(outcome, reason="") if is_fine else outcome


def _reason(report: ScanReport) -> str:
    return "; ".join([report.reason, *report.notes])[:MAX_REASON]


def _is_apart(name: str, found: Reconstruction, scene: Scene) -> bool:
    """Whether a placed scan lies in another component than the largest with scans of its world."""
    world = {n for n in scene.truth if scene.worlds[n] == scene.worlds[name]}
    main = max(found.components, key=lambda c: len(world & set(c)), default=())
    return name in found.poses and name not in main


def _pair_outcome(report: PairReport | None, scene: Scene) -> PairOutcome | None:
    if report is None or report.i_from_j is None:
        return None
    i, j = report.i, report.j
    is_open = i in scene.is_open or j in scene.is_open
    return PairOutcome(
        confidence=report.confidence,
        kind=str(report.kind),
        is_accepted=report.accepted,
        is_right=not is_open and is_right_pair(i, j, report.i_from_j, scene),
        is_open=is_open,
    )


def is_right_pair(i: str, j: str, i_from_j: Pose, scene: Scene) -> bool:
    """Whether the pose of a pair, between the scans' frames, is the true one."""
    if not {i, j} <= set(scene.truth) or scene.worlds[i] != scene.worlds[j]:
        return False
    off = (scene.truth[i].inverse() @ scene.truth[j]).inverse() @ i_from_j
    shift_percent = 100.0 * off.shift_at(scene.centroids[j]) / scene.diameter
    return off.angle_deg() <= PAIR_DEG and shift_percent <= PAIR_PERCENT


def _failure(
    scenario: str, seed: int, verdict: str, reason: str, scene: Scene, start: float
) -> Outcome:
    """A run that gave nothing: none of its scans is placed."""
    scans = tuple(
        ScanOutcome(
            source=scene.sources[name],
            world=scene.worlds[name] if name in scene.truth else None,
            is_open=name in scene.is_open,
            factor=scene.factors.get(name, 1.0),
            verdict=str(ScanVerdict.UNPLACED),
            standing=str(Standing.UNPLACED),
            is_apart=False,
            confidence=None,
            rotation_deg=None,
            translation_percent=None,
            reason="",
        )
        for name in sorted(scene.sources)
    )
    return Outcome(
        scenario=scenario,
        seed=seed,
        verdict=verdict,
        scans=scans,
        pairs=(None,) * (len(scans) * (len(scans) - 1) // 2),
        seconds=time.process_time() - start,
        reason=reason,
    )
