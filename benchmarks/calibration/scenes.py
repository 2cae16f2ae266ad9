"""Sets of virtual scans for the calibration: an object, views, a sensor, and what goes wrong."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.calibration.solids import SOLIDS
from benchmarks.virtual import disturbances as harm
from benchmarks.virtual.bodies import Body, Rng
from benchmarks.virtual.disturbances import Disturbance, each
from benchmarks.virtual.scene import HIDDEN_PIXELS, Scene, posed, with_mark_seen
from benchmarks.virtual.scenery import held_by_hand, on_table, on_turntable
from benchmarks.virtual.shots import Shot, take_shots
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.scan import principal_diameter

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
    family = str(rng.choice([make.__name__ for make in SOLIDS], p=list(SOLIDS.values())))
    body = _make_solid(family, seed)
    noise = NoiseModel(
        depth_diameters=MAX_NOISE * 10 ** rng.uniform(-1.7, 0.0),
        dropout=float(rng.choice([0.0, 0.01, 0.1, 0.3])),
        grazing_dropout=rng.uniform(0.3, 0.9),
    )
    views = _views(body, rng)
    taking = take_shots
    if rng.random() < SCENERY:
        taking = (on_table, on_turntable, held_by_hand)[int(rng.integers(3))]
    shots = with_mark_seen(taking(body, views, noise, seed), body, views, HIDDEN_PIXELS + 1)
    if rng.random() < HARM:
        shots = _harm(body, rng)(shots, rng)
    if rng.random() < STRANGERS:
        shots = [*shots, *_strangers(family, noise, seed, rng)][-MAX_SCANS:]
    return posed(shots, body, principal_diameter(body.mesh.vertices), seed)


def _make_solid(family: str, seed: int) -> Body:
    """One of ``SOLIDS`` by its name; others by seed."""
    make = next(make for make in SOLIDS if make.__name__ == family)
    return make(np.random.default_rng([seed, 7]))


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
    azimuths += rng.uniform(0, 360)
    rolls = rng.uniform(-180, 180, size=count)
    angles = np.stack([azimuths, elevations, rolls], axis=-1).tolist()
    across = np.maximum(64.0, pixels).tolist()
    return [view_of(body.mesh, *a, pixels=p) for a, p in zip(angles, across, strict=True)]


def _strangers(family: str, noise: NoiseModel, seed: int, rng: Rng) -> Sequence[Shot]:
    """Two or three scans of another object of the family, in a world of their own."""
    other, away = _make_solid(family, seed + OTHER), harm.far_away(rng)
    shots = take_shots(other, _views(other, rng)[:3], noise, seed + OTHER)
    return [replace(shot, world=1, world_from_sensor=away @ shot.pose) for shot in shots]


def _harm(body: Body, rng: Rng) -> Disturbance:
    harms: list[Disturbance] = [
        each(harm.outlier_points, share=rng.uniform(0.02, 0.2)),
        each(harm.flying_pixels),
        partial(harm.crop_to_ball, radius_diameters=rng.uniform(0.25, 0.5)),
        each(harm.crop_to_window, share=rng.uniform(0.5, 0.8)),
        partial(harm.crop_above, share=rng.uniform(0.5, 0.8)),
        each(harm.crop_by_hand, share=rng.uniform(0.6, 0.8)),
        partial(harm.scaled, factor=1.0 + rng.uniform(-0.03, 0.03)),
        each(harm.as_points),
        each(harm.without_camera),
    ]
    if body.unmarked is None:
        # The mark has a mirror plane: there a mirrored scan would fit, and rightly so.
        harms += [harm.mirrored, harm.mirrored]
    return harms[int(rng.integers(len(harms)))]
