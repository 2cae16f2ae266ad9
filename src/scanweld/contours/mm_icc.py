"""MM-ICC: two scans aligned by the coherence of their contours (paper 3.2)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from scanweld.config import ContoursConfig
from scanweld.contours.coherence import (
    LAST_MATCH_PIXELS,
    ContourPair,
    coherence,
    contour_pair,
    outline_matches,
)
from scanweld.contours.contour_sets import ObservedContours, observe_contours
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.gauss_newton import damped, jacobian, motion_of, spread_of, tukey_weights
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.prepared import PreparedScan

MIN_MATCHES = 12
"""Fewer contour matches than this say nothing about a pose."""
FRACTION_EXPONENT = 1.3
"""How much a larger share of matches is worth, against a smaller rms."""
MIN_SHARE = 0.3
"""Smallest share of the matches that is kept."""
FIRST_MATCH_PIXELS = 16.0
"""Farthest match in the first of the rounds across the outline; it shrinks from there."""
NUM_OUTLINE_ROUNDS = 10
"""Renderings of the rounds across the outline."""
OUTLINE_NOISE_PIXELS = 0.3
"""Standard deviation of an outline that is known to the pixel."""
STILL_PIXELS = 0.02
"""The iteration has come to rest when a rendering moves the scan by less."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ContourAlignment:
    """A pair aligned by contours.

    Attributes:
        i_from_j: The refined pose.
        rms: Of the residuals of the matches kept, in the scans' unit.
        num_matches: Contour matches kept, both directions; with too few the pose stays.
        converged: Whether the iteration came to rest before its last rendering.
        coherence: Share of the pruned predicted contours within 2 pixels of an observed one.
    """

    i_from_j: Pose
    rms: float
    num_matches: int
    converged: bool
    coherence: float


def refine_pair(
    i: PreparedScan, j: PreparedScan, i_from_j: Pose, config: ContoursConfig
) -> ContourAlignment:
    """Refine a relative pose by MM-ICC.

    In an outer loop each scan is rendered into the camera of the other and the contours are
    pruned; in an inner loop they are matched in 3D and the pose is solved for by trimmed ICP, as
    published. That gets in from far but is off by half a pixel or so: contour points slide along
    the surface. With the residual ``"normal"`` a few rounds follow that count only the distance
    across the outline.
    """
    a, b = observe_contours(i, config), observe_contours(j, config)
    pose, converged, squares = _trimmed_rounds(a, b, i_from_j.inverse(), config)
    if config.residual == "normal":
        for pixels in np.geomspace(FIRST_MATCH_PIXELS, LAST_MATCH_PIXELS, NUM_OUTLINE_ROUNDS):
            pose, squares = _outline_step(_both(a, b, pose), i, j, pose, float(pixels))
    return ContourAlignment(
        i_from_j=pose.inverse(),
        rms=float(np.sqrt(squares.mean())) if len(squares) else 0.0,
        num_matches=len(squares),
        converged=converged,
        coherence=coherence(_both(a, b, pose)),
    )


def _both(
    a: ObservedContours, b: ObservedContours, b_from_a: Pose
) -> tuple[ContourPair, ContourPair]:
    return contour_pair(a, b, b_from_a), contour_pair(b, a, b_from_a.inverse())


def _trimmed_rounds(
    a: ObservedContours, b: ObservedContours, b_from_a: Pose, config: ContoursConfig
) -> tuple[Pose, bool, FloatArray]:
    """The outer loop: render, prune, trimmed ICP, until a rendering changes nothing."""
    pose, squares = b_from_a, np.zeros(0)
    probes = a.scan.mesh.vertices[:: max(1, len(a.scan.mesh.vertices) // 100)]
    for _ in range(config.num_renders):
        last = pose.apply(probes)
        pose, squares = trimmed_icp(_both(a, b, pose), pose, config)
        if len(squares) < MIN_MATCHES:
            return pose, False, squares
        if np.abs(pose.apply(probes) - last).max() < STILL_PIXELS * b.scan.image.pixel:
            return pose, True, squares
    return pose, False, squares


def trimmed_icp(
    pairs: tuple[ContourPair, ContourPair], j_from_i: Pose, config: ContoursConfig
) -> tuple[Pose, FloatArray]:
    """Trimmed ICP (Chetverikov et al. 2002) of contour points in 3D, both directions at once.

    The share kept is given, or found in each step (fractional ICP, Phillips et al. 2007).

    Args:
        pairs: Contours of i predicted in camera j, and of j predicted in camera i.
        j_from_i: The pose at which they were predicted.
        config: Share of the matches kept, and inner iterations.

    Returns:
        The pose, and the squared distances of the matches kept.
    """
    forth, back = pairs
    if min(len(part) for pair in pairs for part in (pair.predicted, pair.observed)) < MIN_MATCHES:
        return j_from_i, np.zeros(0)
    of_i, of_j = (
        j_from_i.inverse().apply(forth.predicted.points),
        j_from_i.apply(back.predicted.points),
    )
    seen_by_i, seen_by_j = KDTree(back.observed.points), KDTree(forth.observed.points)
    pose, squares = j_from_i, np.zeros(0)
    for _ in range(config.num_steps):
        p, q, forth_squares = _trimmed(seen_by_j, pose.apply(of_i), config.trim)
        r, s, back_squares = _trimmed(seen_by_i, pose.inverse().apply(of_j), config.trim)
        pose = rigid_fit(
            np.concatenate([of_i[p], back.observed.points[s]]),
            np.concatenate([forth.observed.points[q], of_j[r]]),
        )
        squares = np.concatenate([forth_squares, back_squares])
    return pose, squares


def _trimmed(
    observed: KDTree, predicted: FloatArray, share: float | None
) -> tuple[IntArray, IntArray, FloatArray]:
    """The closest matches: indices of predicted and observed points, squared distances."""
    distances, nearest = observed.query(predicted)
    order = np.argsort(distances, kind="stable")
    squares = distances[order] ** 2
    num = _best_count(squares) if share is None else int(np.ceil(share * len(order)))
    return order[:num], np.asarray(nearest)[order[:num]], squares[:num]


def _best_count(squares: FloatArray) -> int:
    """How many of the smallest squares to keep: least rms / share^lambda (Phillips et al. 2007)."""
    counts = np.arange(1, len(squares) + 1)
    shares = counts / len(squares)
    fractional = np.sqrt(np.cumsum(squares) / counts) / shares**FRACTION_EXPONENT
    least = int(np.ceil(MIN_SHARE * len(squares)))
    return least + int(np.argmin(fractional[least - 1 :]))


def rigid_fit(moving: FloatArray, target: FloatArray) -> Pose:
    """The motion that brings points (N, 3) closest to others (N, 3), in least squares (Kabsch)."""
    a, b = moving.mean(axis=0), target.mean(axis=0)
    rotation = nearest_rotation((target - b).T @ (moving - a))
    return Pose(rotation=rotation, translation=b - rotation @ a)


def _outline_step(
    pairs: tuple[ContourPair, ContourPair],
    i: PreparedScan,
    j: PreparedScan,
    j_from_i: Pose,
    pixels: float,
) -> tuple[Pose, FloatArray]:
    """One Gauss-Newton step on the distances across the outlines, robustly weighted."""
    pixel = j.image.pixel
    forth = outline_matches(pairs[0], j.image.camera, pixels * pixel)
    back = outline_matches(pairs[1], i.image.camera, pixels * i.image.pixel)
    residuals = np.concatenate([forth.residuals, back.residuals])
    if len(residuals) < MIN_MATCHES:
        return j_from_i, residuals**2
    points = np.concatenate([forth.points, j_from_i.apply(back.points)])
    # A motion of i pulls at its own outlines, and the other way at the outlines of j.
    pulls = np.concatenate([forth.directions, -j_from_i.turn(back.directions)])
    centre, arm = points.mean(axis=0), j.diameter / 3
    by_motion = jacobian(points, pulls, centre, arm)
    weights = tukey_weights(residuals, spread_of(residuals, OUTLINE_NOISE_PIXELS * pixel))
    normal = damped((by_motion * weights[:, None]).T @ by_motion)
    twist = -np.linalg.solve(normal, by_motion.T @ (weights * residuals)).astype(np.float64)
    return motion_of(twist, centre, arm) @ j_from_i, residuals[weights > 0] ** 2
