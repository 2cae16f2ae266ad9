"""Keypoints: maxima of the heat signature that persist over scales (paper 3.1)."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial import cKDTree

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

# A maximum must be found again at so many successive times.
_MIN_SCALES = 2
# Signatures (log) are alike below this root mean square difference.
_ALIKE = 0.5


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Maxima:
    """Local maxima of a signature on a mesh.

    Attributes:
        vertices: (K,), ascending.
        strengths: (K,) excess of the log signature over its mean, averaged over the maximum's times.
    """

    vertices: IntArray
    strengths: FloatArray


def persistent_maxima(
    signature: FloatArray, vertices: FloatArray, faces: IntArray, radius: float
) -> Maxima:
    """Vertices that are local maxima at successive times; one for each chain over the times.

    A maximum goes on where the next time has one within ``radius``; the chain is placed where the
    shortest of its times has it.

    Args:
        signature: (V, T) log heat signature.
        vertices: (V, 3).
        faces: (F, 3).
        radius: In the vertices' unit.
    """
    is_maximum = _local_maxima(signature, faces)
    excess = signature - signature.mean(axis=0)
    at, chain_sum, chain_length = _starts(is_maximum[:, 0], excess[:, 0])
    done: list[tuple[IntArray, FloatArray, IntArray]] = []
    place = at
    for time in range(1, signature.shape[1]):
        now = np.flatnonzero(is_maximum[:, time])
        follower = _follow(vertices[place], vertices[now], radius)
        goes_on = follower >= 0
        done.append((at[~goes_on], chain_sum[~goes_on], chain_length[~goes_on]))
        is_new = np.ones(len(now), dtype=bool)
        is_new[follower[goes_on]] = False
        new = now[is_new]
        place = np.concatenate([now[follower[goes_on]], new])
        at = np.concatenate([at[goes_on], new])
        chain_sum = np.concatenate([chain_sum[goes_on], np.zeros(len(new))]) + excess[place, time]
        chain_length = np.concatenate([chain_length[goes_on], np.zeros(len(new), np.int64)]) + 1
    done.append((at, chain_sum, chain_length))
    at, chain_sum, chain_length = (np.concatenate(part) for part in zip(*done, strict=True))
    kept = chain_length >= _MIN_SCALES
    order = np.flatnonzero(kept)[np.argsort(at[kept], kind="stable")]
    return Maxima(vertices=at[order], strengths=chain_sum[order] / chain_length[order])


def _starts(is_maximum: BoolArray, excess: FloatArray) -> tuple[IntArray, FloatArray, IntArray]:
    at = np.flatnonzero(is_maximum)
    return at, excess[at], np.ones(len(at), dtype=np.int64)


def _follow(points: FloatArray, candidates: FloatArray, radius: float) -> IntArray:
    """For each point (N,) the nearest candidate within the radius, -1 if none or taken by a nearer."""
    if len(points) == 0 or len(candidates) == 0:
        return np.full(len(points), -1, dtype=np.int64)
    distance, nearest = cKDTree(candidates).query(points, distance_upper_bound=radius)
    follower = np.where(np.isfinite(distance), nearest, -1).astype(np.int64)
    order = np.argsort(distance, kind="stable")
    _, first = np.unique(follower[order], return_index=True)
    is_first = np.zeros(len(points), dtype=bool)
    is_first[order[first]] = True
    return np.where(is_first, follower, -1)


def _local_maxima(signature: FloatArray, faces: IntArray) -> BoolArray:
    """Where (V, T) the signature is larger than at all neighbours of the mesh."""
    num = len(signature)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ends = np.concatenate([start, end]), np.concatenate([end, start])
    graph = coo_array((np.ones(len(ends[0])), ends), shape=(num, num)).tocsr()
    has_neighbours = np.diff(graph.indptr) > 0
    highest = np.full(signature.shape, np.inf)
    highest[has_neighbours] = np.maximum.reduceat(
        signature[graph.indices], graph.indptr[:-1][has_neighbours]
    )
    return signature > highest


def group(
    points: FloatArray, signatures: FloatArray, strengths: FloatArray, radius: float
) -> IntArray:
    """Indices of one keypoint of each group, strongest first.

    A keypoint falls to a stronger one that is nearer than ``radius`` and has a like signature.

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
