"""Contour coherence of two scans: predicted contours of one beside observed ones of the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
"""Contours that lie no farther apart in the image than this are coherent."""
NUM_ASSUMED = 20
"""Contour points that are counted in with a coherence of one half: few points show little."""
LAST_MATCH_PIXELS = 4.0
"""Farthest contour match at a pose that is nearly right, in footprints of a pixel."""
OUTLINE_NOISE_PIXELS = 0.3
"""Standard deviation of an outline, in footprints: it is known to the pixel, no better."""
MIN_OUTLINE_AGREEMENT = 0.5
"""Cosine of the angle between two surfaces' normals below which their contours do not match."""
MIN_SIDEWAYS = 0.5
"""Sine of the angle between normal and viewing ray below which the surface is not seen edge-on, so
that its contour is the border of a cut rather than an outline."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ContourPair:
    """Contours after the three prunings, in the sensor frame of j.

    Attributes:
        predicted: C_{i->j}^(3), points of scan i.
        observed: C_{j/i}^(2), points of scan j.
    """

    predicted: ContourPoints
    observed: ContourPoints

    def moved(self, motion: Pose) -> "ContourPair":
        """The same after a small motion of scan i in the frame of j: pixels stay what they were."""
        points, normals = motion.apply(self.predicted.points), motion.turn(self.predicted.normals)
        return replace(self, predicted=replace(self.predicted, points=points, normals=normals))


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
    """The third pruning, in the reading of eq. 6 that the settings name."""
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
    """How many predicted points are coherent, and how many there are."""
    near = total = 0
    for pair in pairs:
        total += len(pair.predicted)
        if len(pair.predicted) and len(pair.observed):
            distances, _ = KDTree(pair.observed.pixels).query(pair.predicted.pixels)
            near += int((distances <= COHERENT_PIXELS).sum())
    return near, total


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
    held = (distances <= radius) & (length > MIN_SIDEWAYS) & (agreement > MIN_OUTLINE_AGREEMENT)
    directions = across[held] / length[held, None]
    apart = pair.predicted.points[held] - observed.points[held]
    return Matches(
        points=pair.predicted.points[held],
        directions=directions,
        residuals=np.einsum("nk,nk->n", apart, directions),
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ContourMatcher:
    """The observed contours of all scans of a run, compared pair by pair at any poses.

    Attributes:
        observed: The contours of each scan.
        config: Which prunings are made, and how.
    """

    observed: Sequence[ObservedContours]
    config: ContoursConfig

    def pair(self, i: int, j: int, j_from_i: Pose) -> ContourPair:
        """Contours of scan i, rendered into camera j, and those of scan j that it could show."""
        return contour_pair(self.observed[i], self.observed[j], j_from_i, self.config)

    def matches(self, j: int, pair: ContourPair) -> Matches:
        """Matches of predicted contours on those observed in scan j; sensor frame of j."""
        image = self.observed[j].scan.image
        return outline_matches(pair, image.camera, LAST_MATCH_PIXELS * image.pixel)

    def coherence(self, i: int, j: int, i_from_j: Pose) -> float:
        """The coherence of the contours of scans i and j, each rendered into the other's camera.

        A few points say little. So ``NUM_ASSUMED`` more are counted in, half of them coherent.
        """
        a, b = self.observed[i], self.observed[j]
        both = [
            contour_pair(a, b, i_from_j.inverse(), self.config),
            contour_pair(b, a, i_from_j, self.config),
        ]
        near, total = _coherent(both)
        return (near + 0.5 * NUM_ASSUMED) / (total + NUM_ASSUMED)


def contour_matcher(scans: Sequence[PreparedScan], config: ContoursConfig) -> ContourMatcher:
    """Find the contours of all scans once, for comparing them pair by pair."""
    return ContourMatcher(observed=[observe_contours(s, config) for s in scans], config=config)
