"""What is left of scans in files that say less."""

from dataclasses import replace

from benchmarks.virtual.disturbances import JUMP_DIAMETERS, Disturbance, each
from benchmarks.virtual.shots import Rng
from scanweld.geometry.grid import grid_faces
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter


def without_camera() -> Disturbance:
    """Organised grids of which nothing else is known."""
    return each(
        lambda scan, rng: replace(
            scan, camera=None, scan_from_sensor=None, viewpoint=Viewpoint.UNKNOWN
        )
    )


def as_points() -> Disturbance:
    """Bare points in random order."""
    return each(
        lambda scan, rng: RangeScan(name=scan.name, points=rng.permutation(scan.points, axis=0))
    )


def as_meshes() -> Disturbance:
    """Points and faces, cut at jumps."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        assert scan.grid is not None
        step = JUMP_DIAMETERS * principal_diameter(scan.points)
        faces = grid_faces(scan.grid, scan.points, scan.points[:, 2], step, step)
        return RangeScan(name=scan.name, points=scan.points, faces=faces)

    return each(change)
