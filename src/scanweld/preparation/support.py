"""The table or turntable that an object stands on: a plane around it, with the object above it.

A plane does not show how the object is turned on it, and after the object has been laid on another
side the plane has moved relative to it. So the plane is removed before scans are registered.
"""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.gauss_newton import SIGNIFICANT_SIGMAS
from scanweld.geometry.sampling import NUM_FEW
from scanweld.geometry.scan import principal_diameter

NUM_DRAWS = 300
"""Planes through three points that are tried."""
FLAT_SPACINGS = 1.5
"""Distance from a plane, in point spacings, up to which a point lies in it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SupportRule:
    """What a plane must show to be what the object stands on.

    Attributes:
        min_share: Least share of the points that lie in the plane or below it.
        min_above: Least share of all points that lie above the plane.
        max_below: Most that lie below it, as a share of those above.
        min_height: Least height of what stands on it, in its own diameters: a lower one is a
            relief, of one piece with the plane.
        num_sectors: Sectors around the object.
        min_sectors: Those in which the plane must be seen.
        reach: Distance from the object's middle to which the plane must reach in a sector to count
            as seen there, as a share of the object's own reach.
    """

    min_share: float = 0.15
    min_above: float = 0.03
    max_below: float = 0.3
    min_height: float = 0.15
    num_sectors: int = 12
    min_sectors: int = 8
    reach: float = 0.6


RULE = SupportRule()


def find_support(points: FloatArray, spacing: float) -> BoolArray | None:
    """Points of the plane that an object stands on, and of what is below it.

    Args:
        points: (N, 3), sensor frame.
        spacing: Of the points.

    Returns:
        (N,) which points belong to it, or None where there is no such plane.
    """
    plane = _main_plane(points, FLAT_SPACINGS * spacing)
    if plane is None:
        return None
    normal, offset = plane
    height = points @ normal - offset
    within = np.abs(height) <= FLAT_SPACINGS * spacing
    deviation = float(np.sqrt(np.mean(height[within] ** 2)))
    reach = max(FLAT_SPACINGS * spacing, SIGNIFICANT_SIGMAS * deviation)
    is_above = height > reach
    above = points[is_above]
    num_below = int((height < -reach).sum())
    if (
        is_above.mean() < RULE.min_above
        or num_below > RULE.max_below * is_above.sum()
        or (~is_above).mean() < RULE.min_share
        or np.quantile(height[is_above], 0.95) < RULE.min_height * principal_diameter(above)
        or not _surrounds(points[~is_above], above, normal)
    ):
        return None
    return ~is_above


def _main_plane(points: FloatArray, reach: float) -> tuple[FloatArray, float] | None:
    """Unit normal, towards the sensor, and offset of the plane that holds most points."""
    rng = np.random.default_rng(0)
    tried = points[rng.permutation(len(points))[:NUM_FEW]]
    a, b, c = (tried[rng.integers(len(tried), size=NUM_DRAWS)] for _ in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    real = length > 0
    if not real.any():
        return None
    normals = normals[real] / length[real, None]
    offsets = (normals * a[real]).sum(axis=1)
    counts = (np.abs(tried @ normals.T - offsets) <= reach).sum(axis=0)
    best = int(np.argmax(counts))
    if counts[best] < RULE.min_share * len(tried):
        return None
    normal, offset = normals[best], float(offsets[best])
    for _ in range(3):
        held = tried[np.abs(tried @ normal - offset) <= reach]
        middle = held.mean(axis=0)
        normal = np.linalg.svd(held - middle, full_matrices=False)[2][2]
        offset = float(normal @ middle)
    return (normal, offset) if normal[2] < 0 else (-normal, -offset)


def _surrounds(plane: FloatArray, above: FloatArray, normal: FloatArray) -> bool:
    """Whether the plane's points are seen beyond what stands on it, on most sides."""
    across = np.linalg.svd(normal[None])[2][1:].T
    middle = (above @ across).mean(axis=0)
    sides = []
    for points in (plane, above):
        flat = points @ across - middle
        turn = np.arctan2(flat[:, 1], flat[:, 0]) / (2 * np.pi) + 0.5
        sector = (turn * RULE.num_sectors).astype(np.int64)
        reach = np.zeros(RULE.num_sectors)
        np.maximum.at(reach, np.minimum(sector, RULE.num_sectors - 1), np.linalg.norm(flat, axis=1))
        sides.append(reach)
    return int((sides[0] >= RULE.reach * sides[1]).sum()) >= RULE.min_sectors
