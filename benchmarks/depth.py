"""Depth cameras: whole frames, masks and layouts to poses, held against the truth.

    python -m benchmarks.depth --out docs/data/depth.json
    python -m benchmarks.depth --quick

- dog: six frames of a real turntable (RealSense D435), as they are and with given masks.
- simulated: ten made objects that are turned before a standing camera with the noise of a D435.
- bust: 34 frames from all around; 029 to 031 show a surface that is not there.
- shelf: fifteen frames of things on a shelf, from the wrist of a robot whose poses are starts.

A pose is right within 5 degrees and 4 % of the diameter, what a camera that errs by 1 % of the
depth allows; the frames of the shelf within 5 degrees and 2 cm.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.blocks import rendered
from benchmarks.captures import depth_frames, kept_records, parser_of
from benchmarks.kept import warn_of_old_calibration
from benchmarks.results import Json, commit, write_results
from benchmarks.sets import data_folder
from benchmarks.virtual.bodies import make_body
from scanweld.cut import mask_of
from scanweld.evaluation.metrics import (
    Limits,
    PoseErrors,
    Standing,
    evaluate_poses,
    object_diameter,
    scan_centroids,
)
from scanweld.evaluation.turntable import CAMERA, D435, TURNS_DEG, turntable
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import PoseSet, read_poses
from scanweld.io.depth.capture import DepthImages
from scanweld.io.depth.pixels import read_mask
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction, ScanVerdict
from scanweld.work.threads import single_threaded_algebra

LIMITS = Limits(rotation_deg=5.0, translation_percent=4.0)
SHELF_LIMITS, METRE = Limits(rotation_deg=5.0, translation_percent=2.0), 1.0
FALSE_SURFACE = ("029", "030", "031")
NUM_BUST = 10
OBJECTS = [(name, seed) for name in ("thing", "other thing") for seed in range(5)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Frames and their truth.

    Attributes:
        subject: What they are of.
        kind: Of the table's rows that are summed up together.
        scans: As they are read.
        truth: world_from_scan by name; none for frames that show a surface that is not there.
        masks: Which pixels (H, W) are the object, by name; empty where that is not asked.
        start: Poses to be tried.
        limits: What is right.
        diameter: What their percents are of; the object's if None.
    """

    subject: str
    kind: str
    scans: Sequence[RangeScan]
    truth: dict[str, Pose]
    masks: dict[str, BoolArray] = field(default_factory=dict)
    start: PoseSet | None = None
    limits: Limits = LIMITS
    diameter: float | None = None


def main() -> int:
    """Measure; print the tables."""
    kinds = {"dog": dog, "simulated": simulated, "bust": bust, "shelf": shelf}
    options = parser_of("Depth cameras.", "kind", kinds).parse_args()
    warn_of_old_calibration()
    chosen = ["simulated"] if options.quick else options.kinds
    records = kept_records(options.out, "kind", chosen)
    for make in cases(options, kinds):
        case = make()
        records.append(measured(case, options.workers))
        told = ", ".join(f"{records[-1][key]} {key}" for key in ("right", "wrong", "unplaced"))
        print(f"{case.subject}: {records[-1]['verdict']}, {told}", file=sys.stderr, flush=True)
        if options.out:
            records.sort(key=lambda record: list(kinds).index(record["kind"]))
            write_results(options.out, records)
    print(rendered("depth", **by_kind(records)), end="")
    return 0


def cases(
    options: argparse.Namespace, kinds: dict[str, Callable[[Path], Iterator[Callable[[], Case]]]]
) -> Iterator[Callable[[], Case]]:
    """What makes the cases, one after the other: all of them take much memory."""
    if options.quick:
        yield partial(made, "thing", 0, turns_deg=(0.0, 25.0, 50.0))
        return
    for kind in options.kinds:
        yield from kinds[kind](data_folder(options.data))


def by_kind(records: Sequence[Json]) -> Json:
    """The records, and the sum of those that are simulated."""
    return {"cases": records, "simulated": [r for r in records if r["kind"] == "simulated"]}


def measured(case: Case, workers: int) -> Json:
    """Register the frames of a case, and hold the result against its truth."""
    began = time.process_time()
    with single_threaded_algebra():
        result = run(case.scans, knowledge=Knowledge(start=case.start), workers=workers)
    seconds = time.process_time() - began
    errors = judged(case, result)
    placed = {name: e for name, e in errors.scans.items() if e.standing is not Standing.UNPLACED}
    wrong = [name for name, error in placed.items() if error.standing is Standing.WRONG]
    kept = [overlap(result, name, mask) for name, mask in case.masks.items()]
    within = [_is_within(result, errors, name) for name in placed if name not in wrong]
    sure = [scan.confidence for scan in result.scans.values() if scan.confidence is not None]
    good = ScanVerdict.GOOD
    return {
        **{"kind": case.kind, "subject": case.subject, "scans": len(case.scans)},
        **{"verdict": result.verdict.value, "components": [len(c) for c in result.components]},
        **{str(standing): errors.count(standing) for standing in Standing},
        "good": sum(scan.verdict is good for scan in result.scans.values()),
        "good_and_wrong": sum(result.scans[name].verdict is good for name in wrong),
        "within_bounds": sum(within),
        "has_model": result.mesh is not None,
        "iou": sorted(kept),
        "confidence": [min(sure), max(sure)] if sure else [],
        **largest(errors, [name for name in placed if name not in wrong]),
        "left_out": dict(result.unplaced),
        "wrong_scans": {
            name: [errors.scans[name].rotation_deg, errors.scans[name].translation]
            for name in wrong
        },
        "cpu_seconds": seconds,
        "reasons": list(result.reasons),
        "commit": commit(),
    }


def judged(case: Case, result: Reconstruction) -> PoseErrors:
    """What became of the frames, by the points of the object alone."""
    found = PoseSet(poses=dict(result.poses), components=result.components)
    known = [scan for scan in case.scans if scan.name in case.truth]
    own = [_only(scan, result, case) for scan in known]
    return evaluate_poses(
        found,
        case.truth,
        centroids=scan_centroids(own),
        diameter=case.diameter or object_diameter(own, case.truth),
        limits=case.limits,
    )


def _only(scan: RangeScan, result: Reconstruction, case: Case) -> RangeScan:
    """A frame's points on the object: by the mask that is known, else as the run cut it."""
    text = result.scans[scan.name].kept
    mask = case.masks.get(scan.name, None if text is None else mask_of(text))
    if mask is None or scan.grid is None:
        return scan
    kept = np.zeros(len(scan.points), dtype=bool)
    kept[scan.grid[mask & (scan.grid >= 0)]] = True
    return scan.only(kept) if kept.any() else scan


def overlap(result: Reconstruction, name: str, mask: BoolArray) -> float:
    """Intersection over union of what was kept of a frame and the object; 0 if nothing was cut."""
    text = result.scans[name].kept
    if text is None:
        return 0.0
    kept = mask_of(text)
    return float((kept & mask).sum() / max((kept | mask).sum(), 1))


def _is_within(result: Reconstruction, errors: PoseErrors, name: str) -> bool:
    report, error = result.scans[name], errors.scans[name]
    bounds = (report.rotation_bound_deg, report.translation_bound)
    if bounds[0] is None or bounds[1] is None:
        return False
    # Errors are those against one scan of the component, whose own error is in them.
    return error.rotation_deg <= bounds[0] and error.translation <= bounds[1]


def largest(errors: PoseErrors, names: Sequence[str]) -> Json:
    """The largest errors of some scans."""
    rotations = [errors.scans[name].rotation_deg for name in names]
    shifts = [errors.scans[name].translation for name in names]
    return {
        "rotation_max": max(rotations, default=None),
        "translation_max": max(shifts, default=None),
        "translation_percent_max": max(
            (100 * shift / errors.diameter for shift in shifts if errors.diameter), default=None
        ),
    }


def dog(data: Path) -> Iterator[Callable[[], Case]]:
    """The plush dog."""
    folder = data / "depth" / "turntable-d435-dog"
    yield partial(_dog, folder, None)
    yield partial(_dog, folder, folder / "mask")


def _dog(folder: Path, masks: Path | None) -> Case:
    scans = [frame.read() for frame in depth_frames(folder, masks=masks)]
    found = {scan.name: read_mask(folder / "mask" / f"{scan.name}.png") for scan in scans}
    seen = {scan.name: scan.grid >= 0 for scan in scans if scan.grid is not None}
    truth = read_poses(folder / "poses.json").poses
    return Case(
        subject="dog, whole frames" if masks is None else "dog, masks given",
        kind="dog",
        scans=scans,
        truth=truth,
        masks={k: m & seen[k] for k, m in found.items()} if masks is None else {},
    )


def simulated(data: Path) -> Iterator[Callable[[], Case]]:
    """Objects that are turned before a standing camera."""
    for name, seed in OBJECTS:
        yield partial(made, name, seed)


def made(name: str, seed: int, turns_deg: tuple[float, ...] | None = None) -> Case:
    """One of the benchmarks' bodies, as a D435 sees it; with turns of its own, in fewer pixels."""
    camera = CAMERA
    if turns_deg is None:
        camera = replace(CAMERA, width=640, height=480, fx=600, fy=600, cx=319.5, cy=239.5)
    shots = turntable(
        make_body(name, seed).mesh, turns_deg or TURNS_DEG, sensor=D435, camera=camera
    )
    names = [scan.name for scan in shots.scans]
    return Case(
        subject=f"{name} {seed}",
        kind="simulated",
        scans=shots.scans,
        truth=dict(zip(names, shots.object_from_sensor, strict=True)),
        masks=dict(zip(names, shots.masks, strict=True)),
    )


def bust(data: Path) -> Iterator[Callable[[], Case]]:
    """The bust, ten frames and all of them."""
    yield partial(_bust, data / "depth" / "bust", NUM_BUST)
    yield partial(_bust, data / "depth" / "bust", None)


def _bust(folder: Path, count: int | None) -> Case:
    truth = read_poses(folder / "poses.json").poses
    sound = {name: pose for name, pose in truth.items() if name not in FALSE_SURFACE}
    names = list(sound)
    if count is not None:
        names = [names[k] for k in np.linspace(0, len(names) - 1, count).round().astype(int)]
    chosen = depth_frames(folder, names=None if count is None else names)
    scans = [frame.read() for frame in chosen]
    return Case(
        subject=f"bust, {len(scans)} of {len(truth)} frames",
        kind="bust",
        scans=scans,
        truth={scan.name: sound[scan.name] for scan in scans if scan.name in sound},
    )


def shelf(data: Path) -> Iterator[Callable[[], Case]]:
    """Things on a shelf, with the poses of the robot's wrist as starts."""
    yield partial(_shelf, data / "field" / "05-apc-depth-frames")


def _shelf(folder: Path) -> Case:
    truth = read_poses(folder / "truth.json")
    files = DepthImages(inputs=[folder]).collect()
    return Case(
        subject="shelf, poses of the wrist as starts",
        kind="shelf",
        scans=[file.read() for file in files],
        truth=truth.poses,
        start=truth,
        limits=SHELF_LIMITS,
        diameter=METRE,
    )


if __name__ == "__main__":
    sys.exit(main())
