"""Virtual and real scans of the study's objects, pairs whose truth is known, starts and errors."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.baselines.records import ScanPair
from benchmarks.sets import data_folder, moved_scans
from benchmarks.study.study import Unit
from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.creature import creature
from scanweld.evaluation.metrics import object_diameter
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import Axis, View, overlap, view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.io import read_mesh, read_poses, read_scan
from scanweld.preparation import prepare

OBJECTS = ("armadillo", "bunny")
MADE = "creature"
"""An object that the project makes, for quick studies."""
PIXELS = 240.0
"""Across the object's diameter, as in the study on which the design rests."""
UP: dict[str, Axis] = {"armadillo": "y", "bunny": "y", MADE: "z"}
"""The axis that the views of an object go around."""

REAL_SEED = 0
"""Of the frames that real scans are given in."""

Error = dict[str, float | None]
"""By how many degrees a pose is off ("deg"), and "percent" of the diameter; None without a pose."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class VirtualScan:
    """A scan in its sensor's frame, where that stood in the mesh's, and the object's diameter."""

    scan: PreparedScan
    world_from_sensor: Pose
    diameter: float

    def from_other(self, other: "VirtualScan") -> Pose:
        """The true pose of another scan's sensor in this one's frame."""
        return self.world_from_sensor.inverse() @ other.world_from_sensor

    def centre(self) -> FloatArray:
        """(3,) middle of the scan's samples."""
        return self.scan.samples.points.mean(axis=0)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class KnownPair:
    """Two scans, the true i_from_j of their sensors, and the diameter of their object."""

    i: PreparedScan
    j: PreparedScan
    true: Pose
    diameter: float

    @property
    def scans(self) -> ScanPair:
        """The pair as methods take it, with the diameter that a run on these scans would take."""
        return ScanPair(i=self.i, j=self.j, diameter=(self.i.diameter + self.j.diameter) / 2)

    @property
    def centre(self) -> FloatArray:
        """(3,) middle of the samples of j."""
        return self.j.samples.points.mean(axis=0)

    def start(self, degrees: float, seed: int) -> dict[int, Pose]:
        """The true poses in the frame of i, j turned about its middle by a random axis."""
        return {0: Pose.identity(), 1: disturbed(self.true, self.centre, degrees, seed)}

    def any_start(self, seed: int) -> Pose:
        """An i_from_j that turns j at random about its middle, which is laid on that of i."""
        rotation = random_rotation(np.random.default_rng([seed, 7]))
        middle = self.i.samples.points.mean(axis=0)
        return Pose(rotation=rotation, translation=middle - rotation @ self.centre)

    def error(self, i_from_j: Pose | None) -> Error:
        """How far a pose is off."""
        return pose_error(self.true, i_from_j, self.centre, self.diameter)


def data_file(relative: str) -> Path:
    """A file of the Stanford data.

    Raises:
        InputError: If it is missing.
    """
    path = data_folder(None) / relative
    if not path.exists():
        raise InputError(
            f"{path}: is missing; put it there, set SCANWELD_DATA to the folder of the data, or "
            "take --quick, which needs none"
        )
    return path


@lru_cache
def mesh_of(name: str) -> TriangleMesh:
    """The complete surface of one of the study's objects."""
    return creature() if name == MADE else read_mesh(data_file(f"meshes/{name}.ply"))


def pair_units(gaps: Iterable[int], azimuths: Iterable[int], **more: Any) -> list[Unit]:
    """Units of all pairs of views of the study's objects."""
    for name in OBJECTS:
        mesh_of(name)
    return [
        {"object": name, "gap": gap, "azimuth": azimuth, **more}
        for name, gap, azimuth in product(OBJECTS, gaps, azimuths)
    ]


@lru_cache(maxsize=64)
def virtual_scan(
    name: str, azimuth_deg: float, *, roll_deg: float = 0.0, noise: float = 0.0, seed: int = 0
) -> VirtualScan:
    """Scan an object from the side, with depth noise of a standard deviation in diameters."""
    mesh, view = mesh_of(name), camera_view(name, azimuth_deg, roll_deg)
    model, title = NoiseModel(depth_diameters=noise), f"{azimuth_deg:g}"
    scan = scan_mesh(mesh, view.camera, view.world_from_sensor, model, seed, name=title)
    return VirtualScan(
        scan=prepare(scan, PrepareConfig()),
        world_from_sensor=view.world_from_sensor,
        diameter=principal_diameter(mesh.vertices),
    )


def camera_view(name: str, azimuth_deg: float, roll_deg: float = 0.0) -> View:
    """The camera that looks at an object from the side."""
    return view_of(mesh_of(name), azimuth_deg, 0.0, roll_deg, pixels=PIXELS, up=UP[name])


def known_pair(i: VirtualScan, j: VirtualScan) -> KnownPair:
    """Two virtual scans of one object."""
    return KnownPair(i=i.scan, j=j.scan, true=i.from_other(j), diameter=i.diameter)


def virtual_pair(name: str, azimuth: float, gap: float, noise: float = 0.0) -> KnownPair:
    """Two scans of an object, a gap apart; the noise of the second has another seed."""
    i = virtual_scan(name, float(azimuth), noise=noise)
    return known_pair(i, virtual_scan(name, float(azimuth + gap), noise=noise, seed=int(noise > 0)))


def real_pair(folder: str, names: tuple[str, ...], i: str, j: str) -> KnownPair:
    """Two scans of an object by their names.

    With ``names`` these scans are disguised by random motions and quarter turns of their grids;
    without any, all scans stay in the frames of their files.
    """
    _, world_from_scan, diameter = _scans(folder, names)
    a, b = (_prepared(folder, names, name) for name in (i, j))
    world_from_a = world_from_scan[i] @ a.scan_from_sensor
    world_from_b = world_from_scan[j] @ b.scan_from_sensor
    return KnownPair(i=a, j=b, true=world_from_a.inverse() @ world_from_b, diameter=diameter)


@lru_cache(maxsize=2)
def _scans(
    folder: str, names: tuple[str, ...]
) -> tuple[dict[str, RangeScan], dict[str, Pose], float]:
    """The scans, their reference poses, and the diameter of the object."""
    poses = dict(read_poses(data_file(f"{folder}/poses.json")).poses)
    chosen = names or sorted(poses)
    scans = [read_scan(data_file(f"{folder}/{name}.ply")) for name in chosen]
    if names:
        scans, poses = moved_scans(scans, poses, REAL_SEED, any_rotation=True, turn_grids=True)
    return {scan.name: scan for scan in scans}, poses, object_diameter(scans, poses)


@lru_cache(maxsize=32)
def _prepared(folder: str, names: tuple[str, ...], name: str) -> PreparedScan:
    return prepare(_scans(folder, names)[0][name], PrepareConfig())


@lru_cache(maxsize=1024)
def overlap_of(name: str, azimuth_i: float, azimuth_j: float) -> float:
    """Overlap of two views of an object; rolls do not matter."""
    return overlap(mesh_of(name), *(camera_view(name, a) for a in (azimuth_i, azimuth_j)))


def disturbed(i_from_j: Pose, centre: FloatArray, degrees: float, seed: int) -> Pose:
    """A pose turned by an angle about a random axis through a point (3,) of frame j."""
    axis = np.random.default_rng([seed, 11]).normal(size=3)
    rotation = rotation_exp(np.radians(degrees) * axis / np.linalg.norm(axis))
    return i_from_j @ Pose(rotation=rotation, translation=centre - rotation @ centre)


def pose_error(true: Pose, found: Pose | None, centre: FloatArray, diameter: float) -> Error:
    """Error of i_from_j, its shift at a point (3,) of j."""
    if found is None:
        return {"deg": None, "percent": None}
    off = true.inverse() @ found
    return {"deg": off.angle_deg(), "percent": 100 * off.shift_at(centre) / diameter}
