"""Scans that are not of the object: of another one, of nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.virtual.bodies import make_body
from benchmarks.virtual.disturbances import depth_of, with_depth
from benchmarks.virtual.shots import SLIGHT, Rng, Shot, Views, ring, take_shots
from scanweld.geometry.pose import Pose, random_rotation

LIKE = 500
"""An even number: this many seeds on there is another object of the same sort."""
NOISE_RADIUS = 0.35
"""Of the disc of noise, in widths of the image."""

Strangers = Callable[[int, Rng], list[Shot]]
"""Scans besides those of the object of this seed."""


def two_of(body: str, seeds_on: int = 0) -> Strangers:
    """Two scans of another object, from opposite sides: they belong nowhere."""

    def strangers(seed: int, rng: Rng) -> list[Shot]:
        shots = _shots_of(body, seed + seeds_on, ring(2), rng)
        return [replace(shot, world_from_sensor=None, world=1) for shot in shots]

    return strangers


def half_of(body: str, views: Views, seeds_on: int = 0) -> Strangers:
    """Scans of another object, which belong together in a world of their own."""

    def strangers(seed: int, rng: Rng) -> list[Shot]:
        away = Pose(rotation=random_rotation(rng), translation=rng.uniform(500, 1000, size=3))
        return [
            replace(shot, world_from_sensor=away @ shot.world_from_sensor, world=1)
            for shot in _shots_of(body, seed + seeds_on, views, rng)
            if shot.world_from_sensor is not None
        ]

    return strangers


def noise_scan(seed: int, rng: Rng) -> list[Shot]:
    """One scan of nothing but noise in the middle of the image."""
    scan = _shots_of("thing", seed, ring(1), rng)[0].scan
    depth = depth_of(scan)
    low, high = np.nanmin(depth), np.nanmax(depth)
    rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]]
    half = 0.5 * np.array(depth.shape)
    disc = np.hypot(rows - half[0], columns - half[1]) < NOISE_RADIUS * min(depth.shape)
    noise = np.where(disc, rng.uniform(low, high, size=depth.shape), np.nan)
    return [Shot(scan=replace(with_depth(scan, noise), name="noise"), world_from_sensor=None)]


def _shots_of(name: str, seed: int, views: Views, rng: Rng) -> list[Shot]:
    body = make_body(name, seed)
    shots = take_shots(body, views(body, rng), SLIGHT, seed + 1)
    return [replace(s, scan=replace(s.scan, name=f"other {s.scan.name}")) for s in shots]
