"""3D Harris keypoints (Sipiran & Bustos, The Visual Computer 2011)."""

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import FloatArray, IntArray

_TRACE_WEIGHT = 0.04
"""k of the response det E - k (tr E)^2."""
_LEAST_RESPONSE = 1e-2
"""Of a ball whose radius is about four times that of the neighbourhoods: less is no corner."""
_MIN_NEIGHBOURS = 9
"""Fewer points than this do not hold the quadratic's six coefficients."""


def harris_response(points: FloatArray, at: IntArray, radius: float) -> FloatArray:
    """Harris response (M,) of some points (N, 3) of a surface; -inf where too few are around.

    The points within the radius (the paper counts rings of a mesh) are turned so that their least
    principal axis is z, moved so that the point is the origin, and divided by the radius. A
    quadratic z = p1/2 x^2 + p2 xy + p3/2 y^2 + p4 x + p5 y + p6 is fitted to them, and the products
    of its derivatives are averaged under a Gaussian (sigma^2 = 2, as the factors of Sipiran &
    Bustos 2011 imply): A = p4^2 + 2 p1^2 + 2 p2^2, B = p5^2 + 2 p2^2 + 2 p3^2,
    C = p4 p5 + 2 p1 p2 + 2 p2 p3. The response is AB - C^2 - 0.04 (A + B)^2.
    """
    response = np.full(len(at), -np.inf)
    around = KDTree(points).query_ball_point(points[at], radius, return_sorted=True)
    for k, members in enumerate(around):
        if len(members) >= _MIN_NEIGHBOURS:
            p1, p2, p3, p4, p5, _ = _quadratic((points[members] - points[at[k]]) / radius)
            a, b = p4**2 + 2 * p1**2 + 2 * p2**2, p5**2 + 2 * p2**2 + 2 * p3**2
            c = p4 * p5 + 2 * p1 * p2 + 2 * p2 * p3
            response[k] = a * b - c * c - _TRACE_WEIGHT * (a + b) ** 2
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
    is_highest = response > _LEAST_RESPONSE
    # Of equals the first is.
    i, j = KDTree(points[at]).query_pairs(spacing, output_type="ndarray").T
    is_highest[np.where(response[i] >= response[j], j, i)] = False
    peaks = np.flatnonzero(is_highest)
    order = np.argsort(-response[peaks], kind="stable")
    return at[peaks[order][:max_count]]


def _quadratic(local: FloatArray) -> FloatArray:
    """Coefficients (6,) of the quadratic over points (N, 3) near the origin."""
    centred = local - local.mean(axis=0)
    z, y, x = (local @ np.linalg.eigh(centred.T @ centred)[1]).T
    terms = np.stack([0.5 * x * x, x * y, 0.5 * y * y, x, y, np.ones_like(x)], axis=1)
    # Points in a line leave the fit open: the least curved quadratic is meant then.
    return np.linalg.pinv(terms.T @ terms, rcond=1e-10, hermitian=True) @ (terms.T @ z)
