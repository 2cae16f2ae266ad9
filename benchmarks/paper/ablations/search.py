"""Keypoints against evenly spread points, and what each term of the evidence is worth."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np

from benchmarks.paper.baselines.own import searched
from benchmarks.paper.baselines.records import ScanPair
from benchmarks.paper.views import VirtualPair, data_file, overlaps_of, pose_error
from benchmarks.scores import Stated
from benchmarks.study.records import Limit
from benchmarks.study.study import Record, Result, Unit
from scanweld.config import Config, PairsConfig, PrepareConfig
from scanweld.evaluation.metrics import (
    MAX_ROTATION_DEG,
    MAX_TRANSLATION_PERCENT,
    object_diameter,
)
from scanweld.evidence.evidence import CONTRADICT_WEIGHT, FREE_WEIGHT, VIOLATION_WEIGHT
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import describe
from scanweld.io import read_poses, read_scan
from scanweld.preparation import prepare

REAL = ("stanford-bunny", "stanford-dragon")
THIN_OVERLAPS = (0.03, 0.25)
MIN_ANCHORS = 8
RIGHT = Limit(deg=MAX_ROTATION_DEG, percent=MAX_TRANSLATION_PERCENT)

ANCHORS = {
    "PA-HKS keypoints alone": "heat",
    "as many evenly spread points": "even",
    "the default: both, evenly spread ones by number": "mixed",
}
Evidence = Mapping[str, float]
SHARES = ("agree", "front", "contradict", "free")
WEIGHTS = {
    "as it stands": (VIOLATION_WEIGHT, CONTRADICT_WEIGHT, FREE_WEIGHT),
    "violations weighted like agreement": (1.0, 0.5, FREE_WEIGHT),
    "without what lies in front": (0.0, CONTRADICT_WEIGHT, FREE_WEIGHT),
    "without contradicting normals": (VIOLATION_WEIGHT, 0.0, FREE_WEIGHT),
    "without free space": (VIOLATION_WEIGHT, CONTRADICT_WEIGHT, 0.0),
    "agreement alone": (0.0, 0.0, 0.0),
}
"""Scores by the weights of what lies in front, contradicts, and lies in free space."""


def score(name: str) -> Callable[[Evidence], float]:
    """The score of this name as a function of the evidence."""
    front, contradict, free = WEIGHTS[name]
    return lambda e: (
        e["agree"] - (front * e["front"] + contradict * e["contradict"]) - free * e["free"]
    )


def thin_real_pairs() -> list[Unit]:
    """The pairs of real scans that overlap little.

    Raises:
        InputError: If the scans are missing.
    """
    return [
        {"object": folder, **{key: row[key] for key in ("i", "j", "overlap")}}
        for folder in REAL
        for row in overlaps_of(folder)
        if THIN_OVERLAPS[0] <= row["overlap"] < THIN_OVERLAPS[1]
    ]


def measure(pair: VirtualPair, unit: Unit) -> Result:
    """The first answer with each set of anchors; with the default's, all poses that are kept."""
    return _measured(pair.scans, pair.true, pair.i.diameter)


def measure_real(unit: Unit) -> Result:
    """The same of two real scans in the frames of their files: the search does not look at them."""
    folder = unit["object"]
    poses = read_poses(data_file(f"{folder}/poses.json")).poses
    i, j = (_prepared(folder, unit[key]) for key in ("i", "j"))
    world_from_i = poses[unit["i"]] @ i.scan_from_sensor
    world_from_j = poses[unit["j"]] @ j.scan_from_sensor
    pair = ScanPair(i=i, j=j, diameter=(i.diameter + j.diameter) / 2)
    return _measured(pair, world_from_i.inverse() @ world_from_j, _object_diameter(folder))


def _measured(pair: ScanPair, true: Pose, diameter: float) -> Result:
    keypoints = sum(len(describe(scan, Config().heat)) for scan in (pair.i, pair.j))
    number = max(MIN_ANCHORS, round(keypoints / 2))
    anchors = {
        "heat": PairsConfig(keypoints="heat"),
        # As many evenly spread points as there are keypoints, where they stand in for them.
        "even": PairsConfig(keypoints="even", num_anchors=number),
        "mixed": PairsConfig(keypoints="mixed"),
    }
    kept = {kind: _kept(pair, true, diameter, config) for kind, config in anchors.items()}
    return {
        "anchors": number,
        **{kind: poses if kind == "mixed" else poses[:1] for kind, poses in kept.items()},
    }


def _kept(
    pair: ScanPair, true: Pose, diameter: float, config: PairsConfig
) -> list[dict[str, float | None]]:
    """Errors and evidence of the alternatives, best first."""
    centre = pair.j.samples.points.mean(axis=0)
    return [
        pose_error(true, found.i_from_j, centre, diameter)
        | {share: getattr(found.evidence, share) for share in SHARES}
        for found in searched(pair, Config(pairs=config)).alternatives
    ]


@lru_cache(maxsize=32)
def _prepared(folder: str, name: str) -> PreparedScan:
    return prepare(read_scan(data_file(f"{folder}/{name}.ply")), PrepareConfig())


@lru_cache
def _object_diameter(folder: str) -> float:
    poses = read_poses(data_file(f"{folder}/poses.json")).poses
    scans = [read_scan(data_file(f"{folder}/{name}.ply")) for name in sorted(poses)]
    return object_diameter(scans, poses)


def rescored(records: Sequence[Record], name: str) -> tuple[list[bool], float]:
    """Whether the best pose of each pair by a score is right, and its AUC over all poses kept."""
    firsts, scores, is_right = [], [], []
    for record in records:
        kept = record.result["mixed"]
        values = [score(name)(each) for each in kept]
        right = [RIGHT.holds(each) for each in kept]
        firsts.append(bool(kept) and right[int(np.argmax(values))])
        scores += values
        is_right += right
    return firsts, Stated.of(zip(scores, is_right, strict=True)).auc
