"""Virtual scans of the study's objects, pairs of them, starts and errors; all in sensor frames."""

import csv
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.paper.baselines.records import ScanPair
from benchmarks.study.study import Unit
from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import Axis, View, overlap, view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import principal_diameter
from scanweld.io import read_mesh
from scanweld.preparation import prepare

OBJECTS = ("armadillo", "bunny")
MADE = "creature"
"""An object that the project makes, for quick studies."""
PIXELS = 240.0
"""Across the object's diameter, as in the study on which the design rests."""
UP: dict[str, Axis] = {"armadillo": "y", "bunny": "y", MADE: "z"}
"""The axis that the views of an object go around."""
DEFAULT_DATA = Path(__file__).parents[2] / ".." / "shared" / "data"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class VirtualScan:
    """A scan ready for registration, and where its sensor stood.

    Attributes:
        scan: Its scan frame is the sensor's.
        world_from_sensor: The world is the mesh's frame.
        diameter: Of the object.
    """

    scan: PreparedScan
    world_from_sensor: Pose
    diameter: float

    def from_other(self, other: "VirtualScan") -> Pose:
        """The true pose of another scan's sensor in this one's frame."""
        return self.world_from_sensor.inverse() @ other.world_from_sensor

    def centre(self) -> FloatArray:
        """(3,) middle of the scan's samples."""
        return self.scan.samples.points.mean(axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class VirtualPair:
    """Two virtual scans of one object."""

    i: VirtualScan
    j: VirtualScan

    @property
    def true(self) -> Pose:
        """The true i_from_j."""
        return self.i.from_other(self.j)

    @property
    def scans(self) -> ScanPair:
        """The pair as methods take it, with the diameter that a run on these scans would take."""
        i, j = self.i.scan, self.j.scan
        return ScanPair(i=i, j=j, diameter=(i.diameter + j.diameter) / 2)

    def start(self, degrees: float, seed: int) -> dict[int, Pose]:
        """The true poses in the frame of i, j turned about its middle by a random axis."""
        return {0: Pose.identity(), 1: disturbed(self.true, self.j.centre(), degrees, seed)}

    def error(self, i_from_j: Pose | None) -> dict[str, float | None]:
        """How far a pose is off: "deg", and "percent" of the object's diameter."""
        return pose_error(self.true, i_from_j, self.j.centre(), self.i.diameter)


def data_file(relative: str) -> Path:
    """A file of the Stanford data, below SCANWELD_DATA or else beside the project.

    Raises:
        InputError: If it is missing.
    """
    path = Path(os.environ.get("SCANWELD_DATA", DEFAULT_DATA)) / relative
    if not path.exists():
        raise InputError(
            f"{path}: is missing; put it there, set SCANWELD_DATA to the folder of the data, or "
            "take --quick, which needs none"
        )
    return path


def overlaps_of(folder: str) -> list[dict[str, Any]]:
    """The pairs of real scans in a folder: names "i" and "j", "overlap", "gap" in degrees."""
    with data_file(f"{folder}/overlaps.csv").open(encoding="utf-8") as file:
        return [
            {
                "i": row["i"],
                "j": row["j"],
                "overlap": min(float(row["overlap_ij"]), float(row["overlap_ji"])),
                "gap": float(row["rotation_deg"]),
            }
            for row in csv.DictReader(file)
        ]


@lru_cache
def mesh_of(name: str) -> TriangleMesh:
    """The complete surface of one of the study's objects.

    Raises:
        InputError: If its file is missing.
    """
    return creature() if name == MADE else read_mesh(data_file(f"meshes/{name}.ply"))


def pair_units(gaps: Iterable[int], azimuths: Iterable[int], **more: Any) -> list[Unit]:
    """Units of all pairs of views of the study's objects.

    Raises:
        InputError: If a mesh is missing.
    """
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
    """Scan one of the study's objects from the side.

    Args:
        name: Of the object.
        azimuth_deg: Of the camera.
        roll_deg: Turn of the camera about its viewing axis.
        noise: Standard deviation of the depth, in diameters.
        seed: Of the noise.
    """
    mesh, view = mesh_of(name), camera_view(name, azimuth_deg, roll_deg)
    model = NoiseModel(depth_diameters=noise)
    scan = scan_mesh(
        mesh, view.camera, view.world_from_sensor, model, seed, name=f"{azimuth_deg:g}"
    )
    return VirtualScan(
        scan=prepare(scan, PrepareConfig()),
        world_from_sensor=view.world_from_sensor,
        diameter=principal_diameter(mesh.vertices),
    )


def camera_view(name: str, azimuth_deg: float, roll_deg: float = 0.0) -> View:
    """The camera that looks at an object from the side."""
    return view_of(mesh_of(name), azimuth_deg, 0.0, roll_deg, pixels=PIXELS, up=UP[name])


def virtual_pair(name: str, azimuth: float, gap: float, noise: float = 0.0) -> VirtualPair:
    """Two scans of an object, a gap apart; the noise of the second has another seed."""
    i = virtual_scan(name, float(azimuth), noise=noise)
    j = virtual_scan(name, float(azimuth + gap), noise=noise, seed=int(noise > 0))
    return VirtualPair(i, j)


@lru_cache(maxsize=1024)
def overlap_of(name: str, azimuth_i: float, azimuth_j: float) -> float:
    """Overlap of two views of an object; rolls do not matter."""
    return overlap(mesh_of(name), *(camera_view(name, a) for a in (azimuth_i, azimuth_j)))


def start_pose(kind: Literal["identity", "random"], pair: ScanPair, seed: int) -> Pose:
    """Where a pair starts, i_from_j.

    ``identity`` is the paper's protocol: both scans in their own camera frames. ``random`` turns j
    by any rotation about its middle, which is laid on the middle of i.
    """
    if kind == "identity":
        return Pose.identity()
    middle_i, middle_j = (scan.samples.points.mean(axis=0) for scan in (pair.i, pair.j))
    rotation = random_rotation(np.random.default_rng([seed, 7]))
    return Pose(rotation=rotation, translation=middle_i - rotation @ middle_j)


def disturbed(i_from_j: Pose, centre: FloatArray, degrees: float, seed: int) -> Pose:
    """A pose turned by an angle about a random axis through a point (3,) of frame j."""
    axis = np.random.default_rng([seed, 11]).normal(size=3)
    rotation = rotation_exp(np.radians(degrees) * axis / np.linalg.norm(axis))
    return i_from_j @ Pose(rotation=rotation, translation=centre - rotation @ centre)


def pose_error(
    true: Pose, found: Pose | None, centre: FloatArray, diameter: float
) -> dict[str, float | None]:
    """Error of i_from_j: "deg", and by how many "percent" of a diameter it puts (3,) of j off."""
    if found is None:
        return {"deg": None, "percent": None}
    off = true.inverse() @ found
    return {"deg": off.angle_deg(), "percent": 100 * off.shift_at(centre) / diameter}
