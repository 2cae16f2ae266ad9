"""Coarse registration as published (paper 3.1): matched PA-HKS keypoints, then ICP."""

from dataclasses import dataclass

import numpy as np

from scanweld.config import CoarseConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.point_fit import rigid_fit
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import Features
from scanweld.heat.matching import match_signatures
from scanweld.pairs.point_icp import PointAlignment, point_icp

MIN_MATCHES = 3
"""Fewer matched keypoints hold no pose."""
MIN_BREADTH_DIAMETERS = 0.02
"""Matched keypoints that lie on a line to within this, root mean square, hold no pose either."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CoarseAnswer:
    """What the coarse step says of two scans.

    Attributes:
        i_from_j: The pose between the sensor frames; None if there is none.
        num_matches: Keypoints of i that have a correspondence in j.
        rms: Of the distances that the ICP ended with, in the scans' unit; NaN without a pose.
        reason: Why there is no pose; empty if there is one.
    """

    i_from_j: Pose | None
    num_matches: int
    rms: float
    reason: str


def register_as_published(
    i: PreparedScan,
    j: PreparedScan,
    features_i: Features,
    features_j: Features,
    config: CoarseConfig,
) -> CoarseAnswer:
    """Match the keypoints of two scans by their signatures, fit, and go on by ICP.

    The paper has the correspondences "initialise" an ICP of the keypoints and leaves open on what
    it runs; the readings are options.

    Args:
        i: First scan.
        j: Second scan.
        features_i: Keypoints of i; S of eq. 1.
        features_j: Keypoints of j; T of eq. 1.
        config: The reading.
    """
    matches = match_signatures(
        features_i.signatures,
        features_j.signatures,
        max_distance=config.max_signature_distance,
        quantile=config.signature_quantile,
        mutual=config.mutual,
    )
    points_i, points_j = features_i.points[matches.s], features_j.points[matches.t]
    if len(matches) < MIN_MATCHES:
        return _no_pose(len(matches), f"{len(matches)} matched keypoints, 3 are needed")
    breadth = min(_breadth(points_i) / i.diameter, _breadth(points_j) / j.diameter)
    if breadth < MIN_BREADTH_DIAMETERS:
        return _no_pose(len(matches), "the matched keypoints lie on a line")
    start = rigid_fit(points_j, points_i)
    found = _icp(i, j, points_i, points_j, start, config)
    return CoarseAnswer(
        i_from_j=found.target_from_source, num_matches=len(matches), rms=found.rms, reason=""
    )


def _icp(
    i: PreparedScan,
    j: PreparedScan,
    points_i: FloatArray,
    points_j: FloatArray,
    start: Pose,
    config: CoarseConfig,
) -> PointAlignment:
    """ICP of j onto i: of the keypoints that have a correspondence, or of the surfaces."""
    if config.icp == "keypoints":
        once_i, once_j = np.unique(points_i, axis=0), np.unique(points_j, axis=0)
        return point_icp(once_j, once_i, start, config.trim)
    return point_icp(j.samples.points, i.mesh.vertices, start, config.trim)


def _breadth(points: FloatArray) -> float:
    """Root mean square distance of points (N, 3) from their best line."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(np.linalg.norm(spread[1:]) / np.sqrt(len(points)))


def _no_pose(num_matches: int, reason: str) -> CoarseAnswer:
    return CoarseAnswer(i_from_j=None, num_matches=num_matches, rms=float("nan"), reason=reason)
