"""Keypoints: maxima of the heat signature that persist over scales (paper 3.1)."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial import KDTree

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

_MIN_TIMES = 2
"""Successive diffusion times at which a maximum must be found."""
_ALIKE = 0.5
"""Root mean square difference of two log signatures below which they are alike."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Maxima:
    """Persistent maxima of a signature.

    Attributes:
        vertices: (K,) where the shortest of a maximum's times has it.
        strengths: (K,) excess of the log signature over its median, averaged over those times.
    """

    vertices: IntArray
    strengths: FloatArray


@dataclass
class _Chain:
    """A maximum followed over times: where it is at each."""

    first_time: int
    vertices: list[int]


def persistent_maxima(
    signature: FloatArray, points: FloatArray, faces: IntArray, radius: float
) -> Maxima:
    """Points of a surface whose signature is the highest around, at successive times.

    Args:
        signature: (N, T) log heat signature.
        points: (N, 3).
        faces: (F, 3).
        radius: How far around, and how far a maximum may move from one time to the next, in the
            points' unit. Neighbours on the surface always count as around.
    """
    is_maximum = _local_maxima(signature, points, faces, radius)
    chains: list[_Chain] = []
    current: list[_Chain] = []
    for time in range(signature.shape[1]):
        now = np.flatnonzero(is_maximum[:, time])
        last = np.array([chain.vertices[-1] for chain in current], dtype=np.int64)
        follower = _follow(points[last], points[now], radius)
        going = []
        for chain, k in zip(current, follower, strict=True):
            if k >= 0:
                chain.vertices.append(int(now[k]))
                going.append(chain)
        starting = [_Chain(time, [int(v)]) for v in np.delete(now, follower[follower >= 0])]
        chains += starting
        current = going + starting
    kept = [chain for chain in chains if len(chain.vertices) >= _MIN_TIMES]
    excess = signature - np.median(signature, axis=0)
    return Maxima(
        vertices=np.array([chain.vertices[0] for chain in kept], dtype=np.int64),
        strengths=np.array([_mean_along(excess, chain) for chain in kept], dtype=np.float64),
    )


def _mean_along(values: FloatArray, chain: _Chain) -> float:
    times = chain.first_time + np.arange(len(chain.vertices))
    return float(values[chain.vertices, times].mean())


def _follow(points: FloatArray, candidates: FloatArray, radius: float) -> IntArray:
    """The nearest candidate within the radius of each point (N,); -1 if none, or another has it."""
    if len(points) == 0 or len(candidates) == 0:
        return np.full(len(points), -1, dtype=np.int64)
    distance, nearest = map(np.atleast_1d, KDTree(candidates).query(points))
    order = np.argsort(distance, kind="stable")
    _, first = np.unique(nearest[order], return_index=True)
    is_first = np.zeros(len(points), dtype=bool)
    is_first[order[first]] = True
    return np.where(is_first & (distance < radius), nearest, -1)


def _local_maxima(
    signature: FloatArray, points: FloatArray, faces: IntArray, radius: float
) -> BoolArray:
    """Where (N, T) the signature is higher than all around; a tie has no maximum."""
    num = len(points)
    near = KDTree(points).query_pairs(radius, output_type="ndarray")
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    pairs = np.concatenate([near, sides])
    ends = np.concatenate([pairs, pairs[:, ::-1]]).T
    around = coo_array((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(num, num)).tocsr()
    has_any = np.diff(around.indptr) > 0
    highest = np.full(signature.shape, np.inf)
    highest[has_any] = np.maximum.reduceat(
        signature[around.indices], around.indptr[:-1][has_any], axis=0
    )
    return signature > highest


def group(
    points: FloatArray, signatures: FloatArray, strengths: FloatArray, radius: float
) -> IntArray:
    """Indices of one keypoint of each group, strongest first.

    A keypoint falls to a stronger one that is nearer than the radius and has a like signature.

    Args:
        points: (K, 3).
        signatures: (K, T).
        strengths: (K,).
        radius: In the points' unit.
    """
    leaders: list[int] = []
    for k in np.argsort(-strengths, kind="stable"):
        near = np.linalg.norm(points[leaders] - points[k], axis=1) < radius
        apart = np.sqrt(np.mean((signatures[leaders] - signatures[k]) ** 2, axis=1))
        if not (near & (apart < _ALIKE)).any():
            leaders.append(int(k))
    return np.array(leaders, dtype=np.int64)
