"""Named scenarios of the stress benchmark: what is scanned, from where, and what goes wrong."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bodies import make_body
from disturbances import (
    Disturbance,
    again,
    as_meshes,
    as_points,
    crop_to_ball,
    crop_to_window,
    flying_pixels,
    mirrored,
    outlier_points,
    scaled,
    with_noise_scan,
    with_other,
    without_camera,
)
from scanweld.evaluation.metrics import object_diameter, scan_centroids
from scanweld.evaluation.scanner import NoiseModel
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import RangeScan, principal_diameter
from shots import SLIGHT, Shot, Views, on_sphere, ring, take_shots, twice


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """Scans under neutral names in random frames, and the truth about them.

    Attributes:
        scans: What the pipeline is given.
        truth: world_from_scan of all that belong somewhere. Two objects that are mixed lie in
            frames of their own, so that only one of them can be right in one component.
        sources: What each scan was made from, in words.
        centroids: Of each scan, in its frame.
        diameter: Of the object.
        symmetry: Motions of the world that leave the object as it is.
    """

    scans: list[RangeScan]
    truth: dict[str, Pose]
    sources: dict[str, str]
    centroids: dict[str, FloatArray]
    diameter: float
    symmetry: tuple[Pose, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """How to make the scans of a run.

    Attributes:
        body: Name of the object.
        views: Where it is scanned from.
        noise: What the sensor does to depth.
        disturbances: What happens to the scans after that, one after the other.
    """

    body: str = "creature"
    views: Views
    noise: NoiseModel = SLIGHT
    disturbances: tuple[Disturbance, ...] = ()


def make_scene(name: str, seed: int, data: Path | None) -> Scene:
    """The scans of a scenario. Scenarios of the same object and views differ in nothing else."""
    scenario = SCENARIOS[name]
    body = make_body(scenario.body, seed + 1, data)
    shots = take_shots(body, scenario.views, scenario.noise, seed, scenario.body)
    rng = np.random.default_rng([seed, 1])
    for disturb in scenario.disturbances:
        shots = disturb(shots, rng)
    return _posed(shots, principal_diameter(body.mesh.vertices), body.symmetry, seed)


def _posed(shots: list[Shot], reach: float, symmetry: tuple[Pose, ...], seed: int) -> Scene:
    """Shuffle, rename, and move every scan into a random frame."""
    rng = np.random.default_rng([seed, 2])
    scans: list[RangeScan] = []
    truth: dict[str, Pose] = {}
    sources: dict[str, str] = {}
    for number, k in enumerate(rng.permutation(len(shots)), start=1):
        shot, name = shots[k], f"scan_{number:02d}"
        motion = Pose(
            rotation=random_rotation(rng), translation=rng.uniform(-2 * reach, 2 * reach, size=3)
        )
        sensor = shot.scan.scan_from_sensor
        scans.append(
            replace(
                shot.scan,
                name=name,
                points=motion.apply(shot.scan.points),
                scan_from_sensor=None if sensor is None else motion @ sensor,
            )
        )
        sources[name] = shot.scan.name
        if shot.world_from_sensor is not None:
            truth[name] = shot.world_from_sensor @ motion.inverse()
    return Scene(
        scans=scans,
        truth=truth,
        sources=sources,
        centroids=scan_centroids(scans),
        diameter=object_diameter([s for s in scans if "half" not in sources[s.name]], truth),
        symmetry=symmetry,
    )


def noise_of(share: float) -> NoiseModel:
    """A noise of depth, in diameters of the object."""
    return replace(SLIGHT, depth_diameters=share)


SIX = ring(6)
FIVE = ring(5)

SCENARIOS: Mapping[str, Scenario] = {
    # Clean
    "ring 8": Scenario(views=ring(8)),
    "ring 8 armadillo": Scenario(body="armadillo", views=ring(8)),
    "ring 8 bunny": Scenario(body="bunny", views=ring(8)),
    "ring 6": Scenario(views=SIX),
    "ring 5": Scenario(views=FIVE),
    "ring 5 armadillo": Scenario(body="armadillo", views=FIVE),
    "ring 5 bunny": Scenario(body="bunny", views=FIVE),
    "ring 4": Scenario(views=ring(4)),
    "ring 4 armadillo": Scenario(body="armadillo", views=ring(4)),
    "ring 4 bunny": Scenario(body="bunny", views=ring(4)),
    "random 8": Scenario(views=on_sphere(8)),
    "random 8 bunny": Scenario(body="bunny", views=on_sphere(8)),
    "random 12": Scenario(views=on_sphere(12)),
    "close-up": Scenario(views=ring(6, distance_diameters=1.1)),
    "orthographic": Scenario(views=ring(6, model=CameraModel.ORTHOGRAPHIC)),
    "resolution 64": Scenario(views=ring(6, pixels=(64.0,))),
    "resolution 600": Scenario(views=ring(6, pixels=(600.0,))),
    # Worse scans
    "noise 0.1%": Scenario(views=SIX, noise=noise_of(0.001)),
    "noise 0.25%": Scenario(views=SIX, noise=noise_of(0.0025)),
    "noise 0.5%": Scenario(views=SIX, noise=noise_of(0.005)),
    "noise 1%": Scenario(views=SIX, noise=noise_of(0.01)),
    "outliers 20%": Scenario(views=SIX, disturbances=(outlier_points(0.2),)),
    "dropouts 30%": Scenario(views=SIX, noise=replace(SLIGHT, dropout=0.3)),
    "flying pixels": Scenario(views=SIX, disturbances=(flying_pixels(),)),
    "resolutions 1:4": Scenario(views=ring(6, pixels=(80.0, 320.0))),
    "crop": Scenario(views=ring(6, 25.0), disturbances=(crop_to_ball(0.3),)),
    "crop without camera": Scenario(
        views=ring(6, 25.0), disturbances=(crop_to_ball(0.3), without_camera())
    ),
    "crop to window": Scenario(views=ring(8), disturbances=(crop_to_window(0.6),)),
    "turntable": Scenario(
        body="creature on disc", views=ring(6, elevations_deg=(25.0,), pixels=(260.0,))
    ),
    "scale error 1%": Scenario(views=SIX, disturbances=(scaled(1.01),)),
    # Scans that do not belong
    "2 of another object": Scenario(views=SIX, disturbances=(with_other("armadillo", 2, 0),)),
    "2 of a like object": Scenario(views=SIX, disturbances=(with_other("creature", 2, 500),)),
    "two objects half and half": Scenario(views=FIVE, disturbances=(with_other("bunny", 5, 0),)),
    "two like objects half and half": Scenario(
        views=FIVE, disturbances=(with_other("creature", 5, 500),)
    ),
    "noise scan": Scenario(views=SIX, disturbances=(with_noise_scan(),)),
    "mirrored": Scenario(views=SIX, disturbances=(mirrored(),)),
    "duplicates": Scenario(views=FIVE, disturbances=(again(3),)),
    "near-duplicates": Scenario(views=twice(ring(4), 0.5)),
    # Symmetric objects
    "sphere": Scenario(body="sphere", views=FIVE),
    "cylinder": Scenario(body="cylinder", views=FIVE),
    "cone": Scenario(body="cone", views=FIVE),
    "box": Scenario(body="box", views=FIVE),
    "plate": Scenario(body="plate", views=FIVE),
    "vase": Scenario(body="vase", views=FIVE),
    "gear": Scenario(body="gear", views=ring(5, elevations_deg=(35.0, 10.0))),
    "mirror figure": Scenario(body="mirror figure", views=SIX),
    "near-symmetric vase": Scenario(body="marked vase", views=SIX),
    "near-symmetric gear": Scenario(body="keyed gear", views=ring(6, elevations_deg=(35.0, 20.0))),
    # Formats
    "as points": Scenario(views=SIX, disturbances=(as_points(),)),
    "as meshes": Scenario(views=SIX, disturbances=(as_meshes(),)),
    "as grids": Scenario(views=SIX, disturbances=(without_camera(),)),
    "as points, noise 0.25%": Scenario(
        views=SIX, noise=noise_of(0.0025), disturbances=(as_points(),)
    ),
    "as points bunny": Scenario(body="bunny", views=SIX, disturbances=(as_points(),)),
}

FEW = (
    *("ring 8", "ring 5", "random 8", "resolution 64", "noise 0.25%", "noise 1%", "outliers 20%"),
    *("dropouts 30%", "flying pixels", "crop", "turntable", "2 of another object", "noise scan"),
    *("mirrored", "duplicates", "cylinder", "box", "gear", "as points", "as grids"),
)
"""Some of each kind, for the documentation."""
