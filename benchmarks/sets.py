"""The benchmark's sets: real scans renamed, shuffled and moved, or simulated, with their truth."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanweld.evaluation.creature import creature
from scanweld.evaluation.metrics import object_diameter, scan_centroids
from scanweld.evaluation.simulate import simulate
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.io import read_poses, read_scan, write_scan_ply

DEFAULT_DATA = Path(__file__).parents[1] / ".." / "shared" / "data"

BUNNY = (
    *("bun000", "bun045", "bun090", "bun180", "bun270", "bun315"),
    *("top2", "top3", "chin", "ear_back"),
)


def dragon(step_deg: int, until_deg: int = 360) -> tuple[str, ...]:
    """Names of the dragon's scans at even steps of the turntable."""
    return tuple(f"dragonStandRight_{a}" for a in range(0, until_deg, step_deg))


@dataclass(frozen=True, kw_only=True, slots=True)
class Floors:
    """What a set must reach; None where nothing is asked.

    Errors are in degrees and in percent of the object's diameter.
    """

    right: int
    rotation_mean: float | None = None
    rotation_max: float | None = None
    translation_mean: float | None = None
    translation_max: float | None = None
    seconds: float | None = None
    peak_mb: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class BenchmarkSet:
    """Scans of one object that are put together in one run.

    Attributes:
        folder: Of the data, with a poses.json; None for the simulated creature.
        scans: Names of the scans in that folder.
        any_rotation: Whether files are turned any way, not only about their viewing axis.
        floors: What must be reached.
    """

    folder: str | None
    scans: tuple[str, ...] = ()
    any_rotation: bool = False
    floors: Floors


_BUNNY_FLOORS = Floors(
    right=10,
    rotation_mean=0.15,
    rotation_max=0.4,
    translation_mean=0.15,
    translation_max=0.4,
    seconds=45,
    peak_mb=2000,
)
_WIDE_STEPS = dict(rotation_mean=0.5, rotation_max=1.0, translation_mean=0.5, translation_max=1.0)

SETS: Mapping[str, BenchmarkSet] = {
    "bunny10": BenchmarkSet(folder="stanford-bunny", scans=BUNNY, floors=_BUNNY_FLOORS),
    "bunny4": BenchmarkSet(
        folder="stanford-bunny",
        scans=("bun000", "bun090", "bun180", "bun270"),
        floors=Floors(right=4, **_WIDE_STEPS),
    ),
    "dragon15": BenchmarkSet(
        folder="stanford-dragon",
        scans=dragon(24),
        floors=Floors(
            right=15,
            rotation_mean=0.15,
            rotation_max=0.3,
            translation_mean=0.15,
            translation_max=0.4,
            seconds=90,
        ),
    ),
    "dragon5": BenchmarkSet(
        folder="stanford-dragon", scans=dragon(72), floors=Floors(right=5, **_WIDE_STEPS)
    ),
    "dragon8": BenchmarkSet(
        folder="stanford-dragon",
        scans=dragon(48),
        floors=Floors(
            right=8,
            rotation_mean=0.3,
            rotation_max=0.8,
            translation_mean=0.5,
            translation_max=1.0,
        ),
    ),
    "demo": BenchmarkSet(
        folder=None,
        floors=Floors(
            right=10,
            rotation_mean=0.2,
            rotation_max=0.5,
            translation_mean=0.15,
            translation_max=0.4,
        ),
    ),
    "bunny10-rotated": BenchmarkSet(
        folder="stanford-bunny", scans=BUNNY, any_rotation=True, floors=_BUNNY_FLOORS
    ),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Truth:
    """What a made set is held against.

    Attributes:
        poses: Reference world_from_scan by the new names.
        originals: New name -> the name that the scan had.
        centroids: Of each scan, in its new frame.
        diameter: Of the object.
    """

    poses: dict[str, Pose]
    originals: dict[str, str]
    centroids: dict[str, FloatArray]
    diameter: float


def data_folder(given: Path | None) -> Path:
    """The folder of the Stanford data: as given, else SCANWELD_DATA, else beside the project."""
    return given or Path(os.environ.get("SCANWELD_DATA", DEFAULT_DATA))


def make_set(wanted: BenchmarkSet, seed: int, out_dir: Path, data: Path) -> Truth:
    """Write the scans of a set to a folder, in the seed's order, names and frames."""
    if wanted.folder is None:
        return _simulated(seed, out_dir)
    source = data / wanted.folder
    scans = [read_scan(source / f"{name}.ply") for name in wanted.scans]
    moved, poses = moved_scans(
        scans, read_poses(source / "poses.json").poses, seed, any_rotation=wanted.any_rotation
    )
    out_dir.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 1])
    truth: dict[str, Pose] = {}
    originals: dict[str, str] = {}
    centroids: dict[str, FloatArray] = {}
    for number, k in enumerate(rng.permutation(len(moved)), start=1):
        name = f"scan_{number:02d}"
        write_scan_ply(out_dir / f"{name}.ply", moved[k])
        truth[name], originals[name] = poses[moved[k].name], moved[k].name
        centroids[name] = moved[k].points.mean(axis=0)
    diameter = object_diameter(moved, poses)
    return Truth(poses=truth, originals=originals, centroids=centroids, diameter=diameter)


def moved_scans(
    scans: list[RangeScan],
    world_from_scan: Mapping[str, Pose],
    seed: int,
    *,
    any_rotation: bool,
    turn_grids: bool = False,
) -> tuple[list[RangeScan], dict[str, Pose]]:
    """The scans, each in a random frame, and their reference poses in these frames.

    Args:
        scans: As read from the data; their sensors look along -z.
        world_from_scan: Reference poses.
        seed: Of the motions.
        any_rotation: Any rotation; else a roll about the viewing axis. Both with a shift.
        turn_grids: Whether range grids are turned by quarter turns too, so that not even their
            rows tell what is up.
    """
    rng = np.random.default_rng([seed, 0])
    moved: list[RangeScan] = []
    poses: dict[str, Pose] = {}
    for scan in scans:
        roll = rotation_exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        reach = 2.0 * principal_diameter(scan.points)
        motion = Pose(
            rotation=random_rotation(rng) if any_rotation else roll,
            translation=rng.uniform(-reach, reach, size=3),
        )
        quarters = int(rng.integers(4)) if turn_grids else 0
        moved.append(
            RangeScan(
                name=scan.name,
                points=motion.apply(scan.points),
                grid=None if scan.grid is None else np.rot90(scan.grid, quarters),
                colors=scan.colors,
                confidence=scan.confidence,
            )
        )
        poses[scan.name] = world_from_scan[scan.name] @ motion.inverse()
    return moved, poses


def _simulated(seed: int, out_dir: Path) -> Truth:
    truth = simulate(creature(), out_dir, seed=seed)
    scans = [read_scan(out_dir / f"{name}.ply") for name in truth.poses]
    return Truth(
        poses=truth.poses,
        originals={name: name for name in truth.poses},
        centroids=scan_centroids(scans),
        diameter=object_diameter(scans, truth.poses),
    )
