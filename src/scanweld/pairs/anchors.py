"""Where hypotheses are hung: PA-HKS keypoints, evenly spread points, or both."""

import numpy as np

from scanweld.config import PairsConfig
from scanweld.evidence.field import ScanField
from scanweld.heat.features import Features
from scanweld.pairs.hypotheses import Anchors

MIN_KEYPOINTS = 12
"""A scan with fewer keypoints than this gets evenly spread points beside them."""


def pair_anchors(
    field: ScanField, features: Features | None, config: PairsConfig
) -> tuple[Anchors, ...]:
    """The sets of anchors of a scan; hypotheses pair the sets of two scans one by one.

    With keypoints alone, a scan that has too few is helped out by evenly spread points.
    """
    even = even_anchors(field, config.num_anchors)
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


def even_anchors(field: ScanField, number: int) -> Anchors:
    """The first samples of a scan, which come in farthest-point order: they are spread evenly."""
    return Anchors(points=field.points[:number], normals=field.normals[:number])
