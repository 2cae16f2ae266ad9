"""Sets of virtual scans for the calibration: an object, views, a sensor, and what goes wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.calibration.solids import ODDS, SOLIDS, make_solid
from benchmarks.virtual.bodies import Body
from benchmarks.virtual.crops import crop_above, crop_by_hand, crop_to_ball, crop_to_window
from benchmarks.virtual.disturbances import Disturbance, flying_pixels, mirrored, outlier_points
from benchmarks.virtual.disturbances import scaled as scaled_by
from benchmarks.virtual.formats import as_points, without_camera
from benchmarks.virtual.scene import HIDDEN_PIXELS, Scene, mark_pixels, posed
from benchmarks.virtual.scenery import held_by_hand, on_table, on_turntable
from benchmarks.virtual.shots import Shot, Taking, take_shots
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import principal_diameter

Rng = np.random.Generator

HARM, SCENERY, STRANGERS = 0.45, 0.15, 0.2
"""Share of the sets in which something goes wrong besides noise and dropouts, in which something
else is scanned too, and that hold scans of another object of the same family."""
MAX_SCANS = 6
MAX_NOISE = 0.01
OTHER = 500_000
"""So many seeds on there is another object."""


def make_set(seed: int) -> Scene:
    """The scans of a set, in random frames, and the truth about them."""
    rng = np.random.default_rng([seed, 11])
    family = str(rng.choice(list(SOLIDS), p=ODDS))
    body = make_solid(family, seed)
    noise = NoiseModel(
        depth_diameters=MAX_NOISE * 10 ** rng.uniform(-1.7, 0.0),
        dropout=float(rng.choice([0.0, 0.01, 0.1, 0.3])),
        grazing_dropout=rng.uniform(0.3, 0.9),
    )
    views = _views(body, rng)
    taking = _scenery(rng) if rng.random() < SCENERY else take_shots
    shots = taking(body, views, noise, seed)
    if body.unmarked is not None:
        seen = [count > HIDDEN_PIXELS for count in mark_pixels(body, views)]
        shots = [replace(shot, sees_mark=sees) for shot, sees in zip(shots, seen, strict=True)]
    if rng.random() < HARM:
        shots = _harm(body, rng)(shots, rng)
    if rng.random() < STRANGERS:
        shots = [*shots, *_strangers(family, noise, seed, rng)][-MAX_SCANS:]
    return posed(shots, body, principal_diameter(body.mesh.vertices), seed)


def _views(body: Body, rng: Rng) -> list[View]:
    """A part of a ring, from narrow to wide steps, or directions from all over the sphere."""
    count = int(rng.integers(3, 6))
    if rng.random() < 0.3:
        azimuths = rng.uniform(0, 360, size=count)
        elevations = np.degrees(np.arcsin(rng.uniform(-1, 1, size=count)))
    else:
        azimuths = rng.uniform(25, 100) * np.arange(count) + rng.uniform(-8, 8, size=count)
        elevations = rng.uniform(-30, 40, size=count)
    pixels = np.full(count, 2 ** rng.uniform(6.0, 8.3))
    pixels[1::2] /= rng.choice([1.0, 1.0, 2.0, 3.0])
    start, rolls = rng.uniform(0, 360), rng.uniform(-180, 180, size=count)
    return [
        view_of(
            body.mesh,
            start + float(azimuths[k]),
            float(elevations[k]),
            float(rolls[k]),
            pixels=max(64.0, float(pixels[k])),
        )
        for k in range(count)
    ]


def _scenery(rng: Rng) -> Taking:
    return (on_table, on_turntable, held_by_hand(2, 0.1))[int(rng.integers(3))]


def _strangers(family: str, noise: NoiseModel, seed: int, rng: Rng) -> Sequence[Shot]:
    """Two or three scans of another object of the family, in a world of their own."""
    other = make_solid(family, seed + OTHER)
    away = Pose(rotation=random_rotation(rng), translation=rng.uniform(500, 1000, size=3))
    return [
        replace(shot, world=1, world_from_sensor=away @ shot.world_from_sensor)
        for shot in take_shots(other, _views(other, rng)[:3], noise, seed + OTHER)
        if shot.world_from_sensor is not None
    ]


def _harm(body: Body, rng: Rng) -> Disturbance:
    harms: list[Disturbance] = [
        outlier_points(rng.uniform(0.02, 0.2)),
        flying_pixels(),
        crop_to_ball(rng.uniform(0.25, 0.5)),
        crop_to_window(rng.uniform(0.5, 0.8)),
        crop_above(rng.uniform(0.5, 0.8)),
        crop_by_hand(rng.uniform(0.6, 0.8)),
        scaled_by(1.0 + rng.uniform(-0.03, 0.03)),
        as_points(),
        without_camera(),
    ]
    if body.unmarked is None:
        # The mark has a mirror plane: there a mirrored scan would fit, and rightly so.
        harms += [mirrored(), mirrored()]
    return harms[int(rng.integers(len(harms)))]
