"""The virtual scanner against geometry worked out by hand."""

import numpy as np
import pytest

from scanweld.evaluation.primitives import box, sphere
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import Axis, View, overlap, seen_share, view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter
from tests.scenes import random_motion, small_creature

MODELS = (CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC)


def camera_of(model: CameraModel, pixels: int = 81) -> Camera:
    focal = 200.0 if model is CameraModel.PINHOLE else 2.0
    centre = 0.5 * (pixels - 1)
    return Camera(
        model=model, width=pixels, height=pixels, fx=focal, fy=1.1 * focal, cx=centre, cy=centre
    )


def depth_of(scan: RangeScan) -> FloatArray:
    """Depth (H, W) of a scan in its sensor frame, NaN where nothing was seen."""
    assert scan.grid is not None
    depth = np.append(scan.points[:, 2], np.nan)
    return depth[scan.grid]


def slanted_square(slope: float, depth: float = 100.0) -> TriangleMesh:
    """A large square in the plane z = depth + slope x, of two triangles, seen from z = 0."""
    corners = 300.0 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    vertices = np.column_stack([corners, depth + slope * corners[:, 0]])
    return TriangleMesh(vertices=vertices, faces=np.array([[0, 2, 1], [0, 3, 2]]))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("slope", [0.0, 0.25])
def test_depth_of_a_plane_is_exact(model: CameraModel, slope: float):
    camera = camera_of(model)
    scan = scan_mesh(slanted_square(slope), camera, Pose.identity())
    zero, one = (camera.unproject_image(np.full((camera.height, camera.width), d)) for d in (0, 1))
    expected = (100.0 + slope * zero[..., 0]) / (1.0 - slope * (one - zero)[..., 0])
    np.testing.assert_allclose(depth_of(scan), expected, rtol=1e-9)
    np.testing.assert_allclose(scan.points, camera.unproject_image(expected).reshape(-1, 3))


@pytest.mark.parametrize("model", MODELS)
def test_depth_of_a_ball_is_that_of_its_triangles(model: CameraModel):
    """Each point lies on the ball's facets, along its own pixel's ray, on the near side."""
    ball, camera = sphere(50.0), camera_of(model, 61)
    sensor = Pose(rotation=np.eye(3), translation=np.array([0.0, 0.0, -200.0]))
    scan = scan_mesh(ball, camera, sensor)
    depth = depth_of(scan)
    rows, columns = np.nonzero(np.isfinite(depth))
    pixels, _ = camera.project(scan.points)
    np.testing.assert_allclose(pixels, np.stack([columns, rows], axis=1), atol=1e-9)
    corners = ball.vertices[ball.faces]
    outward = face_normals(ball.vertices, ball.faces)
    some = scan.points[::37]
    world, away = sensor.apply(some), camera.view_directions(some)
    # The ball is convex: a point on it lies on one plane and behind all others.
    beyond = world @ outward.T - np.einsum("fk,fk->f", corners[:, 0], outward)
    np.testing.assert_allclose(beyond.max(axis=1), 0.0, atol=1e-9)
    assert (np.einsum("nk,nk->n", sensor.turn(away), outward[beyond.argmax(axis=1)]) < 0).all()
    radii = np.linalg.norm(sensor.apply(scan.points), axis=1)
    assert radii.min() > 49.9 and radii.max() < 50 + 1e-9


def test_the_scan_frame_moves_the_points_alone_and_a_seed_gives_the_same_bytes():
    mesh = small_creature()
    view = view_of(mesh, 30, 10, pixels=60)
    motion = random_motion(np.random.default_rng(0), 100.0)
    plain = scan_mesh(mesh, view.camera, view.world_from_sensor)
    moved = scan_mesh(mesh, view.camera, view.world_from_sensor, scan_from_sensor=motion)
    assert moved.viewpoint is Viewpoint.GIVEN
    np.testing.assert_array_equal(moved.grid, plain.grid)
    np.testing.assert_allclose(moved.points, motion.apply(plain.points), atol=1e-9)
    view = view_of(mesh, 0, pixels=80)
    noise = NoiseModel(depth_diameters=1e-3, dropout=0.1, grazing_dropout=0.5)
    first, again, other = (
        scan_mesh(mesh, view.camera, view.world_from_sensor, noise, seed=s) for s in (1, 1, 2)
    )
    assert first.content_hash() == again.content_hash() != other.content_hash()


@pytest.mark.parametrize("slope", [0.0, 1.0, 20.0])
def test_noise_grows_with_incidence_up_to_its_cap(slope: float):
    mesh = slanted_square(slope, depth=7000.0)
    camera = camera_of(CameraModel.ORTHOGRAPHIC, 161)
    noise = NoiseModel(depth_diameters=1e-3, max_growth=3.0)
    clean = depth_of(scan_mesh(mesh, camera, Pose.identity()))
    noisy = depth_of(scan_mesh(mesh, camera, Pose.identity(), noise, seed=3))
    sigma = 1e-3 * principal_diameter(mesh.vertices)
    growth = min(np.hypot(1.0, slope), 3.0)
    error = noisy - clean
    assert error.std() == pytest.approx(sigma * growth, rel=0.03)
    assert abs(error.mean()) < 0.05 * sigma * growth


def test_dropouts_are_more_where_the_surface_grazes():
    camera = camera_of(CameraModel.ORTHOGRAPHIC, 161)
    noise = NoiseModel(dropout=0.1, grazing_dropout=0.5)
    for slope in (0.0, 2.0):
        scan = scan_mesh(slanted_square(slope, 1000.0), camera, Pose.identity(), noise, seed=1)
        expected = 0.1 + 0.5 * (1 - 1 / np.hypot(1.0, slope)) ** 2
        assert np.isnan(depth_of(scan)).mean() == pytest.approx(expected, abs=0.01)
    mesh = small_creature()
    view = view_of(mesh, 0, pixels=80)
    scan = scan_mesh(mesh, view.camera, view.world_from_sensor, NoiseModel(quantum_diameters=1e-3))
    steps = scan.points[:, 2] / (1e-3 * principal_diameter(mesh.vertices))
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert len(np.unique(np.round(steps))) > 20


def test_colours_are_blended_between_vertices():
    """A colour that is linear in x and y stays so between the corners of a square."""
    square = slanted_square(0.0)
    x, y = square.vertices[:, 0], square.vertices[:, 1]
    colors = np.column_stack([(x + 300) / 4, (y + 300) / 4, np.full(4, 7.0)])
    mesh = TriangleMesh(
        vertices=square.vertices, faces=square.faces, colors=colors.astype(np.uint8)
    )
    scan = scan_mesh(mesh, camera_of(CameraModel.PINHOLE), Pose.identity())
    assert scan.colors is not None
    np.testing.assert_allclose(scan.colors[:, 0], (scan.points[:, 0] + 300) / 4, atol=0.51)
    np.testing.assert_allclose(scan.colors[:, 1], (scan.points[:, 1] + 300) / 4, atol=0.51)
    assert (scan.colors[:, 2] == 7).all()


@pytest.mark.parametrize(
    "values", [{"dropout": 1.5}, {"depth_diameters": -1e-3}, {"max_growth": 0.5}]
)
def test_impossible_noise_and_seeing_nothing_are_errors(values: dict[str, float]):
    with pytest.raises(ValueError):
        NoiseModel(**values)
    behind = Pose(rotation=np.eye(3), translation=np.array([0.0, 0.0, 500.0]))
    with pytest.raises(ValueError, match="sees nothing"):
        scan_mesh(sphere(), camera_of(CameraModel.PINHOLE), behind)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_views_hold_the_whole_object_at_the_size_asked_for(model: CameraModel, up: Axis):
    mesh = small_creature()
    diameter = principal_diameter(mesh.vertices)
    view = view_of(mesh, 40, 30, 70, pixels=90, model=model, up=up)
    pixels, depth = view.camera.project(view.world_from_sensor.inverse().apply(mesh.vertices))
    assert pixels.min() >= 0
    assert (pixels.max(axis=0) <= [view.camera.width - 1, view.camera.height - 1]).all()
    assert (depth > 0).all()
    assert view.camera.footprint(3.0 * diameter) == pytest.approx(diameter / 90)


@pytest.mark.parametrize(("roll", "row"), [(0.0, -1.0), (90.0, 0.0)])
def test_up_stays_up_in_the_image(roll: float, row: float):
    """A point above the middle appears above it: rows count downwards."""
    view = view_of(box(), 25, 10, roll)
    above = view.world_from_sensor.inverse().apply(np.array([[0.0, 0.0, 50.0]]))
    assert np.sign(np.round(above[0, 1], 9)) == row


def test_overlap_of_views_on_a_ball():
    """From far away two views of a ball share the part of a hemisphere not turned away."""
    mesh = sphere()
    views = [
        view_of(mesh, a, pixels=200, model=CameraModel.ORTHOGRAPHIC) for a in (0, 60, 120, 180)
    ]
    shares = [overlap(mesh, views[0], view) for view in views]
    np.testing.assert_allclose(shares, [1, 2 / 3, 1 / 3, 0], atol=0.03)


def test_overlap_knows_what_is_hidden():
    """A plate of 2 x 2 before one of 6 x 6, which it hides differently from aside.

    From ahead 4 of the 36 behind are hidden, from aside 2 others: both see 4 + 30.
    """
    front = np.array([[-1.0, -1, 10], [1, -1, 10], [1, 1, 10], [-1, 1, 10]])
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    both = TriangleMesh(
        vertices=np.concatenate([front, front * [3.0, 3.0, 2.0]]),
        faces=np.concatenate([faces, faces + 4]),
    )
    camera = Camera(
        model=CameraModel.ORTHOGRAPHIC, width=401, height=401, fx=20, fy=20, cx=200, cy=200
    )
    tilted = Pose.exp([0.0, np.arctan(0.3), 0.0, 0.0, 0.0, 0.0])
    ahead = View(camera=camera, world_from_sensor=Pose.identity())
    aside = View(camera=camera, world_from_sensor=tilted)
    assert seen_share(both, ahead, aside) == pytest.approx(34 / 36, abs=0.02)
    assert seen_share(both, aside, ahead) == pytest.approx(34 / 38, abs=0.02)
