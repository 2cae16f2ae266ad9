"""Scans as their sensors took them, and where the sensors stood."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from benchmarks.virtual.bodies import Body
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.scan import RangeScan

PIXELS = 240.0
"""Pixels across the object's diameter, where a scenario does not say otherwise."""
SLIGHT = NoiseModel(depth_diameters=5e-4, dropout=0.01, grazing_dropout=0.6)
"""What a good scanner does to depth."""
ELEVATIONS_DEG = (20.0, -10.0)
JITTER_DEG = 5.0
OVERLAP_SAMPLES = 1500
OVERLAP_SPACINGS = 1.5
"""A point that is as near to another scan, in that scan's point spacings, lies on it."""

Rng = np.random.Generator
Views = Callable[[Body, Rng], list[View]]
"""Where a body is scanned from."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """A scan in its sensor's frame.

    Attributes:
        scan: With a grid and a camera.
        world_from_sensor: Where the sensor stood; None if the scan belongs nowhere.
        world: Number of the world: 0 for the object, another one for another object.
        factor: By which the scan is too large.
        sees_mark: Whether the scan shows what tells the object from a symmetric one.
    """

    scan: RangeScan
    world_from_sensor: Pose | None
    world: int = 0
    factor: float = 1.0
    sees_mark: bool = True


Taking = Callable[[Body, list[View], NoiseModel, int], list[Shot]]
"""How scans are taken of a body from views, with a noise and its seed."""


def take_shots(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """Scan a body and nothing else."""
    return [take(body.mesh, view, noise, seed, k) for k, view in enumerate(views)]


def take(mesh: TriangleMesh, view: View, noise: NoiseModel, seed: int, number: int) -> Shot:
    """One scan, in its sensor's frame."""
    scan = scan_mesh(
        mesh, view.camera, view.world_from_sensor, noise, 1000 * seed + number, name=f"{number}"
    )
    return Shot(scan=scan, world_from_sensor=view.world_from_sensor)


def ring(
    count: int,
    step_deg: float | None = None,
    *,
    pixels: tuple[float, ...] = (PIXELS,),
    elevations_deg: tuple[float, ...] = ELEVATIONS_DEG,
    model: CameraModel = CameraModel.PINHOLE,
    distance_diameters: float = 3.0,
) -> Views:
    """Views around the object, by turns from a little above and below, the sensor rolled."""
    step = 360.0 / count if step_deg is None else step_deg

    def views(body: Body, rng: Rng) -> list[View]:
        jitter = rng.uniform(-JITTER_DEG, JITTER_DEG, size=(count, 2))
        return [
            view_of(
                body.mesh,
                step * k + jitter[k, 0],
                elevations_deg[k % len(elevations_deg)] + jitter[k, 1],
                rng.uniform(-180, 180),
                pixels=pixels[k % len(pixels)],
                model=model,
                distance_diameters=distance_diameters,
            )
            for k in range(count)
        ]

    return views


def on_sphere(count: int) -> Views:
    """Views from directions drawn evenly from the sphere."""

    def views(body: Body, rng: Rng) -> list[View]:
        return [
            view_of(
                body.mesh,
                rng.uniform(0, 360),
                float(np.degrees(np.arcsin(rng.uniform(-1, 1)))),
                rng.uniform(-180, 180),
                pixels=PIXELS,
            )
            for _ in range(count)
        ]

    return views


def twice(views: Views, count: int, apart_deg: float) -> Views:
    """The first of the views again, each turned a little about the object's middle."""

    def both(body: Body, rng: Rng) -> list[View]:
        low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
        middle = 0.5 * (low + high)
        found = views(body, rng)
        beside = []
        for view in found[:count]:
            axis = rng.normal(size=3)
            turn = rotation_exp(np.radians(apart_deg) * axis / np.linalg.norm(axis))
            about = Pose(rotation=turn, translation=middle - turn @ middle)
            beside.append(replace(view, world_from_sensor=about @ view.world_from_sensor))
        return found + beside

    return both


def is_chain(shots: Sequence[Shot], min_overlap: float) -> bool:
    """Whether pairs that overlap by as much connect all scans."""
    table = shot_overlaps(shots) >= min_overlap
    return connected_components(coo_array(table), directed=False)[0] == 1


def shot_overlaps(shots: Sequence[Shot]) -> FloatArray:
    """Shares of points that lie on the other scan, the smaller of both ways, (N, N)."""
    trees = [KDTree(_world_points(shot)) for shot in shots]
    few = [tree.data[:: max(1, tree.n // OVERLAP_SAMPLES)] for tree in trees]
    reach = [_reach(tree, own) for tree, own in zip(trees, few, strict=True)]
    shares = np.array(
        [
            [(tree.query(own)[0] < near).mean() for tree, near in zip(trees, reach, strict=True)]
            for own in few
        ]
    )
    return np.minimum(shares, shares.T)


def _reach(scan: KDTree, few: FloatArray) -> float:
    """Distance within which points lie on a scan, by the spacing of its points about some."""
    return OVERLAP_SPACINGS * float(np.median(scan.query(few, k=2)[0][:, 1]))


def _world_points(shot: Shot) -> FloatArray:
    assert shot.world_from_sensor is not None
    return shot.world_from_sensor.apply(shot.scan.points)
