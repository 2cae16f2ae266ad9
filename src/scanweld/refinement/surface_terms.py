"""Point-to-plane matches between range images: the closest surface point, found in the image."""

from dataclasses import dataclass

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.matches import MIN_AGREEMENT, Matches
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind, PreparedScan

MIN_COSINE = 0.2
"""Cosine of incidence below which pixels are not matched: range is poor there."""
NUM_WALKS = 3
"""Projections of the point's foot on the plane; each brings it closer to the closest point."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SurfaceSource:
    """What point-to-plane matching needs of a scan, in its sensor frame.

    Attributes:
        points: (N, 3) surface points spread evenly by area, away from rims.
        normals: (N, 3) their unit normals.
        camera: (5,) the camera's parameters.
        depth: (H, W) depths, NaN off the surface.
        stretch: Depths are this many times what stands there.
        image_normals: (H, W, 3) unit normals.
        is_usable: (H, W) pixels that may be matched: surface, off the rim, not grazing.
    """

    points: FloatArray
    normals: FloatArray
    camera: FloatArray
    depth: FloatArray
    image_normals: FloatArray
    is_usable: BoolArray
    stretch: float = 1.0


def surface_source(scan: PreparedScan, num_points: int) -> SurfaceSource:
    """Thin the range image of a scan to points for matching, evenly by area.

    Args:
        scan: A prepared scan.
        num_points: How many are kept, at most.
    """
    image = scan.image
    points = image.points()
    view = image.camera.view_directions(points)
    cosine = -np.einsum("hwk,hwk->hw", view, image.normals)
    is_usable = (image.kind == PixelKind.SURFACE) & ~image.is_rim & (cosine > MIN_COSINE)
    chosen = _even_by_area(1.0 / cosine[is_usable], num_points)
    return SurfaceSource(
        points=points[is_usable][chosen],
        normals=image.normals[is_usable][chosen],
        camera=image.camera.parameters,
        depth=image.depth,
        image_normals=image.normals,
        is_usable=is_usable,
    )


def surface_matches(i: SurfaceSource, j: SurfaceSource, j_from_i: Pose, radius: float) -> Matches:
    """Match the points of i to the closest surface points of j, point to plane.

    Refused are matches farther than the radius, with normals that disagree, on j's rim, and
    those whose closest point j's image does not show.

    Args:
        i: The scan whose points are matched.
        j: The scan they are matched to.
        j_from_i: The pose, between the sensor frames.
        radius: Farthest match, in the scans' unit.

    Returns:
        Matches in the sensor frame of j.
    """
    points = j_from_i.apply(i.points)
    directions, residuals = np.empty_like(points), np.empty(len(points))
    found = _closest_planes(
        points,
        i.normals,
        j_from_i.rotation,
        j.camera,
        j.depth,
        j.stretch,
        j.image_normals,
        j.is_usable,
        radius,
        directions,
        residuals,
    )
    return Matches(
        points=points[:found], directions=directions[:found], residuals=residuals[:found]
    )


def _even_by_area(areas: FloatArray, num_points: int) -> IntArray:
    """Indices at equal steps of the summed area."""
    if len(areas) <= num_points:
        return np.arange(len(areas))
    summed = np.cumsum(areas)
    steps = (np.arange(num_points) + 0.5) * (summed[-1] / num_points)
    return np.unique(np.searchsorted(summed, steps))


@njit(cache=True, nogil=True)
def _closest_planes(  # pragma: no cover
    points: FloatArray,
    normals: FloatArray,
    j_from_i: FloatArray,
    camera: FloatArray,
    depth: FloatArray,
    stretch: float,
    image_normals: FloatArray,
    is_usable: BoolArray,
    radius: float,
    directions: FloatArray,
    residuals: FloatArray,
) -> int:
    """Walk: project the point, drop its foot on the plane seen there, project the foot, ...

    What matches is moved to the front of the points (in j's frame; normals are in i's), with its
    directions and residuals; their number is given back.
    """
    height, width = depth.shape
    is_pinhole = camera[0] == 0.0
    r, found = j_from_i, 0
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        fx, fy, fz = x, y, z
        qx = qy = qz = a = b = c = 0.0
        distance = np.nan
        row, column = -1, -1
        for _ in range(NUM_WALKS):
            if is_pinhole and fz <= 0.0:
                distance = np.nan
                break
            scale = fz if is_pinhole else 1.0
            u = int(np.floor(camera[1] * fx / scale + camera[3] + 0.5))
            v = int(np.floor(camera[2] * fy / scale + camera[4] + 0.5))
            if u < 0 or v < 0 or u >= width or v >= height or not is_usable[v, u]:
                distance = np.nan
                break
            if v == row and u == column:  # all further walks end here
                break
            row, column = v, u
            qz = stretch * depth[v, u]
            scale = qz if is_pinhole else 1.0
            qx = (u - camera[3]) / camera[1] * scale
            qy = (v - camera[4]) / camera[2] * scale
            a, b, c = image_normals[v, u, 0], image_normals[v, u, 1], image_normals[v, u, 2]
            distance = a * (x - qx) + b * (y - qy) + c * (z - qz)
            fx, fy, fz = x - distance * a, y - distance * b, z - distance * c
        if np.isnan(distance):
            continue
        if not (x - qx) ** 2 + (y - qy) ** 2 + (z - qz) ** 2 <= radius * radius:
            continue
        p, q, s = normals[n, 0], normals[n, 1], normals[n, 2]
        agreement = a * (r[0, 0] * p + r[0, 1] * q + r[0, 2] * s)
        agreement += b * (r[1, 0] * p + r[1, 1] * q + r[1, 2] * s)
        agreement += c * (r[2, 0] * p + r[2, 1] * q + r[2, 2] * s)
        if agreement >= MIN_AGREEMENT:
            points[found, 0], points[found, 1], points[found, 2] = x, y, z
            directions[found, 0], directions[found, 1], directions[found, 2] = a, b, c
            residuals[found] = distance
            found += 1
    return found
