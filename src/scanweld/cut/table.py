"""The planes that a moving object stands on, where a camera that stands still sees them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scanweld.cut.smoothing import LEAST_NOISE, smooth_field, trimmed_rms
from scanweld.cut.standing import LEFT_SHARE_OF_DEPTH, SURE_SIGMAS, Standing
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.gauss_newton import NEARLY_ALL_SIGMAS

NUM_SEEDS, NUM_TRIED = 24, 3000
"""Triangles across the image each of which gives a plane, and points that these are tried on."""
MIN_SHARE = 0.01
"""Least share of the settled pixels that lie in a plane."""
MIN_TABLE_SHARE = 0.05
"""The same of the plane that the object stands on."""
MAX_PLANES = 5
"""Planes that are looked at, at most: a table, a turntable's disc, a sheet of paper, walls."""
PARALLEL = 0.985
"""Cosine of the angle, 10 degrees, up to which other planes are parallel to the table."""
MAX_LIFT = 0.5
"""Height of the lowest parts that move above the plane, as a share of that of the highest, up to
which the object stands on it: its foot may look the same from all sides, and then not move."""
NUM_ROUNDS = 3
"""Rounds in which the table's bend is fitted, each to what lay in it before."""
LOWEST = 0.02
"""Quantile that stands for the lowest, and share of what moved that may lie below the plane."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Plane:
    """A plane in the camera's frame, with its normal towards the camera.

    Attributes:
        normal: (3,) unit.
        offset: Of its points along the normal.
    """

    normal: FloatArray
    offset: float

    def height(self, points: FloatArray) -> FloatArray:
        """Distance of points (..., 3), positive on the camera's side."""
        return points @ self.normal - self.offset


def supporting_planes(standing: Standing, moving: FloatArray, camera: Camera) -> list[Plane]:
    """Flat parts of what stands still that a moving object stands on, parallel to each other.

    Args:
        standing: What stands still.
        moving: (N, 3) points that moved.
        camera: Of the frames.
    """
    points = camera.unproject_image(standing.usual)
    free = standing.is_settled & np.isfinite(standing.usual)
    rest, found = free.copy(), []
    while len(found) < MAX_PLANES:
        plane = _largest_plane(points, rest, standing)
        if plane is None:
            break
        within = np.abs(plane.height(points)) <= plane_reach(plane, points, standing)
        share = float((within & rest).sum() / free.sum())
        if share < MIN_SHARE:
            break
        found.append((plane, share, _lift(plane, moving, standing)))
        rest &= ~within
    carrying = [(plane, lift) for plane, share, lift in found if share >= MIN_TABLE_SHARE]
    table, lift = min(carrying, key=lambda each: each[1], default=(None, np.inf))
    if table is None or lift > MAX_LIFT:
        return []
    return [
        plane
        for plane, _, lift in found
        if lift <= MAX_LIFT and plane.normal @ table.normal >= PARALLEL
    ]


def above(
    depth: FloatArray, moved: BoolArray, planes: Sequence[Plane], standing: Standing, camera: Camera
) -> BoolArray:
    """Pixels (H, W) of a frame that lie above all planes, as that frame bends them.

    Args:
        depth: (H, W) of the frame.
        moved: (H, W) pixels that show something that moved: no plane.
        planes: What the object stands on.
        standing: What stands still.
        camera: Of the frames.
    """
    points = camera.unproject_image(depth)
    is_above = np.isfinite(depth)
    for plane in planes:
        height = plane.height(points)
        sigma = _sigma(plane, points, standing)
        least = LEAST_NOISE * np.abs(points @ plane.normal)
        flat = ~moved & (np.abs(height) <= plane_reach(plane, points, standing))
        is_used, over = flat, height / sigma
        for _ in range(NUM_ROUNDS if flat.any() else 0):
            off = height - smooth_field(height, is_used)
            over = off / np.maximum(trimmed_rms((off / sigma)[is_used]) * sigma, least)
            is_used = flat & (np.abs(over) <= NEARLY_ALL_SIGMAS)
        is_above &= over > NEARLY_ALL_SIGMAS  # single pixels beyond make no piece
    return is_above


def plane_reach(plane: Plane, points: FloatArray, standing: Standing) -> FloatArray:
    """Height (...) up to which points (..., 3) may be the plane's, bent and noisy."""
    bend = LEFT_SHARE_OF_DEPTH * np.abs(points @ plane.normal)
    return 2 * bend + SURE_SIGMAS * _sigma(plane, points, standing)


def _sigma(plane: Plane, points: FloatArray, standing: Standing) -> FloatArray:
    """Noise of the height (...) of points (..., 3): depth errs along their rays."""
    z = points[..., 2]
    return standing.noise.at(z) * np.abs(points @ plane.normal) / z


def _largest_plane(points: FloatArray, is_free: BoolArray, standing: Standing) -> Plane | None:
    """The plane that holds most of some pixels (H, W) of points (H, W, 3)."""
    fits = np.logical_and.reduce(_corners(is_free))
    tried = points[is_free]
    tried = tried[:: max(1, len(tried) // NUM_TRIED)]
    best, most = None, 0
    for a, b, c in zip(*(corner[fits] for corner in _corners(points)), strict=True):
        plane = _plane_through(np.cross(b - a, c - a), a)
        if plane is None:
            continue
        count = int((np.abs(plane.height(tried)) <= plane_reach(plane, tried, standing)).sum())
        if count > most:
            best, most = plane, count
    if best is None:
        return None
    for closer in (1.0, 0.5, 0.25):
        reach = closer * plane_reach(best, tried, standing)
        held = tried[np.abs(best.height(tried)) <= reach]
        if len(held) < 3:
            return None
        middle = held.mean(axis=0)
        normal = np.linalg.svd(held - middle, full_matrices=False)[2][2]
        best = _plane_through(normal, middle) or best
    return best


def _corners(image: np.ndarray[Any, Any]) -> list[np.ndarray[Any, Any]]:
    """An image's values at the right-angled corners of triangles all over it."""
    step = max(2, image.shape[1] // NUM_SEEDS)
    thin = np.s_[:: step // 2, :: step // 2]
    parts = image[:-step, :-step], image[:-step, step:], image[step:, :-step]
    return [part[thin] for part in parts]


def _plane_through(normal: FloatArray, point: FloatArray) -> Plane | None:
    length = float(np.linalg.norm(normal))
    if not length > 0:
        return None
    normal = normal / length
    offset = float(normal @ point)
    return (
        Plane(normal=-normal, offset=-offset) if offset > 0 else Plane(normal=normal, offset=offset)
    )


def _lift(plane: Plane, moving: FloatArray, standing: Standing) -> float:
    """How high the lowest of what moved lies above a plane, over how high the highest does.

    It is infinite where something moved below the plane.
    """
    height, reach = plane.height(moving), plane_reach(plane, moving, standing)
    low, high = np.quantile(height, [LOWEST, 1 - LOWEST])
    if high <= 0 or (height < -reach).mean() > LOWEST:
        return np.inf
    return float(low / high)
