"""Scans as their sensors took them, and where the sensors stood."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from benchmarks.virtual.bodies import Body, Rng, middle
from benchmarks.virtual.depth_images import points_in
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, camera_axes, view_along, view_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.scan import RangeScan

PIXELS = 240.0
"""Pixels across the object's diameter, where a scenario does not say otherwise."""
SLIGHT = NoiseModel(depth_diameters=5e-4, dropout=0.01, grazing_dropout=0.6)
"""What a good scanner does to depth."""
JITTER_DEG = 5.0
OVERLAP_SAMPLES = 1500
OVERLAP_SPACINGS = 1.5
"""A point that is as near to another scan, in that scan's point spacings, lies on it."""

Views = Callable[[Body, Rng], list[View]]
"""Where a body is scanned from: one of the functions below, its settings bound."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """A scan in its sensor's frame."""

    scan: RangeScan  # With a grid and a camera, as long as nothing took them away
    world_from_sensor: Pose | None  # Where the sensor stood; None if the scan belongs nowhere
    world: int = 0  # Number of the world: 0 for the object, another one for another object
    factor: float = 1.0  # By which the scan is too large
    sees_mark: bool = True  # Whether the scan shows what tells the object from a symmetric one
    mask: BoolArray | None = None  # (H, W) pixels that see the object; None if all of them do

    @property
    def pose(self) -> Pose:
        """world_from_sensor of a scan that belongs somewhere."""
        assert self.world_from_sensor is not None
        return self.world_from_sensor

    @property
    def world_points(self) -> FloatArray:
        """(N, 3)."""
        return self.pose.apply(self.scan.points)

    @property
    def on_object(self) -> BoolArray:
        """(N,) points that lie on the object, of a scan that still has its grid."""
        assert self.mask is not None
        return points_in(self.scan, self.mask)

    def only(self, kept: BoolArray) -> "Shot":
        """Some of the points."""
        return replace(self, scan=self.scan.only(kept))

    def named(self, name: str) -> "Shot":
        """Made from something else, in words."""
        return replace(self, scan=replace(self.scan, name=name))


Taking = Callable[[Body, list[View], NoiseModel, int], list[Shot]]
"""How scans are taken of a body from views, with a noise and its seed."""


def take_shots(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """Scan a body and nothing else."""
    return [take(body.mesh, view, noise, seed, k) for k, view in enumerate(views)]


def take(mesh: TriangleMesh, view: View, noise: NoiseModel, seed: int, number: int) -> Shot:
    """One scan, in its sensor's frame."""
    pose = view.world_from_sensor
    scan = scan_mesh(mesh, view.camera, pose, noise, 1000 * seed + number, name=f"{number}")
    return Shot(scan=scan, world_from_sensor=pose)


def ring(
    body: Body,
    rng: Rng,
    *,
    count: int,
    step_deg: float | None = None,
    pixels: Sequence[float] = (PIXELS,),
    elevations_deg: Sequence[float] = (20.0, -10.0),
    **lens: CameraModel | float,
) -> list[View]:
    """Views around the object, by turns from a little above and below, the sensor rolled."""
    step, views = 360.0 / count if step_deg is None else step_deg, []
    for k, (aside, up) in enumerate(rng.uniform(-JITTER_DEG, JITTER_DEG, size=(count, 2))):
        elevation = elevations_deg[k % len(elevations_deg)] + up
        axes = camera_axes(step * k + aside, elevation, rng.uniform(-180, 180))
        across = pixels[k % len(pixels)]
        views.append(view_along(body.mesh, axes, pixels=across, **lens))  # type: ignore[arg-type]
    return views


def on_sphere(body: Body, rng: Rng, *, count: int) -> list[View]:
    """Views from directions drawn evenly from the sphere."""
    views = []
    for _ in range(count):
        azimuth, height, roll = (
            rng.uniform(*limits) for limits in ((0, 360), (-1, 1), (-180, 180))
        )
        elevation = float(np.degrees(np.arcsin(height)))
        views.append(view_of(body.mesh, azimuth, elevation, roll, pixels=PIXELS))
    return views


def twice(body: Body, rng: Rng, *, views: Views, count: int, apart_deg: float) -> list[View]:
    """Views, and the first of them again, each turned a little about the object's middle."""
    centre, found, beside = middle(body.mesh), views(body, rng), []
    for view in found[:count]:
        axis = rng.normal(size=3)
        turn = rotation_exp(np.radians(apart_deg) * axis / np.linalg.norm(axis))
        about = Pose(rotation=turn, translation=centre - turn @ centre)
        beside.append(replace(view, world_from_sensor=about @ view.world_from_sensor))
    return found + beside


def is_chain(shots: Sequence[Shot], min_overlap: float) -> bool:
    """Whether pairs that overlap by as much connect all scans."""
    table = shot_overlaps(shots) >= min_overlap
    return connected_components(coo_array(table), directed=False)[0] == 1


def shot_overlaps(shots: Sequence[Shot]) -> FloatArray:
    """Shares of points that lie on the other scan, the smaller of both ways, (N, N)."""
    trees = [KDTree(shot.world_points) for shot in shots]
    few = [tree.data[:: max(1, tree.n // OVERLAP_SAMPLES)] for tree in trees]
    spacing = [np.median(t.query(own, k=2)[0][:, 1]) for t, own in zip(trees, few, strict=True)]
    reaches = OVERLAP_SPACINGS * np.array(spacing)
    ends = list(zip(trees, reaches, strict=True))
    shares = np.array([[(tree.query(own)[0] < r).mean() for tree, r in ends] for own in few])
    return np.minimum(shares, shares.T)
