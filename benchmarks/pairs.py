"""Register pairs of real scans alone, each from any start pose, and see what can be trusted.

    python benchmarks/pairs.py --seeds 1 --out pairs.json --plot pairs.png
    python benchmarks/pairs.py --keypoints heat even mixed

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
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.stats import rankdata

from results import write_results
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
from scanweld.heat.features import describe
from scanweld.io import read_poses, read_scan
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pipeline.robust import pair_registrar
from scanweld.preparation.prepare import prepare
from scanweld.work.threads import map_in_order, single_threaded_algebra
from sets import BUNNY, data_folder, dragon, moved_scans

Keypoints = Literal["mixed", "heat", "even"]

OBJECTS = {
    "bunny": ("stanford-bunny", BUNNY, 360.0),
    "dragon": ("stanford-dragon", dragon(24), 97.0),
}
"""Object -> folder, scans, largest rotation between the scans of a pair in degrees."""
NEAR_ROTATION_DEG = 10.0
NEAR_TRANSLATION_PERCENT = 5.0
BINS = ((0.15, 1.01), (0.10, 0.15), (0.05, 0.10), (0.0, 0.05))
FLOORS = {(0.15, 1.01): 0.95, (0.10, 0.15): 0.80}
"""Share of first answers that must be right, by overlap."""
MIN_AUC = 0.97


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What was made of one pair.

    Attributes:
        anchors: What the hypotheses hung on: "mixed", "heat" or "even".
        rotation_deg: Error of the first answer; None where there is no answer.
        translation_percent: The same, in percent of the object's diameter.
        score: Of the first answer.
        evidence: Shares of samples behind that score.
        rank: Place of the first right answer, from 1; None if none is right.
    """

    anchors: str
    object: str
    seed: int
    i: str
    j: str
    overlap: float
    gap_deg: float
    kind: str
    rotation_deg: float | None
    translation_percent: float | None
    score: float | None
    evidence: dict[str, float]
    margin: float
    observability: float
    rank: int | None
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether the first answer is right."""
        return self.rank == 1

    @property
    def is_near(self) -> bool:
        """Whether the first answer is at least in the right basin."""
        return (
            self.rotation_deg is not None
            and self.translation_percent is not None
            and self.rotation_deg <= NEAR_ROTATION_DEG
            and self.translation_percent <= NEAR_TRANSLATION_PERCENT
        )


def main() -> int:
    """Register all pairs; 0 if the floors are met, else 1."""
    options = _options()
    answers: list[Answer] = []
    for anchors in options.keypoints:
        for name in options.objects:
            for seed in range(options.seeds):
                answers += answers_of(name, seed, anchors, options)
    if options.out:
        write_results(options.out, [asdict(answer) for answer in answers])
    if options.plot:
        plot(
            [answer for answer in answers if answer.anchors == options.keypoints[-1]], options.plot
        )
    lines, is_passed = table(answers)
    print("\n".join(lines))
    return 0 if is_passed else 1


@dataclass(frozen=True, kw_only=True)
class _Scene:
    """The scans of an object, moved and laid out, with their reference poses."""

    prepared: dict[str, PreparedScan]
    register: Callable[[tuple[int, int]], PairResult]
    reference: dict[str, Pose]
    object_diameter: float

    def errors(self, i: str, j: str, alternative: Alternative) -> tuple[float, float]:
        """Rotation in degrees, and translation at j's centroid in percent of the diameter."""
        scan_i, scan_j = self.prepared[i], self.prepared[j]
        found = scan_i.scan_from_sensor @ alternative.i_from_j @ scan_j.scan_from_sensor.inverse()
        off = (self.reference[i].inverse() @ self.reference[j]).inverse() @ found
        shift = off.shift_at(scan_j.scan.points.mean(axis=0))
        return off.angle_deg(), 100.0 * shift / self.object_diameter


def answers_of(
    name: str, seed: int, anchors: Keypoints, options: argparse.Namespace
) -> list[Answer]:
    """Register all pairs of an object, its scans moved as the seed says."""
    folder, names, max_gap_deg = OBJECTS[name]
    data = data_folder(options.data) / folder
    config = Config(pairs=PairsConfig(keypoints=anchors))
    with single_threaded_algebra():
        scene = _lay_out(data, names, seed, config, options.workers)
        rows = [
            row
            for row in csv.DictReader((data / "overlaps.csv").open(encoding="utf-8"))
            if float(row["rotation_deg"]) <= max_gap_deg
        ]
        answer = lambda row: _answer(anchors, name, seed, row, scene)  # noqa: E731
        found: list[Answer] = []
        for each in map_in_order(answer, rows, options.workers):
            found.append(each)
            told = f"{anchors}, {name} seed {seed}: {len(found)}/{len(rows)}"
            print(f"\r{told}", end="", file=sys.stderr)
        print(file=sys.stderr)
    return found


def _lay_out(data: Path, names: tuple[str, ...], seed: int, config: Config, workers: int) -> _Scene:
    scans = [read_scan(data / f"{name}.ply") for name in names]
    moved, reference = moved_scans(
        scans, read_poses(data / "poses.json").poses, seed, any_rotation=True, turn_grids=True
    )
    prepared = list(map_in_order(lambda scan: prepare(scan, config.prepare), moved, workers))
    diameter = float(np.median([scan.diameter for scan in prepared]))
    fields = list(map_in_order(lambda scan: make_field(scan, diameter), prepared, workers))
    features = [None] * len(prepared)
    if config.pairs.keypoints != "even":
        features = list(map_in_order(lambda scan: describe(scan, config.heat), prepared, workers))
    contours = contour_matcher(prepared, config.contours)
    return _Scene(
        prepared=dict(zip(names, prepared, strict=True)),
        register=pair_registrar(prepared, features, fields, contours, diameter, config),
        reference=reference,
        object_diameter=object_diameter(moved, reference),
    )


def _answer(
    anchors: Keypoints, name: str, seed: int, row: Mapping[str, str], scene: _Scene
) -> Answer:
    names = list(scene.prepared)
    first, second = sorted((names.index(row["i"]), names.index(row["j"])))
    i, j = names[first], names[second]
    start = time.perf_counter()
    result = scene.register((first, second))
    seconds = time.perf_counter() - start
    errors = [scene.errors(i, j, alternative) for alternative in result.alternatives]
    right = [
        k
        for k, (rotation, translation) in enumerate(errors, start=1)
        if rotation <= MAX_ROTATION_DEG and translation <= MAX_TRANSLATION_PERCENT
    ]
    rotation, translation = errors[0] if errors else (None, None)
    return Answer(
        anchors=anchors,
        object=name,
        seed=seed,
        i=i,
        j=j,
        overlap=min(float(row["overlap_ij"]), float(row["overlap_ji"])),
        gap_deg=float(row["rotation_deg"]),
        kind=str(result.kind),
        rotation_deg=rotation,
        translation_percent=translation,
        score=result.best.score if result.best else None,
        evidence=asdict(result.best.evidence) if result.best else {},
        margin=result.margin,
        observability=result.observability,
        rank=right[0] if right else None,
        seconds=seconds,
    )


def table(answers: list[Answer]) -> tuple[list[str], bool]:
    """Markdown lines by anchors and overlap, and whether the floors are met."""
    lines = [
        "| anchors | overlap | pairs | right first | floor | near first | right among kept "
        "| accepted | accepted wrong | rotation median (deg) | translation median (%) "
        "| seconds a pair |",
        "|" + "---|" * 12,
    ]
    kinds = list(dict.fromkeys(answer.anchors for answer in answers))
    is_passed = True
    for anchors, (low, high) in product(kinds, BINS):
        inside = [a for a in answers if a.anchors == anchors and low <= a.overlap < high]
        if not inside:
            continue
        share = float(np.mean([answer.is_right for answer in inside]))
        floor = FLOORS.get((low, high))
        is_met = floor is None or share >= floor
        is_passed &= is_met
        told = f"| {anchors} | {low:.2f}-{min(high, 1.0):.2f} | "
        lines.append(told + _cells(inside, share, floor) + " |")
    values = {kind: auc([a for a in answers if a.anchors == kind]) for kind in kinds}
    is_passed &= all(value >= MIN_AUC for value in values.values())
    told = ", ".join(f"{kind} {value:.4f}" for kind, value in values.items())
    lines.append(
        f"\nAUC of the score, right against wrong first answers: {told} (floor {MIN_AUC})."
    )
    return lines, is_passed


def _cells(inside: list[Answer], share: float, floor: float | None) -> str:
    right = [answer for answer in inside if answer.is_right]
    accepted = [answer for answer in inside if answer.kind == PairKind.GOOD]
    is_missed = floor is not None and share < floor
    cells = (
        len(inside),
        f"**{share:.1%} FAIL**" if is_missed else f"{share:.1%}",
        "-" if floor is None else f"{floor:.0%}",
        f"{np.mean([answer.is_near for answer in inside]):.1%}",
        f"{np.mean([answer.rank is not None for answer in inside]):.1%}",
        len(accepted),
        sum(not answer.is_right for answer in accepted),
        _median([answer.rotation_deg for answer in right]),
        _median([answer.translation_percent for answer in right]),
        f"{np.mean([answer.seconds for answer in inside]):.2f}",
    )
    return " | ".join(str(cell) for cell in cells)


def _median(values: list[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.2f}" if known else "-"


def auc(answers: list[Answer]) -> float:
    """Chance that a right first answer has a higher score than a wrong one; NaN without either."""
    given = [answer for answer in answers if answer.score is not None]
    is_right = np.array([answer.is_right for answer in given], dtype=bool)
    num_right, num_wrong = int(is_right.sum()), int((~is_right).sum())
    if not num_right or not num_wrong:
        return float("nan")
    ranks = rankdata([answer.score for answer in given])
    return float((ranks[is_right].sum() / num_right - 0.5 * (num_right + 1)) / num_wrong)


def plot(answers: list[Answer], path: Path) -> None:
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
    parser.add_argument("--objects", nargs="+", choices=list(OBJECTS), default=list(OBJECTS))
    parser.add_argument("--seeds", type=int, default=1, help="number of random frames of each scan")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--keypoints", nargs="+", choices=["mixed", "heat", "even"], default=["mixed"]
    )
    parser.add_argument("--data", type=Path, help="folder of the Stanford data")
    parser.add_argument("--out", type=Path, help="JSON file of all answers")
    parser.add_argument("--plot", type=Path, help="PNG file, of the last kind of keypoints")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
