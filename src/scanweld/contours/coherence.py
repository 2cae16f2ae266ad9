"""Contour coherence of two scans: predicted contours of one beside observed ones of the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from scanweld.config import ContoursConfig
from scanweld.contours.contour_sets import ContourPoints, ObservedContours, observe_contours
from scanweld.contours.predict import predict_contours
from scanweld.contours.prune import (
    prune_behind,
    prune_by_observed_normal,
    prune_invisible_observed,
    prune_invisible_predicted,
    prune_same_place,
    prune_self_occlusion,
)
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan

COHERENT_PIXELS = 2.0
"""Contours that lie no farther apart in the image than this cohere."""
NUM_DOUBTED = 20
"""Contour points that would change a coherence by half."""
LAST_MATCH_PIXELS = 4.0
"""Farthest contour match of a pose that is nearly right, in footprints of a pixel."""
MIN_AGREEMENT = 0.5
"""Cosine of the two surfaces' normals below which contours do not match."""
MIN_SIDEWAYS = 0.5
"""Length of a normal's part across the viewing ray below which it says little about a contour."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ContourPair:
    """Contours after the three prunings, in the sensor frame of j.

    Attributes:
        predicted: C_{i->j}^(3), points of scan i.
        observed: C_{j/i}^(2), points of scan j.
    """

    predicted: ContourPoints
    observed: ContourPoints


def contour_pair(
    i: ObservedContours, j: ObservedContours, j_from_i: Pose, config: ContoursConfig
) -> ContourPair:
    """Render scan i into camera j and prune the contours of both (paper eqs 4-6)."""
    predicted, corners = predict_contours(i, j, j_from_i)
    observed = j.contour
    kept = np.ones(len(predicted), dtype=bool)
    if "self-occlusion" in config.prunings:
        if config.self_occlusion == "border":
            kept &= prune_self_occlusion(corners, i.is_border)
        else:
            kept &= prune_same_place(predicted, i, j_from_i)
    if "predicted" in config.prunings:
        kept &= _visible(predicted, i, j, j_from_i, config)
    if "observed" in config.prunings:
        observed = observed[prune_invisible_observed(observed, i.scan.image.camera, j_from_i)]
    return ContourPair(predicted=predicted[kept], observed=observed)


def _visible(
    predicted: ContourPoints,
    i: ObservedContours,
    j: ObservedContours,
    j_from_i: Pose,
    config: ContoursConfig,
) -> BoolArray:
    """The third pruning in the reading that is asked for."""
    camera_i, camera_j = i.scan.image.camera, j.scan.image.camera
    match config.predicted_visibility:
        case "face":
            return prune_invisible_predicted(predicted, camera_j)
        case "depth":
            return prune_behind(predicted, j)
        case "observed normal":
            return prune_by_observed_normal(predicted, j, camera_j, Pose.identity())
        case "printed":
            return prune_by_observed_normal(predicted, j, camera_i, j_from_i)


def coherence(pairs: Sequence[ContourPair]) -> float:
    """Share of the predicted contour points with an observed one within 2 pixels in the image."""
    near, total = _coherent(pairs)
    return near / total if total else 0.0


def _coherent(pairs: Sequence[ContourPair]) -> tuple[int, int]:
    """How many predicted points cohere, and how many there are."""
    near = total = 0
    for pair in pairs:
        total += len(pair.predicted)
        if len(pair.predicted) and len(pair.observed):
            distances, _ = KDTree(pair.observed.pixels).query(pair.predicted.pixels)
            near += int((distances <= COHERENT_PIXELS).sum())
    return near, total


def contour_coherence(
    scans: Sequence[PreparedScan], config: ContoursConfig
) -> Callable[[int, int, Pose], float]:
    """The coherence of scans i and j at a pose ``i_from_j``, of both contours in both views.

    Few points say little: so many more, half of which cohere, are counted in.
    """
    observed = [observe_contours(scan, config) for scan in scans]

    def cohere(i: int, j: int, i_from_j: Pose) -> float:
        both = [
            contour_pair(observed[i], observed[j], i_from_j.inverse(), config),
            contour_pair(observed[j], observed[i], i_from_j, config),
        ]
        near, total = _coherent(both)
        return (near + 0.5 * NUM_DOUBTED) / (total + NUM_DOUBTED)

    return cohere


def outline_matches(pair: ContourPair, camera_j: Camera, radius: float) -> Matches:
    """Match predicted contours to the closest observed ones in 3D, to be pulled across the outline.

    On a smooth outline the surface is seen edge-on, so its normal without the part along the
    viewing ray is the outline's normal in the image. What moves along the outline or along the
    ray costs nothing. Refused are matches farther than the radius, on surfaces that look
    different ways, and where the surface is not edge-on: a cut rather than an outline.
    """
    if not len(pair.predicted) or not len(pair.observed):
        return Matches(points=np.zeros((0, 3)), directions=np.zeros((0, 3)), residuals=np.zeros(0))
    distances, nearest = KDTree(pair.observed.points).query(pair.predicted.points)
    observed = pair.observed[np.asarray(nearest)]
    rays = camera_j.view_directions(observed.points)
    across = observed.normals - rays * np.einsum("nk,nk->n", rays, observed.normals)[:, None]
    length = np.linalg.norm(across, axis=1)
    agreement = np.einsum("nk,nk->n", observed.normals, pair.predicted.normals)
    held = (distances <= radius) & (length > MIN_SIDEWAYS) & (agreement > MIN_AGREEMENT)
    directions = across[held] / length[held, None]
    apart = pair.predicted.points[held] - observed.points[held]
    return Matches(
        points=pair.predicted.points[held],
        directions=directions,
        residuals=np.einsum("nk,nk->n", apart, directions),
    )


def contour_matcher(
    scans: Sequence[PreparedScan], config: ContoursConfig
) -> Callable[[int, int, Pose], Matches]:
    """What the joint refinement asks for contour terms: scans i, j and ``j_from_i`` to matches.

    Each call renders scan i into camera j; the matches are in the sensor frame of j.
    """
    observed = [observe_contours(scan, config) for scan in scans]

    def match(i: int, j: int, j_from_i: Pose) -> Matches:
        image = scans[j].image
        pair = contour_pair(observed[i], observed[j], j_from_i, config)
        return outline_matches(pair, image.camera, LAST_MATCH_PIXELS * image.pixel)

    return match
