"""A folder of virtual scans, as a user would have them, and the truth beside it."""

from pathlib import Path

import numpy as np

from scanweld.errors import InputError, WriteError
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import principal_diameter
from scanweld.io.ply_write import write_scan_ply
from scanweld.io.poses import PoseSet, write_poses

TYPICAL_NOISE = NoiseModel(
    depth_diameters=5e-4, dropout=0.01, grazing_dropout=0.6, quantum_diameters=1e-4
)
"""About what a good structured-light scanner does: 0.1 mm on an object of 20 cm."""

_RING_ELEVATIONS_DEG = (20.0, -10.0)
"""Elevations of the sensor on its way around the object, by turns."""
_POLES = ((8, 65.0), (10, -65.0))
"""Number of scans from which on one looks from near a pole, and its elevation in degrees."""
_JITTER_DEG = 5.0
"""Most that azimuths and elevations differ from the regular ones."""


def simulate(
    mesh: TriangleMesh,
    out_dir: Path | str,
    *,
    num_scans: int = 10,
    model: CameraModel = CameraModel.PINHOLE,
    pixels: float = 300.0,
    noise: NoiseModel = TYPICAL_NOISE,
    seed: int = 0,
) -> PoseSet:
    """Scan an object from all around and write the scans in unknown order, each in its own frame.

    Writes ``scan_01.ply``, ``scan_02.ply``, ..., numbered in a random order, with range grid and
    camera, and ``truth/poses.json``. Every scan has its own random frame, camera roll and noise.
    The sensor goes around the z axis.

    Args:
        mesh: The object, faces counter-clockwise seen from outside.
        out_dir: A new or empty folder.
        num_scans: Up to 7 go around the object, 8 or more also have one from above, 10 or more
            one from below.
        model: Pinhole or orthographic.
        pixels: Pixels across the object's diameter.
        noise: What the sensor does to depth.
        seed: Of everything random.

    Returns:
        The true poses, world_from_scan; the world is the mesh's frame.

    Raises:
        InputError: If fewer than two scans are asked for, or the mesh has no faces.
        WriteError: If the folder is not empty or cannot be written.
    """
    if num_scans < 2:
        raise InputError(f"{num_scans} scans cannot be put together: ask for 2 or more")
    if not len(mesh.faces):
        raise InputError("the mesh has no faces to be scanned: give a surface")
    folder = _empty_folder(Path(out_dir))
    rng = np.random.default_rng(seed)
    views = views_around(mesh, num_scans, rng, model=model, pixels=pixels)
    reach = 2.0 * principal_diameter(mesh.vertices)
    truth: dict[str, Pose] = {}
    for number, k in enumerate(rng.permutation(num_scans), start=1):
        motion = Pose(rotation=random_rotation(rng), translation=rng.uniform(-reach, reach, size=3))
        scan = scan_mesh(
            mesh,
            views[k].camera,
            views[k].world_from_sensor,
            noise,
            seed=int(rng.integers(2**63)),
            scan_from_sensor=motion,
            name=f"scan_{number:02d}",
        )
        write_scan_ply(folder / f"{scan.name}.ply", scan)
        truth[scan.name] = views[k].world_from_sensor @ motion.inverse()
    pose_set = PoseSet(poses=truth, components=(tuple(truth),))
    write_poses(folder / "truth" / "poses.json", pose_set)
    return pose_set


def views_around(
    mesh: TriangleMesh,
    num_views: int,
    rng: np.random.Generator,
    *,
    model: CameraModel = CameraModel.PINHOLE,
    pixels: float = 300.0,
) -> list[View]:
    """Views around z, by turns from a little above and below; from near the poles if many."""
    poles = [elevation for least, elevation in _POLES if num_views >= least]
    in_ring = num_views - len(poles)
    places = [
        (360.0 * k / in_ring, _RING_ELEVATIONS_DEG[k % len(_RING_ELEVATIONS_DEG)])
        for k in range(in_ring)
    ]
    places += [(rng.uniform(0, 360), elevation) for elevation in poles]
    views = []
    for azimuth, elevation in places:
        jitter = rng.uniform(-_JITTER_DEG, _JITTER_DEG, size=2)
        roll = rng.uniform(-180, 180)
        views.append(
            view_of(
                mesh,
                azimuth + jitter[0],
                elevation + jitter[1],
                roll,
                pixels=pixels,
                model=model,
            )
        )
    return views


def _empty_folder(folder: Path) -> Path:
    """The folder, made with room for the truth.

    Raises:
        WriteError: If it cannot be made, or holds something.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise WriteError(f"{folder}: is not empty; name another folder or empty it")
        (folder / "truth").mkdir()
    except OSError as error:
        raise WriteError(
            f"{folder}: cannot be written ({error.strerror}); name another folder"
        ) from error
    return folder
