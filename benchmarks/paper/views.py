"""Virtual scans of the study's objects, pairs of them, starts and errors; all in sensor frames."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import Axis, View, overlap, view_of
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import principal_diameter
from scanweld.io import read_mesh
from scanweld.preparation import prepare

Start = Literal["identity", "random"]

PIXELS = 240.0
"""Across the object's diameter, as in the study on which the design rests."""
UP: dict[str, Axis] = {"armadillo": "y", "bunny": "y", "creature": "z"}
"""The study's objects, and the axis that their views go around."""
DEFAULT_DATA = Path(__file__).parents[2] / ".." / "shared" / "data"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class VirtualScan:
    """A scan ready for registration, and where its sensor stood.

    Attributes:
        scan: Its scan frame is the sensor's.
        world_from_sensor: The world is the mesh's frame.
        view: The camera.
        diameter: Of the object.
    """

    scan: PreparedScan
    world_from_sensor: Pose
    view: View
    diameter: float

    def from_other(self, other: "VirtualScan") -> Pose:
        """The true pose of another scan's sensor in this one's frame."""
        return self.world_from_sensor.inverse() @ other.world_from_sensor

    def centre(self) -> np.ndarray:
        """(3,) middle of the scan's samples."""
        return self.scan.samples.points.mean(axis=0)


def data_folder() -> Path:
    """Where the Stanford data are: SCANWELD_DATA, else beside the project."""
    return Path(os.environ.get("SCANWELD_DATA", DEFAULT_DATA))


@lru_cache
def mesh_of(name: str) -> TriangleMesh:
    """The complete surface of one of the study's objects.

    Raises:
        InputError: If its file is missing.
    """
    if name == "creature":
        return creature()
    path = data_folder() / "meshes" / f"{name}.ply"
    if not path.exists():
        raise InputError(
            f"{path}: is missing; put the mesh there, set SCANWELD_DATA to the folder of the data, "
            "or take --quick, which needs none"
        )
    return read_mesh(path)


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
    mesh = mesh_of(name)
    view = view_of(mesh, azimuth_deg, 0.0, roll_deg, pixels=PIXELS, up=UP[name])
    model = NoiseModel(depth_diameters=noise)
    scan = scan_mesh(
        mesh, view.camera, view.world_from_sensor, model, seed, name=f"{azimuth_deg:g}"
    )
    return VirtualScan(
        scan=prepare(scan, PrepareConfig()),
        world_from_sensor=view.world_from_sensor,
        view=view,
        diameter=principal_diameter(mesh.vertices),
    )


@lru_cache(maxsize=1024)
def overlap_of(name: str, azimuth_i: float, azimuth_j: float) -> float:
    """Overlap of two views of an object; rolls do not matter."""
    mesh = mesh_of(name)
    i, j = (view_of(mesh, a, pixels=PIXELS, up=UP[name]) for a in (azimuth_i, azimuth_j))
    return overlap(mesh, i, j)


def start_pose(kind: Start, i: VirtualScan, j: VirtualScan, seed: int) -> Pose:
    """Where a pair starts, i_from_j.

    ``identity`` is the paper's protocol: both scans in their own camera frames. ``random`` turns j
    by any rotation about its middle, which is laid on the middle of i.
    """
    if kind == "identity":
        return Pose.identity()
    rotation = random_rotation(np.random.default_rng([seed, 7]))
    return Pose(rotation=rotation, translation=i.centre() - rotation @ j.centre())


def disturbed(i_from_j: Pose, centre: np.ndarray, degrees: float, seed: int) -> Pose:
    """A pose turned by an angle about a random axis through a point (3,) of frame j."""
    axis = np.random.default_rng([seed, 11]).normal(size=3)
    rotation = rotation_exp(np.radians(degrees) * axis / np.linalg.norm(axis))
    return i_from_j @ Pose(rotation=rotation, translation=centre - rotation @ centre)


def pose_error(true: Pose, found: Pose, centre: np.ndarray, diameter: float) -> tuple[float, float]:
    """Error of i_from_j: degrees, and how far it puts a point (3,) of j off, in % of a diameter."""
    off = true.inverse() @ found
    return off.angle_deg(), 100 * off.shift_at(centre) / diameter
