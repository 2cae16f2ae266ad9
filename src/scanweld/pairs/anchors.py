"""Where hypotheses are hung: PA-HKS keypoints, evenly spread points, or both."""

import numpy as np

from scanweld.config import PairsConfig
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.heat.features import Features
from scanweld.pairs.field import ScanField
from scanweld.pairs.hypotheses import Anchors

MIN_KEYPOINTS = 12
"""A scan with fewer keypoints than this gets evenly spread points beside them."""


def pair_anchors(
    field: ScanField, features: Features | None, diameter: float, config: PairsConfig
) -> tuple[Anchors, ...]:
    """The sets of anchors of a scan; hypotheses pair the sets of two scans one by one.

    With keypoints alone, a scan that has too few is helped out by evenly spread points.
    """
    even = even_anchors(field, config.anchor_diameters * diameter)
    if config.keypoints == "even" or features is None:
        return (even,)
    heat = Anchors(points=features.points, normals=features.normals)
    if config.keypoints == "mixed":
        return heat, even
    if len(heat.points) < MIN_KEYPOINTS:
        heat = Anchors(
            points=np.concatenate([heat.points, even.points]),
            normals=np.concatenate([heat.normals, even.normals]),
        )
    return (heat,)


def even_anchors(field: ScanField, spacing: float) -> Anchors:
    """Samples of a scan, the first of those that are at least so far apart."""
    chosen = _prefix(field.points, spacing)
    return Anchors(points=field.points[chosen], normals=field.normals[chosen])


def _prefix(points: FloatArray, spacing: float) -> IntArray:
    # Samples come in farthest-point order: the spacing of a prefix falls as it grows.
    distance = np.full(len(points), np.inf)
    for k in range(len(points)):
        if distance[k] < spacing:
            return np.arange(k)
        distance = np.minimum(distance, np.linalg.norm(points - points[k], axis=1))
    return np.arange(len(points))
