"""Small rendered scenes with exact truth, for the tests of every stage."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from scanweld.evaluation.creature import creature
from scanweld.evaluation.primitives import box, cylinder, plate, sphere
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import RangeScan
from scanweld.io import write_scan_ply

MILD_NOISE = NoiseModel(
    depth_diameters=5e-4, dropout=0.01, grazing_dropout=0.5, quantum_diameters=2e-4
)

PRIMITIVES: dict[str, Callable[[], TriangleMesh]] = {
    "sphere": sphere,
    "box": box,
    "cylinder": cylinder,
    "plate": plate,
}


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Scans of one object, each in its own random frame, and where they belong."""

    mesh: TriangleMesh
    views: tuple[View, ...]
    scans: tuple[RangeScan, ...]
    world_from_scan: dict[str, Pose]

    def i_from_j(self, i: int, j: int) -> Pose:
        """True motion from the frame of scan j to that of scan i."""
        names = self.scans[i].name, self.scans[j].name
        return self.world_from_scan[names[0]].inverse() @ self.world_from_scan[names[1]]


@lru_cache(maxsize=8)
def small_creature(seed: int = 0) -> TriangleMesh:
    """The creature in about 10,000 faces, 170 units long."""
    return creature(seed, voxels=70)


def random_motion(rng: np.random.Generator, size: float) -> Pose:
    """Any rotation, and a shift of up to a size along each axis."""
    return Pose(rotation=random_rotation(rng), translation=rng.uniform(-size, size, size=3))


def scene_of(
    mesh: TriangleMesh,
    views: Sequence[View],
    *,
    noise: NoiseModel | None = None,
    seed: int = 0,
    in_sensor_frames: bool = False,
) -> Scene:
    """Scan a mesh from views; scans are called scan_01, scan_02, ... in that order."""
    rng = np.random.default_rng(seed)
    scans, poses = [], {}
    for k, view in enumerate(views):
        motion = Pose.identity() if in_sensor_frames else random_motion(rng, 300.0)
        scan = scan_mesh(
            mesh,
            view.camera,
            view.world_from_sensor,
            noise,
            seed=int(rng.integers(2**31)),
            scan_from_sensor=motion,
            name=f"scan_{k + 1:02d}",
        )
        scans.append(scan)
        poses[scan.name] = view.world_from_sensor @ motion.inverse()
    return Scene(mesh=mesh, views=tuple(views), scans=tuple(scans), world_from_scan=poses)


def write_scans(folder: Path, scans: Sequence[RangeScan]) -> Path:
    """The folder, with a file for each scan."""
    folder.mkdir(parents=True, exist_ok=True)
    for scan in scans:
        write_scan_ply(folder / f"{scan.name}.ply", scan)
    return folder


def creature_scene(
    num_scans: int = 6,
    *,
    pixels: float = 160.0,
    noise: NoiseModel | None = None,
    seed: int = 0,
    object_seed: int = 0,
    model: CameraModel = CameraModel.PINHOLE,
) -> Scene:
    """Views at even steps around the creature, up and down by turns, each camera rolled at random.

    Args:
        num_scans: Steps around the creature: 6 give overlaps of 0.3 to 0.6 between neighbours.
        pixels: Pixels across the diameter of the creature.
        noise: Of the scanner; none if not given.
        seed: Of rolls, frames and noise.
        object_seed: Which creature.
        model: Pinhole or orthographic.
    """
    mesh = small_creature(object_seed)
    rolls = np.random.default_rng(seed).uniform(-180, 180, size=num_scans)
    views = [
        view_of(
            mesh,
            360.0 * k / num_scans,
            (15, -5)[k % 2],
            float(rolls[k]),
            pixels=pixels,
            model=model,
        )
        for k in range(num_scans)
    ]
    return scene_of(mesh, views, noise=noise, seed=seed)


def pair_at_gap(
    gap_deg: float,
    *,
    pixels: float = 180.0,
    noise: NoiseModel | None = None,
    seed: int = 0,
    azimuth_deg: float = 20.0,
    model: CameraModel = CameraModel.PINHOLE,
) -> tuple[RangeScan, RangeScan, Pose]:
    """Two scans of the creature, in random frames and rolls, and the true i_from_j."""
    mesh = small_creature()
    roll = float(np.random.default_rng(seed).uniform(-180, 180))
    i = view_of(mesh, azimuth_deg, 10, pixels=pixels, model=model)
    j = view_of(mesh, azimuth_deg + gap_deg, 10, roll, pixels=pixels, model=model)
    scene = scene_of(mesh, [i, j], noise=noise, seed=seed)
    return scene.scans[0], scene.scans[1], scene.i_from_j(0, 1)


def primitive_scene(
    name: str, num_scans: int = 4, *, pixels: float = 100.0, seed: int = 0
) -> Scene:
    """Scans of a sphere, box, cylinder or plate from a ring of views a little above it."""
    mesh = PRIMITIVES[name]()
    views = [view_of(mesh, 360.0 * k / num_scans + 20, 25, pixels=pixels) for k in range(num_scans)]
    return scene_of(mesh, views, seed=seed)
