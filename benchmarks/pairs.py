"""Register pairs of real scans alone, each from any start pose, and see what can be trusted.

    python -m benchmarks.pairs --seeds 1 --out pairs.json --plot pairs.png
    python -m benchmarks.pairs --keypoints heat even mixed
    python -m benchmarks.pairs --quick

All 45 pairs of the bunny and all of the dragon up to 96 degrees apart. Every scan is first moved by
a random rotation and shift, and its grid turned by a random number of quarter turns. The first
answer of a pair is right if it lies within 3 degrees and 1.5 percent of the object's diameter of
the reference, at the centroid of the scan that is moved; it is near within 10 degrees and 5
percent. Overlaps are those of the data's overlaps.csv.
"""

import argparse
import csv
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blocks import judged, markdown_table
from benchmarks.results import write_results
from benchmarks.scores import Stated
from benchmarks.sets import BUNNY, data_folder, dragon, moved_scans
from benchmarks.virtual.bodies import make_body
from benchmarks.virtual.shots import SLIGHT, ring, shot_overlaps, take_shots
from scanweld.config import Config, PairsConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.evaluation.metrics import (
    MAX_ROTATION_DEG,
    MAX_TRANSLATION_PERCENT,
    object_diameter,
)
from scanweld.evidence.field import make_field
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.heat.features import describe
from scanweld.io import read_poses, read_scan
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pipeline.robust import pair_registrar
from scanweld.preparation.prepare import prepare
from scanweld.work.threads import map_in_order, single_threaded_algebra

OBJECTS = {
    "bunny": ("stanford-bunny", BUNNY, 360.0),
    "dragon": ("stanford-dragon", dragon(24), 97.0),
}
"""Object -> folder, scans, largest rotation between the scans of a pair in degrees."""
KEYPOINTS = ("mixed", "heat", "even")
NEAR_ROTATION_DEG, NEAR_TRANSLATION_PERCENT = 10.0, 5.0
FLOORS = {(0.15, 1.01): 0.95, (0.10, 0.15): 0.80, (0.05, 0.10): None, (0.0, 0.05): None}
"""Share of first answers that must be right, by overlap."""
MIN_AUC = 0.97


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What was made of one pair."""

    anchors: str  # What the hypotheses hung on: "mixed", "heat" or "even"
    object: str
    seed: int
    i: str
    j: str
    overlap: float
    gap_deg: float
    kind: str
    rotation_deg: float | None  # Error of the first answer; None where there is no answer
    translation_percent: float | None  # The same, in percent of the object's diameter
    score: float | None  # Of the first answer
    evidence: dict[str, float]  # Shares of samples behind that score
    margin: float
    observability: float
    rank: int | None  # Place of the first right answer, from 1; None if none is right
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether the first answer is right."""
        return self.rank == 1

    @property
    def is_near(self) -> bool:
        """Whether the first answer is at least in the right basin."""
        if self.rotation_deg is None or self.translation_percent is None:
            return False
        is_turned_so = self.rotation_deg <= NEAR_ROTATION_DEG
        return is_turned_so and self.translation_percent <= NEAR_TRANSLATION_PERCENT


@dataclass(frozen=True, kw_only=True)
class Scans:
    """Scans of an object, their true poses, and the pairs that are asked for."""

    name: str
    scans: list[RangeScan]
    world_from_scan: Mapping[str, Pose]
    pairs: Mapping[tuple[str, str], tuple[float, float]]  # Overlap, and rotation in degrees


def main() -> int:
    """Register all pairs; 0 if the floors are met, else 1."""
    options = _options()
    if options.quick:
        objects = [made_scans()]
    else:
        objects = [real_scans(name, data_folder(options.data)) for name in options.objects]
    answers: list[Answer] = []
    for anchors in options.keypoints:
        for scans in objects:
            for seed in range(options.seeds):
                answers += answers_of(scans, seed, anchors, options.workers)
    if options.out:
        write_results(options.out, [asdict(answer) for answer in answers])
    if options.plot:
        plot([a for a in answers if a.anchors == options.keypoints[-1]], options.plot)
    print(table(answers), end="")
    return 0 if options.quick or are_floors_met(answers) else 1


def real_scans(name: str, data: Path) -> Scans:
    """Of an object of the data."""
    folder, names, max_gap_deg = OBJECTS[name]
    with (data / folder / "overlaps.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    pairs = {
        (row["i"], row["j"]): (min(float(row["overlap_ij"]), float(row["overlap_ji"])), gap)
        for row in rows
        if (gap := float(row["rotation_deg"])) <= max_gap_deg
    }
    scans = [read_scan(data / folder / f"{name}.ply") for name in names]
    poses = read_poses(data / folder / "poses.json").poses
    return Scans(name=name, scans=scans, world_from_scan=poses, pairs=pairs)


def made_scans() -> Scans:
    """Three of a made object, without the data."""
    body = make_body("thing", 0)
    views = ring(body, np.random.default_rng(0), count=3, step_deg=40.0, pixels=(120.0,))
    shots = take_shots(body, views, SLIGHT, 0)
    overlaps = shot_overlaps(shots)
    pairs = {
        (f"{i}", f"{j}"): (float(overlaps[i, j]), 40.0 * (j - i))
        for i, j in combinations(range(len(shots)), 2)
    }
    poses = {shot.scan.name: shot.pose for shot in shots}
    return Scans(
        name="made", scans=[shot.scan for shot in shots], world_from_scan=poses, pairs=pairs
    )


def answers_of(scans: Scans, seed: int, anchors: str, workers: int) -> list[Answer]:
    """Register all pairs of an object, its scans moved as the seed says."""
    found: list[Answer] = []
    with single_threaded_algebra():
        moved, truth = moved_scans(
            scans.scans, scans.world_from_scan, seed, any_rotation=True, turn_grids=True
        )
        prepared, register = _registrar(moved, anchors, workers)
        diameter = object_diameter(moved, truth)

        def answer(edge: tuple[str, str]) -> Answer:
            at = [k for k, scan in enumerate(prepared) if scan.name in edge]
            i, j = (prepared[k] for k in at)
            start = time.perf_counter()
            result = register((at[0], at[1]))
            seconds = time.perf_counter() - start
            true = truth[i.name].inverse() @ truth[j.name]
            errors = [_error(i, j, each.i_from_j, true, diameter) for each in result.alternatives]
            overlap, gap_deg = scans.pairs[edge]
            how = {"anchors": anchors, "object": scans.name, "seed": seed, "seconds": seconds}
            pair = {"i": i.name, "j": j.name, "overlap": overlap, "gap_deg": gap_deg}
            return Answer(**how, **pair, **_told(result, errors))

        for each in map_in_order(answer, list(scans.pairs), workers):
            found.append(each)
            told = f"{anchors}, {scans.name} seed {seed}: {len(found)}/{len(scans.pairs)}"
            print(f"\r{told}", end="", file=sys.stderr)
    print(file=sys.stderr)
    return found


def _error(
    i: PreparedScan, j: PreparedScan, i_from_j: Pose, true: Pose, diameter: float
) -> tuple[float, float]:
    """Rotation in degrees, and translation at j's centroid in percent of the diameter."""
    off = true.inverse() @ i.scan_from_sensor @ i_from_j @ j.scan_from_sensor.inverse()
    return off.angle_deg(), 100.0 * off.shift_at(j.scan.points.mean(axis=0)) / diameter


def _told(result: PairResult, errors: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """What a pair's result says, and the errors of its answers."""
    limits = MAX_ROTATION_DEG, MAX_TRANSLATION_PERCENT
    right = [k for k, (r, t) in enumerate(errors, 1) if r <= limits[0] and t <= limits[1]]
    rotation, translation = errors[0] if errors else (None, None)
    return {
        "kind": str(result.kind),
        "rotation_deg": rotation,
        "translation_percent": translation,
        "score": result.best.score if result.best else None,
        "evidence": asdict(result.best.evidence) if result.best else {},
        "margin": result.margin,
        "observability": result.observability,
        "rank": right[0] if right else None,
    }


def _registrar(
    scans: Sequence[RangeScan], anchors: str, workers: int
) -> tuple[list[PreparedScan], Callable[[tuple[int, int]], PairResult]]:
    """Prepare scans as a run does; the method's own way to register two of them, by index."""
    config = Config(pairs=PairsConfig.model_validate({"keypoints": anchors}))
    prepared = list(map_in_order(lambda scan: prepare(scan, config.prepare), scans, workers))
    fields = list(map_in_order(make_field, prepared, workers))
    features = [None] * len(prepared)
    if anchors != "even":
        features = list(map_in_order(lambda scan: describe(scan, config.heat), prepared, workers))
    contours = contour_matcher(prepared, config.contours)
    return prepared, pair_registrar(prepared, features, fields, contours, config).register


def table(answers: Sequence[Answer]) -> str:
    """Markdown by anchors and overlap."""
    headings = (
        *("anchors", "overlap", "pairs", "right first", "floor", "near first", "right among kept"),
        *("accepted", "accepted wrong", "rotation median (deg)", "translation median (%)"),
        "seconds a pair",
    )
    rows = []
    for (anchors, (low, high)), inside in _binned(answers).items():
        right = [answer for answer in inside if answer.is_right]
        accepted = [answer for answer in inside if answer.kind == PairKind.GOOD]
        floor = FLOORS[low, high]
        rows.append(
            (
                *(anchors, f"{low:.2f}-{min(high, 1.0):.2f}", len(inside)),
                judged(f"{len(right) / len(inside):.1%}", _is_met(inside, floor)),
                "-" if floor is None else f"{floor:.0%}",
                f"{np.mean([answer.is_near for answer in inside]):.1%}",
                f"{np.mean([answer.rank is not None for answer in inside]):.1%}",
                *(len(accepted), sum(not answer.is_right for answer in accepted)),
                _median([answer.rotation_deg for answer in right]),
                _median([answer.translation_percent for answer in right]),
                f"{np.mean([answer.seconds for answer in inside]):.2f}",
            )
        )
    told = ", ".join(f"{anchors} {value:.4f}" for anchors, value in aucs(answers).items())
    sentence = f"AUC of the score, right against wrong first answers: {told} (floor {MIN_AUC})."
    return f"{markdown_table(headings, rows)}\n{sentence}\n"


def are_floors_met(answers: Sequence[Answer]) -> bool:
    """Whether enough is right at every overlap, and told from wrong by its score."""
    bins = _binned(answers).items()
    are_right = all(_is_met(inside, FLOORS[overlap]) for (_, overlap), inside in bins)
    return are_right and all(value >= MIN_AUC for value in aucs(answers).values())


def aucs(answers: Sequence[Answer]) -> dict[str, float]:
    """By anchors: chance that a right first answer scores higher than a wrong one."""
    return {
        anchors: Stated.of(
            (a.score, a.is_right) for a in answers if a.anchors == anchors and a.score is not None
        ).auc
        for anchors in dict.fromkeys(answer.anchors for answer in answers)
    }


def _binned(
    answers: Sequence[Answer],
) -> dict[tuple[str, tuple[float, float]], list[Answer]]:
    """Answers by anchors and overlap, as far as there are some."""
    kinds = dict.fromkeys(answer.anchors for answer in answers)
    bins = {
        (kind, (low, high)): [a for a in answers if a.anchors == kind and low <= a.overlap < high]
        for kind in kinds
        for low, high in FLOORS
    }
    return {key: inside for key, inside in bins.items() if inside}


def _is_met(inside: Sequence[Answer], floor: float | None) -> bool:
    return floor is None or float(np.mean([answer.is_right for answer in inside])) >= floor


def _median(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.2f}" if known else "-"


def plot(answers: Sequence[Answer], path: Path) -> None:
    """Score against overlap, right and wrong, and the share of right answers by overlap."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.2))
    given = [answer for answer in answers if answer.score is not None]
    for is_right, color, label in ((False, "#c0392b", "wrong"), (True, "#2471a3", "right")):
        chosen = [answer for answer in given if answer.is_right is is_right]
        xy = np.array([(answer.overlap, answer.score) for answer in chosen]).reshape(-1, 2)
        left.scatter(xy[:, 0], xy[:, 1], s=18, c=color, label=f"{label} ({len(chosen)})", alpha=0.7)
    left.axhline(Config().pairs.min_score, color="grey", lw=0.8, ls="--")
    left.set(xlabel="overlap", ylabel="score of the first answer")
    left.legend(loc="lower right")
    edges = (0, 0.05, 0.10, 0.15, 0.2, 0.3, 0.4, 0.6, 1)
    bin_of = np.digitize([answer.overlap for answer in answers], edges[1:-1])
    counts = np.bincount(bin_of, minlength=len(edges) - 1)
    num_right = np.bincount(bin_of, weights=[a.is_right for a in answers], minlength=len(counts))
    places = np.arange(len(counts))
    bars = right.bar(places, num_right / np.maximum(counts, 1), color="#2471a3")
    right.bar_label(bars, [str(count) for count in counts], fontsize=9)
    right.set_xticks(places, [f"{a:g}\n–{b:g}" for a, b in pairwise(edges)])
    right.set(xlabel="overlap (above the bars: pairs)", ylabel="right as first answer")
    right.set_ylim(0, 1.1)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Register pairs of real scans from any start.")
    add = parser.add_argument
    add("--objects", nargs="+", choices=list(OBJECTS), default=list(OBJECTS))
    add("--quick", action="store_true", help="a few pairs of a made object")
    add("--seeds", type=int, default=1, help="number of random frames of each scan")
    add("--workers", type=int, default=2)
    add("--keypoints", nargs="+", choices=KEYPOINTS, default=["mixed"])
    add("--data", type=Path, help="folder of the Stanford data")
    add("--out", type=Path, help="JSON file of all answers")
    add("--plot", type=Path, help="PNG file, of the last kind of keypoints")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
