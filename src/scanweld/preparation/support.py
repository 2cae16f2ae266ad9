"""The table or turntable that an object stands on: a plane around it, with the object above it.

A plane does not show how the object is turned on it, and after the object has been laid on another
side the plane has moved relative to it. So the plane is removed before scans are registered.
"""

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.gauss_newton import SIGNIFICANT_SIGMAS
from scanweld.geometry.sampling import NUM_FEW
from scanweld.geometry.scan import principal_diameter

NUM_DRAWS = 300
"""Planes through three points that are tried."""
FLAT_SPACINGS = 1.5
"""Distance from a plane, in point spacings, up to which a point lies in it."""
MIN_SHARE = 0.15
"""Least share of the points that lie in the plane or below it."""
MIN_ABOVE, MAX_BELOW = 0.03, 0.3
"""Least share of all points that lie above the plane; most below it, as a share of those above."""
MIN_HEIGHT = 0.15
"""Least height of what stands on the plane, in its own diameters: a lower one is a relief, of one
piece with the plane."""
NUM_SECTORS, MIN_SECTORS = 12, 8
"""Sectors around the object, and the number of them in which the plane must be seen."""
REACH = 0.6
"""Distance from the object's middle to which the plane must reach in a sector to count as seen
there, as a share of the object's own reach."""


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
    num_below = int((height < -reach).sum())
    if (
        is_above.mean() < MIN_ABOVE
        or num_below > MAX_BELOW * is_above.sum()
        or (~is_above).mean() < MIN_SHARE
        or np.quantile(height[is_above], 0.95) < MIN_HEIGHT * principal_diameter(points[is_above])
        or not _surrounds(points[~is_above], points[is_above], normal)
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
    if counts[best] < MIN_SHARE * len(tried):
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
        sector = ((np.arctan2(flat[:, 1], flat[:, 0]) / (2 * np.pi) + 0.5) * NUM_SECTORS).astype(
            np.int64
        )
        reach = np.zeros(NUM_SECTORS)
        np.maximum.at(reach, np.minimum(sector, NUM_SECTORS - 1), np.linalg.norm(flat, axis=1))
        sides.append(reach)
    return int((sides[0] >= REACH * sides[1]).sum()) >= MIN_SECTORS
