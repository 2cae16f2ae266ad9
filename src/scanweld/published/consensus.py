"""A start pose from matches of which most are wrong: the one that most of them agree on.

This is not in the paper. The nearest signature is too seldom the right one for a fit to all
matches; among the few nearest the right one often is. Two matches that fit each other give a pose,
and the other matches say which of these poses to take.
"""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.pose import Pose
from scanweld.heat.features import Features
from scanweld.pairs.problem import to_pose
from scanweld.published.signature_matching import signature_distances

MAX_POSES = 2000
"""Start poses that are looked at: the best, by whatever they are first ranked by."""


@dataclass(frozen=True, kw_only=True, slots=True)
class _Fit:
    """When matches fit each other, and a pose; lengths in diameters.

    Attributes:
        length: The distances between the keypoints of two matches differ by less,
        min_length: and are not less than this,
        cosine: and the cosines between normals and their connection differ by less.
        support: A match supports a pose that brings its keypoints to within this.
    """

    length: float = 0.03
    min_length: float = 0.1
    cosine: float = 0.35
    support: float = 0.05


_FIT = _Fit()


def agreed_pose(
    features_i: Features, features_j: Features, num_nearest: int, diameter: float
) -> tuple[Pose | None, int]:
    """The pose i_from_j that most keypoints of i agree on, and how many do; None without any.

    Args:
        features_i: Keypoints of i.
        features_j: Keypoints of j.
        num_nearest: How many nearest signatures of j are tried for each keypoint of i.
        diameter: Of the scans, in the same unit.
    """
    matches = candidate_matches(features_i.signatures, features_j.signatures, num_nearest)
    rows = consistent_poses(features_i, features_j, matches, diameter)
    if len(rows) == 0:
        return None, 0
    support = _num_supporting(rows, features_i, features_j, matches, _FIT.support * diameter)
    best = int(np.argmax(support))
    return to_pose(rows[best]), int(support[best])


def candidate_matches(s: FloatArray, t: FloatArray, num_nearest: int) -> IntArray:
    """Each signature of S (K, T) with its few nearest of T (L, T): (C, 2) indices."""
    if len(s) == 0 or len(t) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    nearest = np.argsort(signature_distances(s, t), axis=1, kind="stable")[:, :num_nearest]
    from_s = np.repeat(np.arange(len(s)), nearest.shape[1])
    return np.stack([from_s, nearest.ravel()], axis=1)


def consistent_poses(
    features_i: Features, features_j: Features, matches: IntArray, diameter: float
) -> FloatArray:
    """Pose rows (P, 12) of i_from_j by two matches (C, 2) each that fit each other, best first."""
    one, two = np.triu_indices(len(matches), 1)
    of_i, of_j = (
        _connections(features, matches[one, side], matches[two, side])
        for side, features in enumerate((features_i, features_j))
    )
    stretch = np.abs(of_i[:, 0] - of_j[:, 0]) / diameter
    twist = np.abs(of_i[:, 1:] - of_j[:, 1:]).max(axis=1, initial=0.0)
    fits = (stretch < _FIT.length) & (twist < _FIT.cosine)
    fits &= np.minimum(of_i[:, 0], of_j[:, 0]) > _FIT.min_length * diameter
    misfit = stretch / _FIT.length + twist / _FIT.cosine
    kept = np.flatnonzero(fits)
    kept = kept[np.argsort(misfit[kept], kind="stable")][:MAX_POSES]
    return _poses(features_i, features_j, matches[one[kept]], matches[two[kept]])


def _num_supporting(
    poses: FloatArray,
    features_i: Features,
    features_j: Features,
    matches: IntArray,
    radius: float,
) -> IntArray:
    """How many keypoints of i (P,) have a match that each pose brings to within a radius."""
    counts = np.zeros(len(poses), dtype=np.int64)
    targets = features_i.points[matches[:, 0]]
    for n, row in enumerate(poses):
        moved = features_j.points[matches[:, 1]] @ row[:9].reshape(3, 3).T + row[9:]
        near = np.linalg.norm(moved - targets, axis=1) < radius
        counts[n] = len(np.unique(matches[near, 0]))
    return counts


def _connections(features: Features, one: IntArray, two: IntArray) -> FloatArray:
    """Length (N, 0) of the way between two keypoints, and three cosines (N, 1:) that go with it."""
    away = features.points[two] - features.points[one]
    length = np.linalg.norm(away, axis=1)
    along = away / np.maximum(length, np.finfo(float).tiny)[:, None]
    n, m = features.normals[one], features.normals[two]
    dot = lambda a, b: np.einsum("nk,nk->n", a, b)  # noqa: E731
    return np.stack([length, dot(n, along), dot(m, along), dot(n, m)], axis=1)


def _poses(i: Features, j: Features, one: IntArray, two: IntArray) -> FloatArray:
    """Least squares fits (P, 12) of two keypoints each and the tips of their normals."""
    tips_i, tips_j = (_with_tips(f, one[:, k], two[:, k]) for k, f in enumerate((i, j)))
    middle_i, middle_j = tips_i.mean(axis=1), tips_j.mean(axis=1)
    covariance = np.einsum("pna,pnb->pab", tips_i - middle_i[:, None], tips_j - middle_j[:, None])
    u, _, vt = np.linalg.svd(covariance)
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    rotations = u @ vt
    shifts = middle_i - np.einsum("pab,pb->pa", rotations, middle_j)
    return np.concatenate([rotations.reshape(-1, 9), shifts], axis=1)


def _with_tips(features: Features, one: IntArray, two: IntArray) -> FloatArray:
    """Two keypoints and the tips of their normals (P, 4, 3), half as long as the way between."""
    a, b = features.points[one], features.points[two]
    half = 0.5 * np.linalg.norm(b - a, axis=1, keepdims=True)
    return np.stack([a, b, a + half * features.normals[one], b + half * features.normals[two]], 1)
