"""The benchmark's sets: real scans renamed, shuffled and moved, or simulated, with their truth."""

import csv
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.virtual.bodies import make_body
from benchmarks.virtual.shots import SLIGHT, ring, shot_overlaps, take_shots
from scanweld.evaluation.creature import creature
from scanweld.evaluation.metrics import object_diameter, scan_centroids
from scanweld.evaluation.simulate import simulate
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.io import read_poses, read_scan, write_scan_ply

DEFAULT_DATA = Path(__file__).parents[1] / ".." / "shared" / "data"


@dataclass(frozen=True, kw_only=True, slots=True)
class BenchmarkSet:
    """Scans of one object that are put together in one run, as sets.toml describes them."""

    folder: str = ""  # Of the data, with a poses.json; empty for the simulated creature
    scans: tuple[str, ...] = ()  # Names of the scans in that folder
    any_rotation: bool = False  # Whether files are turned not only about their viewing axis
    floors: Mapping[str, float]  # Most that each value of a run may be, by its name
    num_simulated: int = 10  # Scans of the creature
    pixels: float = 300.0  # and their pixels across it

    @property
    def num_scans(self) -> int:
        """All of them."""
        return len(self.scans) or self.num_simulated

    def is_met(self, run: Mapping[str, Any]) -> bool:
        """Whether a run reaches all floors."""
        within = all(run[k] is not None and run[k] <= most for k, most in self.floors.items())
        return run["right"] >= self.num_scans and run["wrong"] == 0 and within


def _benchmark_set(row: dict[str, Any]) -> BenchmarkSet:
    step = row.pop("step_deg", 0)
    scans = [f"dragonStandRight_{a}" for a in range(0, 360, step)] if step else row.pop("scans", ())
    floors = row.pop("floors")
    for error in ("rotation", "translation"):
        floors[f"{error}_mean"], floors[f"{error}_max"] = floors.pop(error)
    return BenchmarkSet(scans=tuple(scans), floors=floors, **row)


_ROWS = tomllib.loads(Path(__file__).with_name("sets.toml").read_text(encoding="utf-8"))
SETS: Mapping[str, BenchmarkSet] = {name: _benchmark_set(row) for name, row in _ROWS.items()}
QUICK = "quick"
"""The set that needs no data."""
OBJECTS = {"bunny": SETS["bunny10"], "dragon": SETS["dragon15"]}
"""Whose pairs are registered alone,"""
MAX_GAP_DEG = {"bunny": 360.0, "dragon": 97.0}
"""if there is no more than this between two scans."""


class Truth(NamedTuple):
    """What a made set is held against."""

    poses: Mapping[str, Pose]  # Reference world_from_scan by the new names
    originals: Mapping[str, str]  # New name -> the name that the scan had
    centroids: Mapping[str, FloatArray]  # Of each scan, in its new frame
    diameter: float  # Of the object


def data_folder(given: Path | None) -> Path:
    """The folder of the Stanford data: as given, else SCANWELD_DATA, else beside the project."""
    return given or Path(os.environ.get("SCANWELD_DATA", DEFAULT_DATA))


def make_set(wanted: BenchmarkSet, seed: int, out_dir: Path, data: Path) -> Truth:
    """Write the scans of a set to a folder, in the seed's order, names and frames."""
    if not wanted.folder:
        how = {"num_scans": wanted.num_simulated, "pixels": wanted.pixels, "seed": seed}
        poses = simulate(creature(), out_dir, **how).poses
        scans = [read_scan(out_dir / f"{name}.ply") for name in poses]
        originals = {name: name for name in poses}
    else:
        source = data / wanted.folder
        moved, poses = moved_scans(
            [read_scan(source / f"{name}.ply") for name in wanted.scans],
            read_poses(source / "poses.json").poses,
            seed,
            any_rotation=wanted.any_rotation,
        )
        order = np.random.default_rng([seed, 1]).permutation(len(moved))
        originals = {f"scan_{k:02d}": moved[at].name for k, at in enumerate(order, start=1)}
        scans = [replace(moved[at], name=name) for name, at in zip(originals, order, strict=True)]
        poses = {name: poses[original] for name, original in originals.items()}
        out_dir.mkdir(parents=True, exist_ok=True)
        for scan in scans:
            write_scan_ply(out_dir / f"{scan.name}.ply", scan)
    return truth_of(scans, poses, originals)


def truth_of(
    scans: Sequence[RangeScan], poses: Mapping[str, Pose], originals: Mapping[str, str] = {}
) -> Truth:
    """What scans with these poses are held against."""
    return Truth(poses, originals, scan_centroids(scans), object_diameter(scans, poses))


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
        turn = random_rotation(rng) if any_rotation else roll
        motion = Pose(rotation=turn, translation=rng.uniform(-reach, reach, size=3))
        quarters = int(rng.integers(4)) if turn_grids else 0
        kept = {"name": scan.name, "colors": scan.colors, "confidence": scan.confidence}
        grid = None if scan.grid is None else np.rot90(scan.grid, quarters)
        moved.append(RangeScan(points=motion.apply(scan.points), grid=grid, **kept))
        poses[scan.name] = world_from_scan[scan.name] @ motion.inverse()
    return moved, poses


class PairSet(NamedTuple):
    """Scans of an object, their true poses, and the pairs that are asked for."""

    name: str
    scans: list[RangeScan]
    world_from_scan: Mapping[str, Pose]
    pairs: Mapping[tuple[str, str], tuple[float, float]]  # Overlap, and rotation in degrees


def overlaps_of(folder: Path) -> list[dict[str, Any]]:
    """The pairs of the scans in a folder: names "i" and "j", "overlap", "gap" in degrees."""
    with (folder / "overlaps.csv").open(encoding="utf-8") as file:
        return [
            {
                **{"i": row["i"], "j": row["j"], "gap": float(row["rotation_deg"])},
                "overlap": min(float(row["overlap_ij"]), float(row["overlap_ji"])),
            }
            for row in csv.DictReader(file)
        ]


def real_pairs(name: str, data: Path) -> PairSet:
    """Of an object of the data."""
    folder = data / OBJECTS[name].folder
    rows = [row for row in overlaps_of(folder) if row["gap"] <= MAX_GAP_DEG[name]]
    return PairSet(
        name=name,
        scans=[read_scan(folder / f"{name}.ply") for name in OBJECTS[name].scans],
        world_from_scan=read_poses(folder / "poses.json").poses,
        pairs={(row["i"], row["j"]): (row["overlap"], row["gap"]) for row in rows},
    )


def made_pairs() -> PairSet:
    """Three of a made object, without the data."""
    body = make_body("thing", 0)
    views = ring(body, np.random.default_rng(0), count=3, step_deg=40.0, pixels=(120.0,))
    shots = take_shots(body, views, SLIGHT, 0)
    overlaps, poses = shot_overlaps(shots), {shot.scan.name: shot.pose for shot in shots}
    pairs = {
        (f"{i}", f"{j}"): (float(overlaps[i, j]), 40.0 * (j - i))
        for i, j in combinations(range(len(shots)), 2)
    }
    scans = [shot.scan for shot in shots]
    return PairSet(name="made", scans=scans, world_from_scan=poses, pairs=pairs)
