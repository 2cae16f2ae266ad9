"""3D Harris keypoints (Sipiran & Bustos, The Visual Computer 2011)."""

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

_TRACE_WEIGHT = 0.04
"""k of the response det E - k (tr E)^2."""
_LEAST_RESPONSE = 1e-2
"""Of a ball whose radius is about four times that of the neighbourhoods: less is no corner."""
_MIN_NEIGHBOURS = 9
"""Fewer points than this do not hold the quadratic's six coefficients."""
_BLOCK = 512
"""Points that are fitted at once: bounds the memory."""


def harris_response(points: FloatArray, at: IntArray, radius: float) -> FloatArray:
    """Harris response (M,) of some points of a surface; -inf where too few points are around.

    The points within the radius (the paper counts rings of a mesh) are turned so that their least
    principal axis is z, moved so that the point is the origin, and divided by the radius. A
    quadratic z = p1/2 x^2 + p2 xy + p3/2 y^2 + p4 x + p5 y + p6 is fitted to them, and the products
    of its derivatives are averaged under a Gaussian (sigma^2 = 2, as the factors of Sipiran &
    Bustos 2011 imply): A = p4^2 + 2 p1^2 + 2 p2^2, B = p5^2 + 2 p2^2 + 2 p3^2,
    C = p4 p5 + 2 p1 p2 + 2 p2 p3. The response is AB - C^2 - 0.04 (A + B)^2.

    Args:
        points: (N, 3), about evenly spread.
        at: (M,) indices of points.
        radius: Of the neighbourhoods, in the points' unit.
    """
    tree = KDTree(points)
    response = np.full(len(at), -np.inf)
    for start in range(0, len(at), _BLOCK):
        block = at[start : start + _BLOCK]
        around = tree.query_ball_point(points[block], radius, return_sorted=True)
        counts = np.array([len(each) for each in around])
        fitted = np.flatnonzero(counts >= _MIN_NEIGHBOURS)
        if len(fitted):
            members = np.concatenate([around[k] for k in fitted]).astype(np.int64)
            centres = points[block[fitted]]
            coefficients = _fit(points[members], centres, counts[fitted], radius)
            response[start + fitted] = _response(coefficients)
    return response


def harris_keypoints(
    points: FloatArray, at: IntArray, radius: float, spacing: float, max_count: int
) -> IntArray:
    """Points where the response is the highest within the spacing, strongest first: (K,) indices.

    Args:
        points: (N, 3).
        at: (M,) indices of the points that may be keypoints.
        radius: Of the neighbourhoods.
        spacing: How far around a keypoint no other may be.
        max_count: The strongest so many are taken.
    """
    response = harris_response(points, at, radius)
    peaks = np.flatnonzero(_is_highest(points[at], response, spacing))
    order = np.argsort(-response[peaks], kind="stable")
    return at[peaks[order][:max_count]]


def _is_highest(points: FloatArray, response: FloatArray, spacing: float) -> BoolArray:
    """Where (M,) the response is that of a corner and highest around; of equals the first is."""
    is_highest = response > _LEAST_RESPONSE
    i, j = KDTree(points).query_pairs(spacing, output_type="ndarray").T
    is_highest[np.where(response[i] >= response[j], j, i)] = False
    return is_highest


def _fit(members: FloatArray, centres: FloatArray, counts: IntArray, radius: float) -> FloatArray:
    """Coefficients (M, 6) of quadratics over the neighbourhoods of centres (M, 3).

    The members (P, 3) of the neighbourhoods come one neighbourhood after the other.
    """
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    owner = np.repeat(np.arange(len(counts)), counts)
    local = (members - centres[owner]) / radius
    centred = local - (np.add.reduceat(local, starts) / counts[:, None])[owner]
    spread = np.add.reduceat(centred[:, :, None] * centred[:, None, :], starts)
    _, axes = np.linalg.eigh(spread)
    z, y, x = np.einsum("pk,pkc->cp", local, axes[owner])
    terms = np.stack([0.5 * x * x, x * y, 0.5 * y * y, x, y, np.ones_like(x)], axis=1)
    normal = np.add.reduceat(terms[:, :, None] * terms[:, None, :], starts)
    right = np.add.reduceat(terms * z[:, None], starts)
    # Points in a line leave the fit open: the least curved quadratic is meant then.
    return np.einsum("mij,mj->mi", np.linalg.pinv(normal, rcond=1e-10, hermitian=True), right)


def _response(coefficients: FloatArray) -> FloatArray:
    p1, p2, p3, p4, p5, _ = coefficients.T
    a = p4**2 + 2 * p1**2 + 2 * p2**2
    b = p5**2 + 2 * p2**2 + 2 * p3**2
    c = p4 * p5 + 2 * p1 * p2 + 2 * p2 * p3
    return a * b - c * c - _TRACE_WEIGHT * (a + b) ** 2
