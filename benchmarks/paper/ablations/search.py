"""Keypoints against evenly spread points, and what each term of the evidence is worth."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, Literal

import numpy as np

from benchmarks.paper.methods import ScanPair
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.success import Limit, auc
from benchmarks.paper.views import data_folder, mesh_of, pose_error, virtual_scan
from scanweld.config import Config, PairsConfig, PrepareConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.errors import InputError
from scanweld.evaluation.metrics import (
    MAX_ROTATION_DEG,
    MAX_TRANSLATION_PERCENT,
    object_diameter,
)
from scanweld.evidence.evidence import CONTRADICT_WEIGHT, FREE_WEIGHT, VIOLATION_WEIGHT
from scanweld.evidence.field import make_field
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import describe
from scanweld.io import read_poses, read_scan
from scanweld.pairs.result import PairResult
from scanweld.pipeline.robust import pair_registrar
from scanweld.preparation import prepare

OBJECTS = ("armadillo", "bunny")
GAPS = (90, 100, 110, 120)
AZIMUTHS = tuple(range(0, 360, 45))
REAL = ("stanford-bunny", "stanford-dragon")
THIN_OVERLAPS = (0.03, 0.25)
MIN_ANCHORS = 8
RIGHT = Limit(deg=MAX_ROTATION_DEG, percent=MAX_TRANSLATION_PERCENT)

ANCHORS: dict[str, str] = {
    "heat": "PA-HKS keypoints alone",
    "even": "as many evenly spread points",
    "mixed": "the default: both, evenly spread ones by number",
}
Evidence = dict[str, float]
SCORES: dict[str, Callable[[Evidence], float]] = {
    "as it stands": lambda e: _score(e, VIOLATION_WEIGHT, CONTRADICT_WEIGHT, FREE_WEIGHT),
    "violations weighted like agreement": lambda e: _score(e, 1.0, 0.5, FREE_WEIGHT),
    "without what lies in front": lambda e: _score(e, 0.0, CONTRADICT_WEIGHT, FREE_WEIGHT),
    "without contradicting normals": lambda e: _score(e, VIOLATION_WEIGHT, 0.0, FREE_WEIGHT),
    "without free space": lambda e: _score(e, VIOLATION_WEIGHT, CONTRADICT_WEIGHT, 0.0),
    "agreement alone": lambda e: _score(e, 0.0, 0.0, 0.0),
}


def _score(evidence: Evidence, front: float, contradict: float, free: float) -> float:
    violated = front * evidence["front"] + contradict * evidence["contradict"]
    return evidence["agree"] - violated - free * evidence["free"]


def units(quick: bool) -> list[Unit]:
    """Virtual pairs far apart, and the thin ones among the real pairs.

    Raises:
        InputError: If a mesh or the real scans are missing.
    """
    if quick:
        return [{"object": "creature", "gap": 90, "azimuth": 0}]
    for name in OBJECTS:
        mesh_of(name)
    virtual = [
        {"object": name, "gap": gap, "azimuth": azimuth}
        for name, gap, azimuth in product(OBJECTS, GAPS, AZIMUTHS)
    ]
    return [*virtual, *(unit for folder in REAL for unit in _thin_pairs(folder))]


def _thin_pairs(folder: str) -> list[Unit]:
    path = data_folder() / folder / "overlaps.csv"
    if not path.exists():
        raise InputError(
            f"{path}: is missing; put the scans there, set SCANWELD_DATA to the folder of the "
            "data, or take --quick, which needs none"
        )
    with path.open(encoding="utf-8") as file:
        rows = [
            {"object": folder, "i": row["i"], "j": row["j"], "overlap": _overlap(row)}
            for row in csv.DictReader(file)
        ]
    return [row for row in rows if THIN_OVERLAPS[0] <= row["overlap"] < THIN_OVERLAPS[1]]


def _overlap(row: dict[str, str]) -> float:
    return min(float(row["overlap_ij"]), float(row["overlap_ji"]))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Scene:
    """A pair, its true i_from_j, and the diameter of the object."""

    pair: ScanPair
    true: Pose
    diameter: float


def measure(unit: Unit) -> Result:
    """The first answer with each set of anchors; with the default's, all poses that are kept."""
    scene = _real_scene(unit) if "i" in unit else _virtual_scene(unit)
    scans, config = (scene.pair.i, scene.pair.j), Config()
    features = [describe(scan, config.heat) for scan in scans]
    fields = [make_field(scan) for scan in scans]
    matcher = contour_matcher(scans, config.contours)
    number = max(MIN_ANCHORS, round(sum(map(len, features)) / 2))
    answers: dict[str, list[dict[str, Any]]] = {}
    for kind in ("heat", "even", "mixed"):
        pairs = _anchored(kind, number)
        settings = config.model_copy(update={"pairs": pairs})
        registrar = pair_registrar(scans, features, fields, matcher, settings)
        answers[kind] = _kept(scene, registrar.register((0, 1)))
    return {
        "anchors": number,
        "heat": answers["heat"][:1],
        "even": answers["even"][:1],
        "mixed": answers["mixed"],
    }


def _anchored(kind: Literal["heat", "even", "mixed"], number: int) -> PairsConfig:
    """As many evenly spread points as there are keypoints, where they stand in for them."""
    if kind == "even":
        return PairsConfig(keypoints="even", num_anchors=number)
    return PairsConfig(keypoints=kind)


def _kept(scene: _Scene, result: PairResult) -> list[dict[str, Any]]:
    """Errors and evidence of the alternatives, best first."""
    centre, told = scene.pair.j.samples.points.mean(axis=0), []
    for alternative in result.alternatives:
        deg, shift = pose_error(scene.true, alternative.i_from_j, centre, scene.diameter)
        evidence = alternative.evidence
        shares = {key: getattr(evidence, key) for key in ("agree", "front", "contradict", "free")}
        told.append({"deg": deg, "percent": shift, **shares})
    return told


def _virtual_scene(unit: Unit) -> _Scene:
    azimuth = float(unit["azimuth"])
    i, j = (virtual_scan(unit["object"], a) for a in (azimuth, azimuth + unit["gap"]))
    diameter = (i.scan.diameter + j.scan.diameter) / 2
    pair = ScanPair(i=i.scan, j=j.scan, diameter=diameter)
    return _Scene(pair=pair, true=i.from_other(j), diameter=i.diameter)


def _real_scene(unit: Unit) -> _Scene:
    """Two real scans in the frames of their files: the search does not look at frames."""
    folder = unit["object"]
    i, j = _prepared(folder, unit["i"]), _prepared(folder, unit["j"])
    poses = read_poses(data_folder() / folder / "poses.json").poses
    world_from_i = poses[unit["i"]] @ i.scan_from_sensor
    world_from_j = poses[unit["j"]] @ j.scan_from_sensor
    return _Scene(
        pair=ScanPair(i=i, j=j, diameter=(i.diameter + j.diameter) / 2),
        true=world_from_i.inverse() @ world_from_j,
        diameter=_object_diameter(folder),
    )


@lru_cache(maxsize=32)
def _prepared(folder: str, name: str) -> PreparedScan:
    return prepare(read_scan(data_folder() / folder / f"{name}.ply"), PrepareConfig())


@lru_cache
def _object_diameter(folder: str) -> float:
    poses = read_poses(data_folder() / folder / "poses.json").poses
    return object_diameter(
        [read_scan(data_folder() / folder / f"{name}.ply") for name in sorted(poses)], poses
    )


def page(records: Sequence[Record]) -> str:
    """Keypoints against even points, then the terms of the evidence."""
    return f"{_anchors_section(records)}\n{_evidence_section(records)}"


def _groups(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Virtual pairs by gap, real ones by object."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        gap = record.unit.get("gap")
        title = f"{record.unit['object'].removeprefix('stanford-')} scans" if gap is None else ""
        groups.setdefault(title or f"{gap}° apart", []).append(record)
    return {**groups, "all": list(records)}


def _first_right(records: Sequence[Record], kind: str) -> list[bool]:
    answers = [record.result[kind] for record in records]
    return [bool(kept) and RIGHT.holds(kept[0]) for kept in answers]


def _anchors_section(records: Sequence[Record]) -> str:
    groups = _groups(records)
    rows = [
        [title, *(_share(_first_right(group, kind)) for group in groups.values())]
        for kind, title in ANCHORS.items()
    ]
    right = {kind: _share(_first_right(records, kind)) for kind in ANCHORS}
    number = np.mean([record.result["anchors"] for record in records])
    return (
        "## Keypoints against evenly spread points\n\n"
        f"**Of all pairs, PA-HKS keypoints alone get {right['heat']} right, as many evenly spread "
        f"points {right['even']}, the default, which takes both, {right['mixed']}.**\n\n"
        f"First answers from any start, right {RIGHT}; on average {number:.0f} keypoints a scan. "
        f"Virtual views by gap; real pairs of overlap {THIN_OVERLAPS[0]:g} to "
        f"{THIN_OVERLAPS[1]:g}.\n\n" + markdown_table(["anchors", *groups], rows)
    )


def _evidence_section(records: Sequence[Record]) -> str:
    groups = _groups(records)
    rows = [
        [
            name,
            *(_share(rescored(group, score)[0]) for group in groups.values()),
            f"{rescored(records, score)[1]:.3f}",
        ]
        for name, score in SCORES.items()
    ]
    full, bare = (rescored(records, SCORES[name]) for name in ("as it stands", "agreement alone"))
    return (
        "## Terms of the evidence\n\n"
        f"**Agreement alone puts the right pose first in {_share(bare[0])} of the pairs (AUC "
        f"{bare[1]:.3f}), the score as it stands in {_share(full[0])} (AUC {full[1]:.3f}).**\n\n"
        "The poses that the default keeps of each pair, scored anew with a term left out: right "
        "pose first, and the AUC of the score, right against wrong over all poses kept. The "
        "search itself has used the full score, so that this understates what the terms do.\n\n"
        + markdown_table(["score", *groups, "AUC"], rows)
    )


def rescored(
    records: Sequence[Record], score: Callable[[Evidence], float]
) -> tuple[list[bool], float]:
    """Whether the best pose of each pair is right, and the AUC over all poses kept."""
    firsts, scores, is_right = [], [], []
    for record in records:
        kept = record.result["mixed"]
        values = [score(each) for each in kept]
        right = [RIGHT.holds(each) for each in kept]
        firsts.append(bool(kept) and right[int(np.argmax(values))])
        scores += values
        is_right += right
    return firsts, auc(scores, is_right)


def _share(is_right: Sequence[bool]) -> str:
    return f"{sum(is_right)}/{len(is_right)}"
