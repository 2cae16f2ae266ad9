"""Colours of a fused mesh, blended from the scans that saw each vertex."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from scanweld.fusion.posed_image import PosedImage, look_up
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.prepared import PreparedScan

_NUM_NEIGHBOURS = 3
_UNSEEN = 128.0
"""Grey of a mesh where scans have colours but none reaches it."""


def blend_colors(
    vertices: FloatArray,
    normals: FloatArray,
    scans: Sequence[PreparedScan],
    images: Sequence[PosedImage],
    reach: float,
) -> ByteArray | None:
    """Colours (V, 3) of vertices (V, 3) with unit normals (V, 3); None if no scan has colours.

    A scan's colour at a vertex is that of its nearest points; scans weigh as they do in the volume.
    Vertices that no scan with colours saw get the colour of the nearest vertex that has one.

    Args:
        vertices: World frame.
        normals: Unit, pointing out.
        scans: With or without colours.
        images: The scans' range images at their poses.
        reach: How far from a vertex a scan's points may lie, in the scans' unit.
    """
    if all(scan.scan.colors is None for scan in scans):
        return None
    total, weight = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    for scan, image in zip(scans, images, strict=True):
        if scan.scan.colors is None:
            continue
        world_from_scan = (scan.scan_from_sensor @ image.sensor_from_world).inverse()
        points = world_from_scan.apply(scan.scan.points)
        color, share = _nearest_colors(points, scan.scan.colors, vertices, reach)
        share *= _weights_of(image, vertices, normals)
        total += share[:, None] * color
        weight += share
    has_color = weight > 0
    color = np.full((len(vertices), 3), _UNSEEN)
    color[has_color] = total[has_color] / weight[has_color, None]
    if has_color.any() and not has_color.all():
        _, nearest = KDTree(vertices[has_color]).query(vertices[~has_color])
        color[~has_color] = color[has_color][nearest]
    return np.clip(np.rint(color), 0, 255).astype(np.uint8)


def _nearest_colors(
    points: FloatArray, colors: ByteArray, vertices: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Colours (V, 3) of the points nearest to vertices, and 1 where there are any, else 0."""
    tree = KDTree(points)
    distance, index = tree.query(vertices, k=_NUM_NEIGHBOURS, distance_upper_bound=reach)
    near = np.isfinite(distance)
    share = np.where(near, 1.0 / (np.where(near, distance, 0.0) + 0.1 * reach), 0.0)
    nearest = colors[np.where(near, index, 0)].astype(np.float64)
    total = share.sum(axis=1)
    blended = np.einsum("vk,vkc->vc", share, nearest) / np.where(total > 0, total, 1.0)[:, None]
    return blended, (total > 0).astype(np.float64)


def _weights_of(image: PosedImage, vertices: FloatArray, normals: FloatArray) -> FloatArray:
    """Weights (V,) of an image's pixels at vertices, times the cosine of their own incidence."""
    seen = image.sensor_from_world.apply(vertices)
    weight = look_up(image.weight, image.camera, seen)
    rays = image.camera.view_directions(seen)
    cosine = -np.einsum("vk,vk->v", image.sensor_from_world.turn(normals), rays)
    return weight * np.maximum(cosine, 0.0)
