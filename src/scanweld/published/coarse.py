"""Coarse registration as published (paper 3.1): matched PA-HKS keypoints, then ICP."""

from dataclasses import dataclass

import numpy as np

from scanweld.config import CoarseConfig, PairsConfig
from scanweld.evidence.field import make_field
from scanweld.evidence.visibility import pose_rows
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.point_fit import rigid_fit
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import Features
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.hypotheses import Anchors, sweep
from scanweld.pairs.problem import to_pose
from scanweld.pairs.search import same_hypothesis, score_poses
from scanweld.published.consensus import MAX_POSES, agreed_pose
from scanweld.published.point_icp import MIN_POINTS, PointAlignment, point_icp
from scanweld.published.signature_matching import match_signatures

MIN_BREADTH_DIAMETERS = 0.02
"""Matched keypoints that lie on a line to within this, root mean square, hold no pose either."""


@dataclass(frozen=True, kw_only=True, slots=True)
class _EvidenceSearch:
    """How start poses are searched where the evidence chooses.

    Attributes:
        num_turns: About the normal, for each pair of keypoints.
        num_starts: Distinct poses, of those looked at, that go on to a short ICP.
        num_rounds: Of that,
        num_samples: and samples in it; the best pose goes on to the ICP of all.
    """

    num_turns: int = 36
    num_starts: int = 30
    num_rounds: int = 30
    num_samples: int = 300


_SEARCH = _EvidenceSearch()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CoarseAnswer:
    """What the coarse step says of two scans.

    Attributes:
        i_from_j: The pose between the sensor frames; None if there is none.
        num_matches: Keypoints of i that have a correspondence in j, or agree on the start pose;
            start poses, where the evidence chooses.
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

    The paper has the correspondences "initialise" an ICP and leaves open on what it runs; the
    readings are options. Starts other than the fit are ours: what had to change.

    Args:
        i: First scan.
        j: Second scan.
        features_i: Keypoints of i; S of eq. 1.
        features_j: Keypoints of j; T of eq. 1.
        config: The reading.
    """
    if config.start == "consensus":
        start, support = agreed_pose(features_i, features_j, config.num_nearest, i.diameter)
        if start is None or support < MIN_POINTS:
            return _no_pose(support, f"{support} keypoints agree on a pose, 3 are needed")
        return _answer(support, _surface_icp(i, j, start, config))
    if config.start == "evidence":
        return _register_by_evidence(i, j, features_i, features_j, config)
    return _register_by_fit(i, j, features_i, features_j, config)


def _register_by_fit(
    i: PreparedScan,
    j: PreparedScan,
    features_i: Features,
    features_j: Features,
    config: CoarseConfig,
) -> CoarseAnswer:
    """As published: a fit to all matches of eq. 1, then ICP of keypoints or surfaces."""
    matches = match_signatures(
        features_i.signatures,
        features_j.signatures,
        max_distance=config.max_signature_distance,
        quantile=config.signature_quantile,
        mutual=config.mutual,
    )
    points_i, points_j = features_i.points[matches.s], features_j.points[matches.t]
    if len(matches) < MIN_POINTS:
        return _no_pose(len(matches), f"{len(matches)} matched keypoints, 3 are needed")
    breadth = min(_breadth(points_i) / i.diameter, _breadth(points_j) / j.diameter)
    if breadth < MIN_BREADTH_DIAMETERS:
        return _no_pose(len(matches), "the matched keypoints lie on a line")
    start = rigid_fit(points_j, points_i)
    if config.icp == "surface":
        return _answer(len(matches), _surface_icp(i, j, start, config))
    once_i, once_j = np.unique(points_i, axis=0), np.unique(points_j, axis=0)
    return _answer(len(matches), point_icp(once_j, once_i, start, config.trim))


def _register_by_evidence(
    i: PreparedScan,
    j: PreparedScan,
    features_i: Features,
    features_j: Features,
    config: CoarseConfig,
) -> CoarseAnswer:
    """Keypoints as places: all pairs of them with all turns, ICP, and the sensors choose.

    Signatures only say where keypoints are. The start poses and the answer are those that the
    visibility evidence speaks for most.
    """
    field_i, field_j = make_field(i), make_field(j)
    anchors_i = Anchors(points=features_i.points, normals=features_i.normals)
    anchors_j = Anchors(points=features_j.points, normals=features_j.normals)
    coarse, middle, _ = (share * i.diameter for share in PairsConfig().tolerance_diameters)
    rows, _ = sweep(field_i, field_j, anchors_i, anchors_j, _SEARCH.num_turns, coarse, MAX_POSES)
    same = same_hypothesis(i.diameter)
    chosen = distinct_poses(rows, field_j.centre, same.angle, same.shift, _SEARCH.num_starts)
    if len(chosen) == 0:
        return _no_pose(0, "no pair of keypoints gives a pose that the sensors allow")
    source, target = j.samples.points[: _SEARCH.num_samples], field_i.surface[:, :3]
    poses = [
        point_icp(
            source, target, to_pose(row), config.trim, max_rounds=_SEARCH.num_rounds
        ).target_from_source
        for row in rows[chosen]
    ]
    scores = score_poses(field_i, field_j, pose_rows(poses), len(field_i.points), middle)
    best = poses[int(np.argmax(scores))]
    return _answer(len(chosen), _surface_icp(i, j, best, config))


def _surface_icp(
    i: PreparedScan, j: PreparedScan, start: Pose, config: CoarseConfig
) -> PointAlignment:
    """ICP of samples of j onto all points of i."""
    return point_icp(j.samples.points, i.mesh.vertices, start, config.trim)


def _answer(num_matches: int, found: PointAlignment) -> CoarseAnswer:
    return CoarseAnswer(
        i_from_j=found.target_from_source, num_matches=num_matches, rms=found.rms, reason=""
    )


def _breadth(points: FloatArray) -> float:
    """Root mean square distance of points (N, 3) from their best line."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(np.linalg.norm(spread[1:]) / np.sqrt(len(points)))


def _no_pose(num_matches: int, reason: str) -> CoarseAnswer:
    return CoarseAnswer(i_from_j=None, num_matches=num_matches, rms=float("nan"), reason=reason)
