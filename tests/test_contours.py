"""Contour sets, the three prunings and MM-ICC, on spheres of known outline and rendered scans."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scanweld.config import ContoursConfig, PrepareConfig
from scanweld.contours.coherence import (
    ContourPair,
    coherence,
    contour_matcher,
    contour_pair,
    outline_matches,
)
from scanweld.contours.contour_sets import (
    ContourPoints,
    ObservedContours,
    far_side,
    near_side,
    observe_contours,
)
from scanweld.contours.predict import predict_contours
from scanweld.contours.prune import (
    prune_invisible_observed,
    prune_invisible_predicted,
    prune_self_occlusion,
)
from scanweld.evaluation.primitives import sphere
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.turntable import joined
from scanweld.evaluation.views import view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.preparation import prepare
from scanweld.published.mm_icc import mm_icc
from scanweld.published.outer_loop import ContourAlignment
from tests.prepared import PreparedPair, creature_pair

MODELS = [CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC]
RADIUS = 50.0
CONFIG = ContoursConfig()


def ball(radius: float = RADIUS, centre: tuple[float, float, float] = (0, 0, 0)) -> TriangleMesh:
    solid = sphere(radius)
    return TriangleMesh(vertices=solid.vertices + np.array(centre), faces=solid.faces)


@lru_cache
def seen_ball(azimuth_deg: float, model: CameraModel) -> tuple[ObservedContours, Pose]:
    """Contours of a ball seen from an azimuth, and ``world_from_sensor``."""
    view = view_of(ball(), azimuth_deg, pixels=120, model=model)
    scan = prepare(scan_mesh(ball(), view.camera, view.world_from_sensor), PrepareConfig())
    return observe_contours(scan, CONFIG), view.world_from_sensor


def balls(gap_deg: float, model: CameraModel) -> tuple[ObservedContours, ObservedContours, Pose]:
    (i, world_from_i), (j, world_from_j) = seen_ball(0.0, model), seen_ball(gap_deg, model)
    return i, j, world_from_j.inverse() @ world_from_i


def distance_from_outline(j: ObservedContours, world_from_j: Pose, contour: ContourPoints):
    """Pixels from the ball's outline in camera j: a circle (nearly, for a pinhole far away)."""
    camera = j.scan.image.camera
    middle = world_from_j.inverse().translation[None]
    centre, depth = camera.project(middle)
    reach = float(np.linalg.norm(middle))
    if camera.model is CameraModel.PINHOLE:
        radius = camera.fx * RADIUS / np.sqrt(reach**2 - RADIUS**2)
    else:
        radius = camera.fx * RADIUS
    assert depth > 0
    return np.linalg.norm(contour.pixels - centre, axis=1) - radius


def nudged(pair: PreparedPair, degrees: float, seed: int = 3) -> Pose:
    axis = np.random.default_rng(seed).normal(size=3)
    rotation = rotation_exp(np.radians(degrees) * axis / np.linalg.norm(axis))
    middle = pair.i_from_j.apply(pair.fields[1].centre)
    turn = Pose(rotation=rotation, translation=middle - rotation @ middle)
    return turn @ pair.i_from_j


def aligned_pair(
    pair: PreparedPair, i_from_j: Pose, config: ContoursConfig = CONFIG
) -> tuple[ContourAlignment, Pose]:
    """Two views by MM-ICC: the alignment, and ``i_from_j``."""
    aligned = mm_icc(pair.scans, {0: Pose.identity(), 1: i_from_j}, [(0, 1)], config)
    return aligned, aligned.poses[0].inverse() @ aligned.poses[1]


def test_near_and_far_side_of_a_step():
    """Two levels 10 apart, beside free pixels on the left and unknown ones on the right."""
    depth = np.full((5, 10), np.nan)
    depth[:, 2:5], depth[:, 5:8] = 20.0, 10.0
    is_free = np.zeros(depth.shape, dtype=bool)
    is_free[:, :2] = True
    near, far = near_side(depth, is_free, 4.0), far_side(depth, 4.0)
    assert np.flatnonzero(near.all(axis=0)).tolist() == [2, 5]
    assert np.flatnonzero(near.any(axis=0)).tolist() == [2, 5]
    assert np.flatnonzero(far.all(axis=0)).tolist() == [4]
    assert np.flatnonzero(far.any(axis=0)).tolist() == [4]
    depth = 10.0 + np.arange(8.0)[None, :].repeat(6, axis=0)
    nowhere = np.zeros(depth.shape, dtype=bool)
    assert not near_side(depth, nowhere, 1.5).any()
    assert not far_side(depth, 1.5).any()
    assert near_side(depth, nowhere, 0.5).sum() == 6 * 7
    depth[2:4, 3:5] = np.nan  # unknown: neither near nor behind anything
    assert not near_side(depth, nowhere, 1.5).any()
    assert near_side(depth, np.isnan(depth), 1.5).sum() == 12, "all around what is background"


@pytest.mark.parametrize("model", MODELS)
def test_contour_of_a_ball_is_its_outline_and_prunings_leave_what_the_other_camera_sees(
    model: CameraModel,
):
    i, world_from_i = seen_ball(0.0, model)
    off = distance_from_outline(i, world_from_i, i.contour)
    assert len(i.contour) > 200
    assert np.abs(off).max() < 3.5
    assert i.is_border.sum() >= len(i.contour)
    # From the side, half of the half ball's contour is its cut; that goes, the outline stays.
    i, j, j_from_i = balls(90.0, model)
    predicted, corners = predict_contours(i, j, j_from_i)
    kept = prune_self_occlusion(corners, i.is_border)
    off = distance_from_outline(j, seen_ball(90.0, model)[1], predicted)
    assert (off < -10).sum() > 50
    assert np.abs(off[kept]).max() < 2.5
    assert kept.sum() > 0.8 * (np.abs(off) < 1.5).sum()
    # Of what j saw, the side that looks at i.
    kept = prune_invisible_observed(j.contour, i.scan.image.camera, j_from_i)
    middle = seen_ball(90.0, model)[1].inverse().translation
    side = (j.contour.points - middle) @ -j_from_i.rotation[:, 2] / RADIUS
    assert side[kept].min() > -0.1
    assert side[~kept].max() < (0.1 if model is CameraModel.ORTHOGRAPHIC else 0.4)
    assert 0.3 < kept.mean() < 0.6
    # From behind, j looks into the half ball: what it sees there is not the object.
    i, j, j_from_i = balls(150.0, model)
    predicted, corners = predict_contours(i, j, j_from_i)
    kept = prune_invisible_predicted(predicted, j.scan.image.camera)
    outward = predicted.points - seen_ball(150.0, model)[1].inverse().translation
    rays = j.scan.image.camera.view_directions(predicted.points)
    looks_away = np.einsum("nk,nk->n", outward, rays) / RADIUS
    assert (~kept).sum() > 50
    assert looks_away[kept].max() < 0.2 and looks_away[~kept].min() > -0.2
    assert len(corners) == len(predicted)


@pytest.mark.parametrize("gap", [60, 90])
def test_pruned_contours_lie_in_the_observing_camera(gap: int):
    """Predicted and observed contours of the truth cohere; with the frames mixed up they do not."""
    pair = creature_pair(gap)
    i, j = (observe_contours(scan, CONFIG) for scan in pair.scans)
    j_from_i = pair.i_from_j.inverse()
    pairs = contour_pair(i, j, j_from_i, CONFIG), contour_pair(j, i, pair.i_from_j, CONFIG)
    assert min(len(part.predicted) for part in pairs) > 50
    assert coherence(pairs) > 0.6
    assert coherence([contour_pair(i, j, pair.i_from_j, CONFIG)]) < 0.3


def test_front_ball_hides_the_rear_one():
    """The near side of the step is the front ball's outline, the far side is just beyond it."""
    both = joined(ball(30.0, (80.0, 0.0, 0.0)), ball(60.0, (-40.0, 30.0, 0.0)))
    view = view_of(both, 0.0, pixels=150, model=CameraModel.ORTHOGRAPHIC)
    scan = prepare(scan_mesh(both, view.camera, view.world_from_sensor), PrepareConfig())
    seen = observe_contours(scan, CONFIG)
    hidden_edge = far_side(scan.image.depth, seen.jump)
    world = view.world_from_sensor.apply(scan.image.points()[hidden_edge])
    on_rear = np.abs(np.linalg.norm(world - [-40.0, 30.0, 0.0], axis=1) - 60.0) < 1.0
    assert on_rear.sum() > 30
    assert np.abs(np.linalg.norm(world[on_rear][:, 1:], axis=1) - 30.0).max() < 4.0
    outline = view.world_from_sensor.apply(seen.contour.points)
    on_front = np.abs(np.linalg.norm(outline - [80.0, 0.0, 0.0], axis=1) - 30.0) < 1.0
    across = outline[on_front][:, 1:]
    assert np.ptp(np.arctan2(*across.T)) > 5.5
    assert np.abs(np.linalg.norm(across, axis=1) - 30.0).max() < 4.0


def test_outline_distance_ignores_sliding():
    """Across the outline a shift counts in full; along it, or along the ray, not at all."""
    i, j, j_from_i = balls(60.0, CameraModel.ORTHOGRAPHIC)
    seen = contour_pair(i, j, j_from_i, CONFIG).observed
    camera, pixel = j.scan.image.camera, j.scan.image.pixel
    for direction, gain in ((np.array([0.0, 0.0, 1.0]), 0.0), (np.array([1.0, 0.0, 0.0]), 1.0)):
        moved = replace(seen, points=seen.points + direction * pixel)
        pair = ContourPair(predicted=moved, observed=seen)
        matches = outline_matches(pair, camera, 10 * pixel)
        assert len(matches) > 50
        np.testing.assert_allclose(matches.directions[:, 2], 0.0, atol=1e-12)
        if gain == 0.0:
            assert np.median(np.abs(matches.residuals)) < 1e-9
        else:
            assert np.abs(matches.residuals).max() > 0.9 * pixel


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("gap", "degrees"), [(60, 0.0), (60, 20.0), (90, 20.0)])
@pytest.mark.parametrize("residual", ["point, image", "normal", "point"])
def test_mm_icc_keeps_and_finds_the_truth(
    model: CameraModel, gap: int, degrees: float, residual: str
):
    """Right to half a pixel, where point to plane finds no match at all; in space less closely.

    A pixel is 0.6 % of the diameter and 0.7 degrees at half of it. In space the depth of a contour
    point is that of the last pixel before the outline, where a surface turns away from the sensor:
    it is off by more than the pixel, so that twice as much is allowed.
    """
    pair = creature_pair(gap, model)
    config = ContoursConfig.model_validate({"residual": residual})
    aligned, i_from_j = aligned_pair(pair, nudged(pair, degrees), config)
    angle, shift = pair.off_by(i_from_j)
    slack = 2.0 if residual == "point" else 1.0
    assert angle < 1.2 * slack
    assert shift < 0.005 * slack
    assert aligned.coherence > 0.5
    assert aligned.num_matches > 50


def test_wrong_poses_do_not_cohere_and_too_few_contours_leave_the_pose():
    """Scans whose contours see nothing of each other: the pose stays, and the answer says so."""
    pair = creature_pair(60)
    right, _ = aligned_pair(pair, pair.i_from_j)
    wrong, _ = aligned_pair(pair, nudged(pair, 120.0))
    assert wrong.coherence < 0.6 * right.coherence
    matcher = contour_matcher(pair.scans, CONFIG)
    matches = matcher.matches(1, matcher.pair(0, 1, pair.i_from_j.inverse()))
    pixel = pair.scans[1].image.pixel
    assert len(matches) > 20
    assert np.abs(matches.residuals).max() <= 4 * pixel
    seen, _ = pair.scans[1].image.camera.project(matches.points)
    assert (np.abs(seen - seen.round()) < 1e-6).all()
    start = Pose.exp([0, 0, 0, 1e3 * pair.diameter, 0, 0]) @ pair.i_from_j
    aligned, _ = aligned_pair(pair, start)
    assert aligned.num_matches == 0 and aligned.coherence == 0.0
    assert not aligned.converged and aligned.loose == (1,)
    np.testing.assert_array_equal(aligned.poses[1].matrix(), start.matrix())
