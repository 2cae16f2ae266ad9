"""One run of the main job on a scene, and what it asserts held against the truth.

A scan is *right* if its pose lies within 3 degrees and 1.5 % of the object's diameter of the truth
in the largest component that has scans of its world. It is *falsely good* if it is called good but
is not right, or if nothing that it shows determines its pose. A pair is right if its pose lies
within 5 degrees and 3 %, and is determined.
"""

import time
import traceback
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from itertools import combinations
from typing import Any, Self

import numpy as np

from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Group, Scene, make_scene
from scanweld.config import Config, FusionConfig
from scanweld.errors import ScanweldError
from scanweld.evaluation.metrics import PoseErrors, Standing, evaluate_poses
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet
from scanweld.pairs.result import PairKind
from scanweld.pipeline.run import run
from scanweld.reconstruction import PairReport, Reconstruction, ScanVerdict

CONFIG = Config(fusion=FusionConfig(max_voxels_across=100))
"""The defaults, but for a coarse model: only poses are looked at."""
PAIR_DEG, PAIR_PERCENT = 5.0, 3.0
"""A pair's pose is right within these; the joint refinement comes after it."""
MAX_REASON = 160
"""Characters of a reason that are kept."""
CRASH, ERROR = "crash", "error"


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanOutcome:
    """What became of a scan; by default it is not placed."""

    source: str  # What it was made from, in words
    world: int | None  # Number of its world; None if it belongs nowhere
    is_open: bool  # Whether nothing that it shows determines its pose
    factor: float  # By which it is too large
    verdict: str = str(ScanVerdict.UNPLACED)  # Good, doubtful or unplaced
    standing: str = str(Standing.UNPLACED)  # Right, wrong or unplaced
    is_apart: bool = False  # Whether it lies in another component than most of its world
    # That its pose is right, as the report says; None if it is unplaced
    confidence: float | None = None
    rotation_deg: float | None = None  # Error of its pose; None where there is none
    translation_percent: float | None = None  # The same, in percent of the object's diameter
    reason: str = ""  # What the report says of it, where it is not both good and right

    @property
    def is_right(self) -> bool:
        """Whether it lies where it belongs, with the others."""
        return self.standing == Standing.RIGHT and not self.is_apart

    @property
    def is_good(self) -> bool:
        """Whether it is called good."""
        return self.verdict == ScanVerdict.GOOD

    @property
    def is_placed(self) -> bool:
        """Whether it has a pose."""
        return self.standing != Standing.UNPLACED

    @property
    def is_false(self) -> bool:
        """Whether it is placed although it is wrong, or although its pose is open."""
        return self.standing == Standing.WRONG or (self.is_open and self.is_placed)

    @property
    def is_stranger(self) -> bool:
        """Whether it belongs nowhere."""
        return self.world is None

    @property
    def is_determined(self) -> bool:
        """Whether it belongs, and what it shows determines its pose."""
        return not self.is_stranger and not self.is_open

    def brief(self) -> list[Any]:
        """For JSON."""
        return [float(f"{v:.3g}") if isinstance(v, float) else v for v in astuple(self)]

    @classmethod
    def of(cls, values: list[Any]) -> Self:
        """From ``brief``."""
        return cls(**dict(zip((f.name for f in fields(cls)), values, strict=True)))


@dataclass(frozen=True, slots=True)
class PairOutcome:
    """What became of a pair that has a pose."""

    confidence: float  # That its pose is right, as the report says
    kind: PairKind  # What the two scans alone say
    is_accepted: bool  # Whether the view graph uses it
    is_right: bool  # Whether its pose is right
    is_open: bool  # Whether nothing that the two show determines it

    def brief(self) -> list[Any]:
        """For JSON: thousands of these stand in it."""
        flags = (self.is_accepted, self.is_right, self.is_open)
        return [round(self.confidence, 4), self.kind[0], *map(int, flags)]

    @classmethod
    def of(cls, values: list[Any]) -> Self:
        """From ``brief``."""
        confidence, initial, *flags = values
        kind = next(kind for kind in PairKind if kind.startswith(initial))
        return cls(confidence, kind, *map(bool, flags))


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

    @property
    def group(self) -> Group:
        """What is asked of its scenario."""
        return SCENARIOS[self.scenario].group

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
        scans = tuple(ScanOutcome.of(values) for values in record["scans"])
        pairs = tuple(values and PairOutcome.of(values) for values in record["pairs"])
        return cls(**{**unit, **record, "scans": scans, "pairs": pairs})


def try_out(scenario: str, seed: int) -> Outcome:
    """Make the scans, run the main job on them on one core, and judge what it asserts."""
    scene = make_scene(SCENARIOS[scenario], seed)
    names = sorted(scene.sources)
    scans = tuple(_unplaced(name, scene) for name in names)
    pairs: tuple[PairOutcome | None, ...] = (None,) * (len(names) * (len(names) - 1) // 2)
    verdict = reason = ""
    start = time.process_time()
    try:
        found = run(scene.scans, CONFIG, workers=1)
        verdict, (scans, pairs) = str(found.verdict), judge(found, scene)
    except ScanweldError as error:
        verdict, reason = ERROR, str(error)
    except Exception:
        # A crash is what this benchmark looks for: it is kept, and the other runs go on.
        verdict, reason = CRASH, traceback.format_exc()
    return Outcome(
        scenario=scenario,
        seed=seed,
        verdict=verdict,
        scans=scans,
        pairs=pairs,
        seconds=time.process_time() - start,
        reason=reason,
    )


def judge(
    found: Reconstruction, scene: Scene
) -> tuple[tuple[ScanOutcome, ...], tuple[PairOutcome | None, ...]]:
    """What became of every scan and every pair, in the order of their names."""
    estimate = PoseSet(poses=dict(found.poses), components=found.components)
    errors = evaluate_poses(
        estimate, scene.truth, centroids=scene.centroids, diameter=scene.diameter
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
    return off.angle_deg() <= PAIR_DEG and shift_percent <= PAIR_PERCENT


def _unplaced(name: str, scene: Scene, **found: Any) -> ScanOutcome:
    """What a scan is, and what was found of it."""
    return ScanOutcome(
        source=scene.sources[name],
        world=scene.worlds[name] if name in scene.truth else None,
        is_open=name in scene.is_open,
        factor=scene.factors.get(name, 1.0),
        **found,
    )


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
    # Apart from the component with the most scans of its world.
    world = {n for n in scene.truth if scene.worlds[n] == scene.worlds[name]}
    main = max(found.components, key=lambda c: len(world & set(c)), default=())
    told["is_apart"] = name in found.poses and name not in main
    outcome = _unplaced(name, scene, **told)
    if outcome.is_good and outcome.is_right and not outcome.is_open:
        return outcome
    reason = "; ".join([report.reason, *report.notes])[:MAX_REASON]
    return _unplaced(name, scene, **told, reason=reason)


def _pair_outcome(report: PairReport | None, scene: Scene) -> PairOutcome | None:
    if report is None or report.i_from_j is None:
        return None
    return PairOutcome(
        report.confidence,
        report.kind,
        report.accepted,
        is_right_pair(report.i, report.j, report.i_from_j, scene),
        bool({report.i, report.j} & scene.is_open),
    )
