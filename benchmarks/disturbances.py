"""What happens to scans on their way into a file: errors, crops, other formats, strangers."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import ndimage

from bodies import make_body
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.grid import grid_faces
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter
from shots import SLIGHT, Rng, Shot, ring, take_shots

JUMP_DIAMETERS = 0.03
"""Depth step that counts as a jump between two surfaces."""

Disturbance = Callable[[list[Shot], Rng], list[Shot]]


def each(change: Callable[[RangeScan, Rng], RangeScan]) -> Disturbance:
    """A change that happens to every scan."""
    return lambda shots, rng: [replace(shot, scan=change(shot.scan, rng)) for shot in shots]


def outlier_points(share: float) -> Disturbance:
    """Pixels whose depth is drawn anew from a wider range than the object's."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        depth = _depth(scan)
        seen = np.isfinite(depth)
        low, high = depth[seen].min(), depth[seen].max()
        slack = 0.2 * (high - low)
        hit = seen & (rng.random(depth.shape) < share)
        depth[hit] = rng.uniform(low - slack, high + slack, size=int(hit.sum()))
        return _with_depth(scan, depth)

    return each(change)


def flying_pixels() -> Disturbance:
    """Pixels beside a jump, and beside the silhouette, measured somewhere in between."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        depth = _depth(scan)
        size = principal_diameter(scan.points)
        behind = np.where(np.isfinite(depth), depth, np.nanmax(depth) + 0.3 * size)
        far = ndimage.maximum_filter(behind, size=3)
        near = ndimage.minimum_filter(np.where(np.isfinite(depth), depth, np.inf), size=3)
        beside = far - np.where(np.isfinite(near), near, far) > JUMP_DIAMETERS * size
        chosen = beside & (rng.random(depth.shape) < 0.6)
        part = rng.random(int(chosen.sum()))
        depth[chosen] = near[chosen] + part * (far - near)[chosen]
        return _with_depth(scan, depth)

    return each(change)


def crop_to_ball(radius_diameters: float) -> Disturbance:
    """Only what lies within a ball about one place of the object is kept, as users crop."""

    def crop(shots: list[Shot], rng: Rng) -> list[Shot]:
        first = shots[0]
        assert first.world_from_sensor is not None
        size = principal_diameter(first.scan.points)
        spot = first.world_from_sensor.apply(
            first.scan.points[rng.integers(len(first.scan.points))]
        )
        kept = []
        for shot in shots:
            assert shot.world_from_sensor is not None
            away = shot.world_from_sensor.apply(shot.scan.points) - spot
            is_near = np.linalg.norm(away, axis=1) < radius_diameters * size
            kept.append(replace(shot, scan=shot.scan.only(is_near)))
        return kept

    return crop


def crop_to_window(share: float) -> Disturbance:
    """The sensor's image is smaller than the object: a window of it, somewhere else each time."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        assert scan.camera is not None and scan.grid is not None
        rows, columns = (np.flatnonzero((scan.grid >= 0).any(axis=a)) for a in (1, 0))
        spans = []
        for line in (rows, columns):
            length = int(share * len(line))
            start = int(line[0] + rng.integers(len(line) - length + 1))
            spans.append(slice(start, start + length))
        grid = scan.grid[spans[0], spans[1]]
        camera = replace(
            scan.camera,
            width=grid.shape[1],
            height=grid.shape[0],
            cx=scan.camera.cx - spans[1].start,
            cy=scan.camera.cy - spans[0].start,
        )
        kept = np.zeros(len(scan.points), dtype=bool)
        kept[grid[grid >= 0]] = True
        windowed = replace(scan, grid=grid).only(kept)
        return replace(windowed, camera=camera)

    return each(change)


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


def scaled(factor: float) -> Disturbance:
    """The first scan is too large."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        scan = shots[0].scan
        middle = scan.points.mean(axis=0)
        larger = replace(
            scan,
            name=f"{scan.name} scaled",
            points=middle + factor * (scan.points - middle),
            camera=None,
            scan_from_sensor=None,
            viewpoint=Viewpoint.UNKNOWN,
        )
        return [replace(shots[0], scan=larger), *shots[1:]]

    return change


def mirrored() -> Disturbance:
    """The first scan has left-handed axes, as from a file with one axis the other way."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        scan = shots[0].scan
        other = RangeScan(
            name=f"{scan.name} mirrored",
            points=scan.points * np.array([-1.0, 1.0, 1.0]),
            grid=None if scan.grid is None else scan.grid[:, ::-1],
        )
        return [Shot(scan=other, world_from_sensor=None), *shots[1:]]

    return change


def with_noise_scan() -> Disturbance:
    """One scan more, of nothing but noise in the middle of the image."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        scan = shots[0].scan
        depth = _depth(scan)
        low, high = np.nanmin(depth), np.nanmax(depth)
        rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]]
        half = 0.5 * np.array(depth.shape)
        disc = np.hypot(rows - half[0], columns - half[1]) < 0.35 * min(depth.shape)
        noise = np.where(disc, rng.uniform(low, high, size=depth.shape), np.nan)
        added = replace(_with_depth(scan, noise), name="noise")
        return [*shots, Shot(scan=added, world_from_sensor=None)]

    return change


def with_other(body: str, count: int, seed: int, *, keep: int | None = None) -> Disturbance:
    """Scans of another object besides, in a world of its own; of the first only some are kept."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        other = make_body(body, seed, None)
        others = take_shots(other, ring(count), SLIGHT, seed, f"other {body}")
        away = Pose(rotation=random_rotation(rng), translation=rng.uniform(500, 1000, size=3))
        moved = []
        for shot in others:
            assert shot.world_from_sensor is not None
            moved.append(replace(shot, world_from_sensor=away @ shot.world_from_sensor))
        return [*shots[:keep], *moved]

    return change


def again(count: int) -> Disturbance:
    """Some of the scans a second time, in other frames."""
    return lambda shots, rng: [
        *shots,
        *(replace(s, scan=replace(s.scan, name=f"{s.scan.name} again")) for s in shots[:count]),
    ]


def _depth(scan: RangeScan) -> FloatArray:
    """Depth (H, W) of a scan in its sensor's frame, NaN where nothing was seen."""
    assert scan.grid is not None
    return np.where(scan.grid >= 0, scan.points[scan.grid, 2], np.nan)


def _with_depth(scan: RangeScan, depth: FloatArray) -> RangeScan:
    """The scan with other depths (H, W), NaN for none."""
    assert scan.camera is not None
    seen = np.isfinite(depth)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[seen] = np.arange(int(seen.sum()))
    points = scan.camera.unproject_image(depth)[seen]
    return replace(scan, points=points, grid=grid, colors=None)
