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

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from benchmarks.blocks import rendered
from benchmarks.captures import parser_of
from benchmarks.results import Json, write_results
from benchmarks.scores import Stated
from benchmarks.sets import OBJECTS, PairSet, data_folder, made_pairs, moved_scans, real_pairs
from benchmarks.study.plots import save, subplots
from scanweld.config import Config, PairsConfig
from scanweld.evaluation.metrics import RIGHT, object_diameter
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import describe
from scanweld.pairs.registrar import PairRegistrar, PairScan, PairTask
from scanweld.pairs.result import PairResult
from scanweld.preparation.prepare import prepare
from scanweld.work.threads import map_in_order, single_threaded_algebra

KEYPOINTS = ("mixed", "heat", "even")
NEAR = {"rotation_deg": 10.0, "translation_percent": 5.0}
"""Most of the errors of an answer that is at least in the right basin."""
FLOORS = {(0.15, 1.01): 0.95, (0.10, 0.15): 0.80, (0.05, 0.10): None, (0.0, 0.05): None}
"""Share of first answers that must be right, by overlap."""
MIN_AUC = 0.97


def main() -> int:
    """Register all pairs; 0 if the floors are met, else 1."""
    parser = parser_of("Register pairs of real scans from any start.", "object", OBJECTS)
    add = parser.add_argument
    add("--seeds", type=int, default=1, help="number of random frames of each scan")
    add("--keypoints", nargs="+", choices=KEYPOINTS, default=["mixed"])
    add("--plot", type=Path, help="PNG file, of the last kind of keypoints")
    options = parser.parse_args()
    data = data_folder(options.data)
    objects = [made_pairs()] if options.quick else [real_pairs(n, data) for n in options.objects]
    answers: list[Json] = []
    for anchors, scans, seed in product(options.keypoints, objects, range(options.seeds)):
        print(f"{anchors}, {scans.name} seed {seed}", file=sys.stderr, flush=True)
        answers += answers_of(scans, seed, anchors, options.workers)
    if options.out:
        write_results(options.out, answers)
    if options.plot:
        plot([a for a in answers if a["anchors"] == options.keypoints[-1]], options.plot)
    print(rendered("pairs-table", **over_pairs(answers)), end="")
    return 0 if options.quick or are_floors_met(answers) else 1


def answers_of(scans: PairSet, seed: int, anchors: str, workers: int) -> list[Json]:
    """Register all pairs of an object, its scans moved as the seed says.

    An answer has the anchors that its hypotheses hung on, the pair, the errors, score and evidence
    of the first alternative (None where there is no pose), and the rank of the first right one.
    """
    config = Config(pairs=PairsConfig.model_validate({"keypoints": anchors}))
    with single_threaded_algebra():
        moved, truth = moved_scans(
            scans.scans, scans.world_from_scan, seed, any_rotation=True, turn_grids=True
        )
        # As a run does: the method's own way to register two scans, by index.
        prepared = list(map_in_order(lambda scan: prepare(scan, config.prepare), moved, workers))
        registrar = PairRegistrar(config=config)

        def described(scan: PreparedScan) -> PairScan:
            return registrar.scan(scan, None if anchors == "even" else describe(scan, config.heat))

        parts = list(map_in_order(described, prepared, workers))
        diameter = object_diameter(moved, truth)

        def answer(edge: tuple[str, str]) -> Json:
            at_i, at_j = (k for k, scan in enumerate(prepared) if scan.name in edge)
            i, j = prepared[at_i], prepared[at_j]
            start = time.perf_counter()
            result = registrar.register(PairTask(edge=(at_i, at_j)), parts[at_i], parts[at_j])
            seconds = time.perf_counter() - start
            true = truth[i.name].inverse() @ truth[j.name]
            errors = [_error(i, j, each.i_from_j, true) for each in result.alternatives]
            overlap, gap_deg = scans.pairs[edge]
            return {
                **{"anchors": anchors, "object": scans.name, "seed": seed, "i": i.name},
                **{"j": j.name, "overlap": overlap, "gap_deg": gap_deg},
                **_told(result, [(turn, 100.0 * shift / diameter) for turn, shift in errors]),
                "seconds": seconds,
            }

        return list(map_in_order(answer, list(scans.pairs), workers))


def _error(i: PreparedScan, j: PreparedScan, i_from_j: Pose, true: Pose) -> tuple[float, float]:
    """Rotation in degrees, and translation at j's centroid."""
    off = true.inverse() @ i.scan_from_sensor @ i_from_j @ j.scan_from_sensor.inverse()
    return off.angle_deg(), off.shift_at(j.scan.points.mean(axis=0))


def _told(result: PairResult, errors: Sequence[tuple[float, float]]) -> Json:
    """What a pair's result says, and the errors of its answers in degrees and percent."""
    limits, best = RIGHT, result.best
    right = [k for k, (r, t) in enumerate(errors, 1) if r <= limits[0] and t <= limits[1]]
    rotation, translation = errors[0] if errors else (None, None)
    return {
        **{"kind": str(result.kind), "rotation_deg": rotation, "translation_percent": translation},
        "score": best.score if best else None,
        "evidence": asdict(best.evidence) if best else {},
        **{"margin": result.margin, "observability": result.observability},
        "rank": right[0] if right else None,
    }


def over_pairs(answers: Sequence[Json]) -> Json:
    """The answers by anchors, and by anchors and overlap with their floors; how scores tell."""
    kinds = {
        kind: [answer for answer in answers if answer["anchors"] == kind]
        for kind in dict.fromkeys(answer["anchors"] for answer in answers)
    }
    bins = [
        {"anchors": kind, "low": low, "high": high, "floor": floor, "answers": inside}
        for kind, of in kinds.items()
        for (low, high), floor in FLOORS.items()
        if (inside := [a for a in of if low <= a["overlap"] < high])
    ]
    for each in bins:
        share = float(np.mean([a["rank"] == 1 for a in each["answers"]]))
        each |= {"share": share, "is_met": each["floor"] is None or share >= each["floor"]}
    areas = {
        kind: Stated.of((a["score"], a["rank"] == 1) for a in of if a["score"] is not None).auc
        for kind, of in kinds.items()
    }
    return {"bins": bins, "aucs": areas, "min_auc": MIN_AUC, "in_all": kinds, "near": NEAR}


def are_floors_met(answers: Sequence[Json]) -> bool:
    """Whether enough is right at every overlap, and told from wrong by its score."""
    found = over_pairs(answers)
    areas = found["aucs"].values()
    return all(b["is_met"] for b in found["bins"]) and all(area >= MIN_AUC for area in areas)


def plot(answers: Sequence[Json], path: Path) -> None:
    """Score against overlap, right and wrong, and the share of right answers by overlap."""
    figure, (left, right) = subplots(1, 2, figsize=(11, 4.2))
    given = [a for a in answers if a["score"] is not None]
    for is_right, color, label in ((False, "#c0392b", "wrong"), (True, "#2471a3", "right")):
        chosen = [a for a in given if (a["rank"] == 1) is is_right]
        xy = np.array([(a["overlap"], a["score"]) for a in chosen]).reshape(-1, 2)
        left.scatter(xy[:, 0], xy[:, 1], s=18, c=color, label=f"{label} ({len(chosen)})", alpha=0.7)
    left.axhline(Config().pairs.min_score, color="grey", lw=0.8, ls="--")
    left.set(xlabel="overlap", ylabel="score of the first answer")
    left.legend(loc="lower right")
    edges = (0, 0.05, 0.10, 0.15, 0.2, 0.3, 0.4, 0.6, 1)
    bin_of = np.digitize([a["overlap"] for a in answers], edges[1:-1])
    counts = np.bincount(bin_of, minlength=len(edges) - 1)
    is_right = [a["rank"] == 1 for a in answers]
    places, num_right = np.arange(len(counts)), np.bincount(bin_of, is_right, len(counts))
    bars = right.bar(places, num_right / np.maximum(counts, 1), color="#2471a3")
    right.bar_label(bars, [str(count) for count in counts], fontsize=9)
    right.set_xticks(places, [f"{a:g}\n–{b:g}" for a, b in pairwise(edges)])
    right.set(xlabel="overlap (above the bars: pairs)", ylabel="right as first answer")
    right.set_ylim(0, 1.1)
    save(figure, path)


if __name__ == "__main__":
    sys.exit(main())
