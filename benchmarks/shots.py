"""Scans as their sensors took them, and where the sensors stood."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bodies import Body
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.scan import RangeScan

PIXELS = 240.0
"""Pixels across the object's diameter, where a scenario does not say otherwise."""
SLIGHT = NoiseModel(depth_diameters=5e-4, dropout=0.01, grazing_dropout=0.6)
"""What a good scanner does to depth."""
ELEVATIONS_DEG = (20.0, -10.0)
JITTER_DEG = 5.0

Rng = np.random.Generator
Views = Callable[[Body, Rng], list[View]]
"""Where a body is scanned from."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """A scan in its sensor's frame.

    Attributes:
        scan: With a grid and a camera.
        world_from_sensor: Where the sensor stood; None if the scan belongs nowhere.
    """

    scan: RangeScan
    world_from_sensor: Pose | None


def take_shots(body: Body, views: Views, noise: NoiseModel, seed: int, source: str) -> list[Shot]:
    """Scan a body from all views, in the sensors' frames; the source names the scans."""
    rng = np.random.default_rng([seed, 0])
    return [
        Shot(
            scan=scan_mesh(
                body.mesh,
                v.camera,
                v.world_from_sensor,
                noise,
                1000 * seed + k,
                name=f"{source} {k}",
            ),
            world_from_sensor=v.world_from_sensor,
        )
        for k, v in enumerate(views(body, rng))
    ]


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
                up=body.up,
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
                up=body.up,
            )
            for _ in range(count)
        ]

    return views


def twice(views: Views, apart_deg: float) -> Views:
    """Each view and another one beside it, turned a little about the object's middle."""

    def both(body: Body, rng: Rng) -> list[View]:
        low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
        middle = 0.5 * (low + high)
        found = []
        for view in views(body, rng):
            axis = rng.normal(size=3)
            turn = rotation_exp(np.radians(apart_deg) * axis / np.linalg.norm(axis))
            about = Pose(rotation=turn, translation=middle - turn @ middle)
            found += [view, replace(view, world_from_sensor=about @ view.world_from_sensor)]
        return found

    return both
