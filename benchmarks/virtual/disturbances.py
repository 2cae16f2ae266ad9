"""What happens to scans on their way into a file: errors, scale, mirroring, copies."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import ndimage

from benchmarks.virtual.shots import Rng, Shot
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, principal_diameter

JUMP_DIAMETERS = 0.03
"""Depth step that counts as a jump between two surfaces."""
FLYING_SHARE = 0.6
"""Share of the pixels beside a jump that are measured in between."""

Disturbance = Callable[[list[Shot], Rng], list[Shot]]


def each(change: Callable[[RangeScan, Rng], RangeScan]) -> Disturbance:
    """A change that happens to every scan."""
    return lambda shots, rng: [replace(shot, scan=change(shot.scan, rng)) for shot in shots]


def outlier_points(share: float) -> Disturbance:
    """Pixels whose depth is drawn anew from a wider range than the object's."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        depth = depth_of(scan)
        seen = np.isfinite(depth)
        low, high = depth[seen].min(), depth[seen].max()
        slack = 0.2 * (high - low)
        hit = seen & (rng.random(depth.shape) < share)
        depth[hit] = rng.uniform(low - slack, high + slack, size=int(hit.sum()))
        return with_depth(scan, depth)

    return each(change)


def flying_pixels() -> Disturbance:
    """Pixels beside a jump, and beside the silhouette, measured somewhere in between."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        depth = depth_of(scan)
        size = principal_diameter(scan.points)
        seen = np.isfinite(depth)
        # A lost return is a gap in the surface, not a look past it.
        is_past = np.logical_not(ndimage.binary_closing(seen, np.ones((3, 3))))
        behind = np.where(seen, depth, np.where(is_past, np.nanmax(depth) + 0.3 * size, -np.inf))
        far = ndimage.maximum_filter(behind, size=3)
        near = ndimage.minimum_filter(np.where(seen, depth, np.inf), size=3)
        beside = np.isfinite(near) & (far - near > JUMP_DIAMETERS * size)
        chosen = beside & (rng.random(depth.shape) < FLYING_SHARE)
        part = rng.random(int(chosen.sum()))
        depth[chosen] = near[chosen] + part * (far - near)[chosen]
        return with_depth(scan, depth)

    return each(change)


def scaled(factor: float) -> Disturbance:
    """The first scan is too large, as from a sensor whose ranges are all too long."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        shot = shots[0]
        assert shot.world_from_sensor is not None
        middle = shot.scan.points.mean(axis=0)
        larger = replace(
            shot.scan, name=f"{shot.scan.name} scaled", points=factor * shot.scan.points
        )
        # Where it fits best, its middle comes to lie where it belongs.
        back = Pose(rotation=np.eye(3), translation=(1.0 - factor) * middle)
        moved = replace(
            shot, scan=larger, factor=factor, world_from_sensor=shot.world_from_sensor @ back
        )
        return [moved, *shots[1:]]

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


def again(count: int) -> Disturbance:
    """Some of the scans a second time, in other frames."""
    return lambda shots, rng: [
        *shots,
        *(replace(s, scan=replace(s.scan, name=f"{s.scan.name} again")) for s in shots[:count]),
    ]


def depth_of(scan: RangeScan) -> FloatArray:
    """Depth (H, W) of a scan in its sensor's frame, NaN where nothing was seen."""
    assert scan.grid is not None
    return np.where(scan.grid >= 0, scan.points[scan.grid, 2], np.nan)


def with_depth(scan: RangeScan, depth: FloatArray) -> RangeScan:
    """The scan with other depths (H, W), NaN for none."""
    assert scan.camera is not None
    seen = np.isfinite(depth)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[seen] = np.arange(int(seen.sum()))
    points = scan.camera.unproject_image(depth)[seen]
    return replace(scan, points=points, grid=grid, colors=None)
