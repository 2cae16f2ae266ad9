"""What happens to scans on their way into a file, and scans that are not of the object.

A disturbance takes all scans of a run and gives back others. Its settings are bound with
``partial``; ``each`` makes one of a change that happens to every scan by itself.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import ndimage

from benchmarks.virtual.bodies import Rng, make_body
from benchmarks.virtual.depth_images import JUMP_DIAMETERS, depth_of, silhouette, with_depth
from benchmarks.virtual.shots import SLIGHT, Shot, Views, ring, take_shots
from scanweld.geometry.grid import grid_faces
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter

FLYING_SHARE = 0.6
"""Share of the pixels beside a jump that are measured in between."""
LIKE = 500
"""An even number: this many seeds on there is another object of the same sort."""
NOISE_RADIUS = 0.35
"""Of the disc of noise, in widths of the image."""

Range = tuple[float, float]
"""Least and most of a setting."""
Disturbance = Callable[[list[Shot], Rng], list[Shot]]
Strangers = Callable[[int, Rng], list[Shot]]
"""Scans besides those of the object of this seed."""


def each(change: Callable[..., RangeScan], **settings: float) -> Disturbance:
    """A change that happens to every scan."""
    return lambda shots, rng: [replace(s, scan=change(s.scan, rng, **settings)) for s in shots]


def drawn(change: Callable[..., RangeScan], **ranges: Range) -> Disturbance:
    """A change that happens to every scan, with settings that are drawn once a run."""

    def disturb(shots: list[Shot], rng: Rng) -> list[Shot]:
        settings = {name: rng.uniform(*limits) for name, limits in ranges.items()}
        return each(change, **settings)(shots, rng)

    return disturb


def alike(disturbance: Disturbance) -> Disturbance:
    """The same draws for every scan: what stays as it is in front of the sensor errs alike."""

    def disturb(shots: list[Shot], rng: Rng) -> list[Shot]:
        seed = int(rng.integers(2**32))
        return [disturbance([shot], np.random.default_rng(seed))[0] for shot in shots]

    return disturb


def in_turn(*disturbances: Disturbance) -> Disturbance:
    """One after the other."""

    def disturb(shots: list[Shot], rng: Rng) -> list[Shot]:
        for disturbance in disturbances:
            shots = disturbance(shots, rng)
        return shots

    return disturb


def one_of(*disturbances: Disturbance) -> Disturbance:
    """One of some, drawn once a run."""
    return lambda shots, rng: disturbances[int(rng.integers(len(disturbances)))](shots, rng)


# Errors of the sensor


def outlier_points(scan: RangeScan, rng: Rng, share: float) -> RangeScan:
    """Pixels whose depth is drawn anew from a wider range than the object's."""
    depth = depth_of(scan)
    seen = np.isfinite(depth)
    low, high = depth[seen].min(), depth[seen].max()
    slack = 0.2 * (high - low)
    hit = seen & (rng.random(depth.shape) < share)
    depth[hit] = rng.uniform(low - slack, high + slack, size=int(hit.sum()))
    return with_depth(scan, depth)


def flying_pixels(scan: RangeScan, rng: Rng) -> RangeScan:
    """Pixels beside a jump, and beside the silhouette, measured somewhere in between."""
    depth, size = depth_of(scan), principal_diameter(scan.points)
    seen = np.isfinite(depth)
    is_past = ~silhouette(depth)
    behind = np.where(seen, depth, np.where(is_past, np.nanmax(depth) + 0.3 * size, -np.inf))
    far = ndimage.maximum_filter(behind, size=3)
    near = ndimage.minimum_filter(np.where(seen, depth, np.inf), size=3)
    beside = np.isfinite(near) & (far - near > JUMP_DIAMETERS * size)
    chosen = beside & (rng.random(depth.shape) < FLYING_SHARE)
    part = rng.random(int(chosen.sum()))
    depth[chosen] = near[chosen] + part * (far - near)[chosen]
    return with_depth(scan, depth)


def scaled(shots: list[Shot], rng: Rng, factor: float) -> list[Shot]:
    """The first scan is too large, as from a sensor whose ranges are all too long."""
    return [_larger(shots[0], factor).named(f"{shots[0].scan.name} scaled"), *shots[1:]]


def scales(shots: list[Shot], rng: Rng, within: float) -> list[Shot]:
    """Every scan has a scale of its own, as from a sensor that was calibrated badly."""
    return [_larger(shot, 1.0 + rng.uniform(-within, within)) for shot in shots]


def mirrored(shots: list[Shot], rng: Rng) -> list[Shot]:
    """The first scan has left-handed axes, as from a file with one axis the other way."""
    scan = shots[0].scan
    points = scan.points * np.array([-1.0, 1.0, 1.0])
    grid = None if scan.grid is None else scan.grid[:, ::-1]
    other = RangeScan(name=f"{scan.name} mirrored", points=points, grid=grid)
    return [Shot(scan=other, world_from_sensor=None), *shots[1:]]


def again(shots: list[Shot], rng: Rng, count: int) -> list[Shot]:
    """Some of the scans a second time, in other frames."""
    return shots + [shot.named(f"{shot.scan.name} again") for shot in shots[:count]]


# Crops: what was cut away looks like free space, and is not


def crop_to_ball(shots: list[Shot], rng: Rng, radius_diameters: float) -> list[Shot]:
    """Only what lies within a ball about one place of the object is kept, in all scans."""
    points = shots[0].world_points
    radius = radius_diameters * principal_diameter(shots[0].scan.points)
    spot = points[rng.integers(len(points))]
    return [s.only(np.linalg.norm(s.world_points - spot, axis=1) < radius) for s in shots]


def crop_above(shots: list[Shot], rng: Rng, share: float) -> list[Shot]:
    """The lower part of the object is cut off at one height in all scans, as with a stand."""
    heights = [shot.world_points[:, 2] for shot in shots]
    cut = float(np.quantile(np.concatenate(heights), 1.0 - share))
    return [shot.only(height > cut) for shot, height in zip(shots, heights, strict=True)]


def crop_by_hand(scan: RangeScan, rng: Rng, share: float) -> RangeScan:
    """Another side of what a scan shows is cut off along a line across the image."""
    angle = rng.uniform(0, 2 * np.pi)
    along = scan.points[:, :2] @ np.array([np.cos(angle), np.sin(angle)])
    return scan.only(along < np.quantile(along, share))


def crop_to_window(scan: RangeScan, rng: Rng, share: float) -> RangeScan:
    """The sensor's image is smaller than the object: a window of it, somewhere else each time."""
    assert scan.camera is not None and scan.grid is not None
    starts, sizes = [], []
    for axis in (1, 0):
        line = np.flatnonzero((scan.grid >= 0).any(axis=axis))
        sizes.append(int(share * len(line)))
        starts.append(int(line[0] + rng.integers(len(line) - sizes[-1] + 1)))
    (top, left), (height, width), c = starts, sizes, scan.camera
    grid = scan.grid[top : top + height, left : left + width]
    camera = replace(c, width=width, height=height, cx=c.cx - left, cy=c.cy - top)
    kept = np.zeros(len(scan.points), dtype=bool)
    kept[grid[grid >= 0]] = True
    return replace(replace(scan, grid=grid).only(kept), camera=camera)


# Files that say less


def without_camera(scan: RangeScan, rng: Rng) -> RangeScan:
    """An organised grid of which nothing else is known."""
    return replace(scan, camera=None, scan_from_sensor=None, viewpoint=Viewpoint.UNKNOWN)


def as_points(scan: RangeScan, rng: Rng) -> RangeScan:
    """Bare points in random order."""
    return RangeScan(name=scan.name, points=rng.permutation(scan.points, axis=0))


def as_points_seen(scan: RangeScan, rng: Rng) -> RangeScan:
    """Points in random order, and where the sensor stood."""
    points = as_points(scan, rng)
    return replace(points, scan_from_sensor=scan.scan_from_sensor, viewpoint=scan.viewpoint)


def as_mesh(scan: RangeScan, rng: Rng) -> RangeScan:
    """Points and faces, cut at jumps."""
    assert scan.grid is not None
    step = JUMP_DIAMETERS * principal_diameter(scan.points)
    faces = grid_faces(scan.grid, scan.points, scan.points[:, 2], step, step)
    return RangeScan(name=scan.name, points=scan.points, faces=faces)


# Strangers: of another object, of nothing


def two_of(seed: int, rng: Rng, *, body: str, seeds_on: int = 0) -> list[Shot]:
    """Two scans of another object, from opposite sides: they belong nowhere."""
    shots = _shots_of(body, seed + seeds_on, lambda b, r: ring(b, r, count=2), rng)
    return [replace(shot, world_from_sensor=None, world=1) for shot in shots]


def half_of(seed: int, rng: Rng, *, body: str, views: Views, seeds_on: int = 0) -> list[Shot]:
    """Scans of another object, which belong together in a world of their own."""
    away = far_away(rng)
    shots = _shots_of(body, seed + seeds_on, views, rng)
    return [replace(shot, world_from_sensor=away @ shot.pose, world=1) for shot in shots]


def noise_scan(seed: int, rng: Rng) -> list[Shot]:
    """One scan of nothing but noise in the middle of the image."""
    scan = _shots_of("thing", seed, lambda b, r: ring(b, r, count=1), rng)[0].scan
    depth = depth_of(scan)
    rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]]
    half = 0.5 * np.array(depth.shape)
    disc = np.hypot(rows - half[0], columns - half[1]) < NOISE_RADIUS * min(depth.shape)
    drawn = rng.uniform(np.nanmin(depth), np.nanmax(depth), size=depth.shape)
    noise = with_depth(scan, np.where(disc, drawn, np.nan))
    return [Shot(scan=replace(noise, name="noise"), world_from_sensor=None)]


def far_away(rng: Rng) -> Pose:
    """Where another object's world lies."""
    return Pose(rotation=random_rotation(rng), translation=rng.uniform(500, 1000, size=3))


def _larger(shot: Shot, factor: float) -> Shot:
    """A scan that is too large, where it fits best: its middle lies where it belongs."""
    shift = (1.0 - factor) * shot.scan.points.mean(axis=0)
    pose = shot.pose @ Pose(rotation=np.eye(3), translation=shift)
    larger = replace(shot.scan, points=factor * shot.scan.points)
    return replace(shot, scan=larger, factor=factor, world_from_sensor=pose)


def _shots_of(name: str, seed: int, views: Views, rng: Rng) -> list[Shot]:
    body = make_body(name, seed)
    shots = take_shots(body, views(body, rng), SLIGHT, seed + 1)
    return [shot.named(f"other {shot.scan.name}") for shot in shots]
