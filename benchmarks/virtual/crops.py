"""Scans cut down to a part of the object, so that what was cut away is not free space."""

from dataclasses import replace

import numpy as np

from benchmarks.virtual.disturbances import Disturbance, each
from benchmarks.virtual.shots import Rng, Shot
from scanweld.geometry.scan import RangeScan, principal_diameter


def crop_to_ball(radius_diameters: float) -> Disturbance:
    """Only what lies within a ball about one place of the object is kept, in all scans."""

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


def crop_above(share: float) -> Disturbance:
    """The lower part of the object is cut off at one height in all scans, as with a stand."""

    def crop(shots: list[Shot], rng: Rng) -> list[Shot]:
        heights = [
            shot.world_from_sensor.apply(shot.scan.points)[:, 2]
            for shot in shots
            if shot.world_from_sensor is not None
        ]
        cut = float(np.quantile(np.concatenate(heights), 1.0 - share))
        return [
            replace(shot, scan=shot.scan.only(height > cut))
            for shot, height in zip(shots, heights, strict=True)
        ]

    return crop


def crop_by_hand(share: float) -> Disturbance:
    """In every scan another side of what it shows is cut off along a line across the image."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        angle = rng.uniform(0, 2 * np.pi)
        along = scan.points[:, :2] @ np.array([np.cos(angle), np.sin(angle)])
        return scan.only(along < np.quantile(along, share))

    return each(change)


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
