"""Sets of virtual scans for the calibration: an object, views, a sensor, and what goes wrong."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.calibration.solids import SOLIDS
from benchmarks.virtual import disturbances as harm
from benchmarks.virtual import sensors, trims
from benchmarks.virtual.bodies import Body, Rng
from benchmarks.virtual.disturbances import Disturbance, each, in_turn
from benchmarks.virtual.scene import BASIN, HIDDEN_PIXELS, Scene, posed, with_mark_seen
from benchmarks.virtual.scenery import held_by_hand, on_table, on_turntable
from benchmarks.virtual.shots import Shot, take_shots
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.scan import principal_diameter

STEREO, HARM, SCENERY, STRANGERS = 0.2, 0.4, 0.15, 0.2
"""Share of the sets of a sensor whose errors are correlated, in which something goes wrong besides,
in which something else is scanned too, and that hold scans of another object of the same family."""
ALL_AROUND, ANYWHERE = 0.4, 0.2
"""Share of the sets whose views go all around the object, as most people scan, and of those that
come from anywhere; the others are parts of a ring."""
MAX_SCANS = 9
MAX_NOISE = 0.01
OTHER = 500_000
"""So many seeds on there is another object."""


def make_set(seed: int) -> Scene:
    """The scans of a set, in random frames, and the truth about them."""
    family, has_two_eyes, rng = _kind(seed)
    body = _make_solid(family, seed)
    noise = NoiseModel(
        depth_diameters=MAX_NOISE * 10 ** rng.uniform(-1.7, -0.5 if has_two_eyes else 0.0),
        dropout=float(rng.choice([0.0, 0.01, 0.1, 0.3])),
        grazing_dropout=rng.uniform(0.3, 0.9),
    )
    views = _views(body, rng)
    taking = take_shots
    if rng.random() < SCENERY:
        taking = (on_table, on_turntable, held_by_hand)[int(rng.integers(3))]
    shots = with_mark_seen(taking(body, views, noise, seed), body, views, HIDDEN_PIXELS + 1)
    if has_two_eyes:
        shots = _stereo(rng)(shots, rng)
    if rng.random() < HARM:
        shots = _harm(body, rng)(shots, rng)
    if rng.random() < STRANGERS:
        shots = [*shots, *_strangers(family, noise, seed, rng)][-MAX_SCANS:]
    return replace(posed(shots, body, _diameter(body), seed), limits=BASIN)


def is_stereo(seed: int) -> bool:
    """Whether a set is seen by a depth camera of two eyes."""
    return _kind(seed)[1]


def _kind(seed: int) -> tuple[str, bool, Rng]:
    """Family of a set's object, whether its sensor has two eyes, and what draws the rest."""
    rng = np.random.default_rng([seed, 11])
    family = str(rng.choice([make.__name__ for make in SOLIDS], p=list(SOLIDS.values())))
    return family, rng.random() < STEREO, rng


def _diameter(body: Body) -> float:
    return principal_diameter(body.mesh.vertices)


def _make_solid(family: str, seed: int) -> Body:
    """One of ``SOLIDS`` by its name; others by seed."""
    make = next(make for make in SOLIDS if make.__name__ == family)
    return make(np.random.default_rng([seed, 7]))


def _views(body: Body, rng: Rng) -> list[View]:
    """All around, a part of a ring from narrow to wide steps, or from all over the sphere."""
    kind, count = rng.random(), int(rng.integers(3, 6))
    elevations = rng.uniform(-30, 40, size=count)
    if kind < ALL_AROUND:
        count = int(rng.integers(5, 9))
        azimuths = 360.0 / count * np.arange(count) + rng.uniform(-8, 8, size=count)
        elevations = rng.uniform(-10, 35) + rng.uniform(-12, 12, size=count)
    elif kind < ALL_AROUND + ANYWHERE:
        azimuths = rng.uniform(0, 360, size=count)
        elevations = np.degrees(np.arcsin(rng.uniform(-1, 1, size=count)))
    else:
        azimuths = rng.uniform(25, 100) * np.arange(count) + rng.uniform(-8, 8, size=count)
    pixels = np.full(count, 2 ** rng.uniform(6.0, 8.3))
    pixels[1::2] /= rng.choice([1.0, 1.0, 2.0, 3.0])
    azimuths += rng.uniform(0, 360)
    rolls = rng.uniform(-180, 180, size=count)
    angles = np.stack([azimuths, elevations, rolls], axis=-1).tolist()
    across = np.maximum(64.0, pixels).tolist()
    return [view_of(body.mesh, *a, pixels=p) for a, p in zip(angles, across, strict=True)]


def _strangers(family: str, noise: NoiseModel, seed: int, rng: Rng) -> Sequence[Shot]:
    """Three scans or so of another object of the family, in a world of their own."""
    other, away = _make_solid(family, seed + OTHER), harm.far_away(rng)
    shots = take_shots(other, _views(other, rng)[:3], noise, seed + OTHER)
    return [replace(shot, world=1, world_from_sensor=away @ shot.pose) for shot in shots]


def _stereo(rng: Rng) -> Disturbance:
    """A depth camera of two eyes, whose depth is off by short waves and by long ones."""
    short, long = 0.008 * 10 ** rng.uniform(-1.3, 0.0), 0.015 * 10 ** rng.uniform(-1.3, 0.0)
    lengths = rng.uniform(0.1, 0.45), rng.uniform(0.8, 2.5)
    return in_turn(
        each(sensors.depth_waves, rms_diameters=short, length_diameters=lengths[0]),
        each(sensors.depth_waves, rms_diameters=long, length_diameters=lengths[1]),
        each(sensors.stereo_shadow, baseline_diameters=rng.uniform(0.02, 0.4)),
        each(sensors.eaten_edges, least=rng.uniform(0.0, 1.0), most=rng.uniform(1.0, 4.0)),
        each(sensors.quantised, step_diameters=rng.uniform(0.0005, 0.008)),
    )


def _trimmed(rng: Rng) -> Disturbance:
    """Range maps as people leave them."""
    cut = (trims.trimmed_along_curve, trims.boxed)[int(rng.integers(2))]
    holes = {"count": rng.uniform(0.0, 6.0), "radius_diameters": rng.uniform(0.01, 0.08)}
    return in_turn(
        each(sensors.without_grazing, max_incidence_deg=rng.uniform(55.0, 85.0)),
        each(cut, share=rng.uniform(0.6, 1.0)),
        each(trims.with_holes, **holes),
    )


def _harm(body: Body, rng: Rng) -> Disturbance:
    harms: list[Disturbance] = [
        each(harm.outlier_points, share=rng.uniform(0.02, 0.2)),
        each(harm.flying_pixels),
        partial(harm.crop_to_ball, radius_diameters=rng.uniform(0.25, 0.5)),
        each(harm.crop_to_window, share=rng.uniform(0.5, 0.8)),
        partial(harm.crop_above, share=rng.uniform(0.5, 0.8)),
        each(harm.crop_by_hand, share=rng.uniform(0.6, 0.8)),
        partial(harm.scaled, factor=1.0 + rng.uniform(-0.03, 0.03)),
        partial(harm.scales, within=rng.uniform(0.005, 0.03)),
        *(_trimmed(rng), _trimmed(rng)),
        each(harm.as_points),
        each(harm.as_points_seen),
        each(harm.without_camera),
    ]
    if body.unmarked is None:
        # The mark has a mirror plane: there a mirrored scan would fit, and rightly so.
        harms += [harm.mirrored, harm.mirrored]
    return harms[int(rng.integers(len(harms)))]
