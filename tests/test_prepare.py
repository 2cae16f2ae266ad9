"""Preparing scans: what the sensor saw and did not see, normals, samples, rims, odd scans."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.primitives import box, sphere
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind, PreparedScan
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.prepare import prepare
from scanweld.prepare.sampling import farthest_points
from scanweld.prepare.silhouette import classify_pixels, close
from tests.prepared import creature_pair, moved, scaled
from tests.scenes import pair_at_gap, random_motion

CONFIG = PrepareConfig()
MODELS = (CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC)
RADIUS = 50.0


@lru_cache
def ball(model: CameraModel) -> tuple[PreparedScan, FloatArray]:
    """A ball, prepared, and its centre (3,) in the sensor frame."""
    mesh = sphere(RADIUS)
    view = view_of(mesh, 40, 20, 70, pixels=120, model=model)
    motion = random_motion(np.random.default_rng(4), 200.0)
    scan = scan_mesh(mesh, view.camera, view.world_from_sensor, scan_from_sensor=motion)
    return prepare(scan, CONFIG), view.world_from_sensor.inverse().translation


def ortho(width: int, height: int) -> Camera:
    """One unit a pixel."""
    return Camera(
        model=CameraModel.ORTHOGRAPHIC, width=width, height=height, fx=1, fy=1, cx=0, cy=0
    )


def scan_of_depth(depth: FloatArray, camera: Camera | None = None) -> RangeScan:
    """A scan of a depth image (H, W), NaN where nothing was seen, in the sensor's frame."""
    camera = camera or ortho(depth.shape[1], depth.shape[0])
    has = np.isfinite(depth)
    grid = np.full(depth.shape, -1)
    grid[has] = np.arange(has.sum())
    return RangeScan(
        name="drawn",
        points=camera.unproject_image(depth)[has],
        grid=grid,
        camera=camera,
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
    )


def bumps(rows: int = 90, columns: int = 90, margin: int = 15) -> FloatArray:
    """Depth of a wavy patch in the middle of the image, nothing around it."""
    v, u = np.mgrid[:rows, :columns]
    depth = 200 + 4 * np.sin(u / 9) + 5 * np.cos(v / 11)
    inside = (np.minimum(u, columns - 1 - u) >= margin) & (np.minimum(v, rows - 1 - v) >= margin)
    return np.where(inside, depth, np.nan)


def xy_of(scan: PreparedScan) -> tuple[FloatArray, FloatArray]:
    """Coordinates (H, W) of the image's pixels in the plane of an orthographic scan."""
    ones = scan.image.camera.unproject_image(np.ones(scan.image.depth.shape))
    return ones[..., 0], ones[..., 1]


def kind_at(scan: PreparedScan, x: float, y: float) -> PixelKind:
    """Kind of the pixel at (x, y) of an orthographic scan."""
    camera = scan.image.camera
    column, row = round(camera.fx * x + camera.cx), round(camera.fy * y + camera.cy)
    return PixelKind(scan.image.kind[row, column])


def angles_deg(a: FloatArray, b: FloatArray) -> FloatArray:
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.degrees(np.arctan2(sine, (a * b).sum(axis=-1)))


# What the sensor saw


@pytest.mark.parametrize("model", MODELS)
def test_the_image_of_a_ball_is_the_ball(model: CameraModel):
    scan, centre = ball(model)
    image = scan.image
    has = np.isfinite(image.depth)
    assert image.camera.model is model
    np.testing.assert_array_equal(image.kind == PixelKind.SURFACE, has)
    radii = np.linalg.norm(image.points()[has & ~image.is_rim] - centre, axis=1)
    np.testing.assert_allclose(radii, RADIUS, atol=0.3 * image.pixel)
    assert scan.diameter == pytest.approx(2 * RADIUS * np.sqrt(2.25), rel=0.04)
    assert image.pixel == pytest.approx(scan.resolution, rel=1e-9)
    radius = RADIUS
    if model is CameraModel.PINHOLE:
        half_angle = np.arcsin(RADIUS / np.linalg.norm(centre))
        radius = np.median(image.depth[has]) * np.tan(half_angle)
    assert has.sum() * image.pixel**2 == pytest.approx(np.pi * radius**2, rel=0.06)


@pytest.mark.parametrize("model", MODELS)
def test_normals_of_a_ball(model: CameraModel):
    scan, centre = ball(model)
    image = scan.image
    points = image.points()
    outward = (points - centre) / RADIUS
    facing = -np.einsum("hwk,hwk->hw", image.camera.view_directions(points), outward)
    has = np.isfinite(image.depth)
    np.testing.assert_allclose(np.linalg.norm(image.normals[has], axis=1), 1.0)
    inner = has & ~image.is_rim & (np.nan_to_num(facing) > 0.3)
    off = angles_deg(image.normals[inner], outward[inner])
    assert np.median(off) < 0.7 and off.max() < 4.0
    toward = np.einsum("hwk,hwk->hw", image.camera.view_directions(points), image.normals)
    assert (toward[has] < 0).all()
    off = angles_deg(scan.samples.normals, (scan.samples.points - centre) / RADIUS)
    assert np.median(off) < 0.7


def test_the_mesh_is_the_image():
    """Vertices are the surface pixels in row-major order; faces look to the sensor."""
    scan = creature_pair(30).scans[0]
    image, mesh = scan.image, scan.mesh
    has = np.isfinite(image.depth)
    np.testing.assert_array_equal(mesh.vertices, image.points()[has])
    np.testing.assert_array_equal(mesh.normals, image.normals[has])
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    looks = np.einsum("fk,fk->f", face_normals(mesh.vertices, mesh.faces), middle)
    assert (looks < 0).all()
    depth = mesh.vertices[mesh.faces][..., 2]
    assert np.ptp(depth, axis=1).max() <= CONFIG.jump_pixels * image.pixel


# Free and unknown


def ring() -> PreparedScan:
    """A flat ring, radii 20 and 50, from above."""
    made = trimesh.creation.annulus(r_min=20, r_max=50, height=10, sections=128)
    mesh = TriangleMesh(vertices=np.asarray(made.vertices), faces=np.asarray(made.faces))
    view = view_of(mesh, 0, 90, pixels=120, model=CameraModel.ORTHOGRAPHIC)
    return prepare(scan_mesh(mesh, view.camera, view.world_from_sensor), CONFIG)


def test_an_enclosed_hole_is_unknown_and_the_outside_is_free():
    scan = ring()
    x, y = xy_of(scan)
    radius, kind = np.hypot(x, y), scan.image.kind
    slack = 1.5 * scan.image.pixel
    assert (kind[radius < 20 - slack] == PixelKind.UNKNOWN).all()
    assert (kind[(radius > 20 + slack) & (radius < 50 - slack)] == PixelKind.SURFACE).all()
    assert scan.scan.camera is not None
    reach = 0.5 * scan.scan.camera.width / scan.scan.camera.fx
    in_view = np.maximum(np.abs(x), np.abs(y)) < reach - scan.image.pixel
    assert (kind[in_view & (radius > 50 + slack)] == PixelKind.FREE).all()
    assert (kind[np.maximum(np.abs(x), np.abs(y)) > reach] == PixelKind.UNKNOWN).all()


def test_free_pixels_know_how_far_outside_they_are():
    scan = ring()
    x, y = xy_of(scan)
    is_free = scan.image.kind == PixelKind.FREE
    expected = np.hypot(x, y)[is_free] - 50
    np.testing.assert_allclose(scan.image.outside[is_free], expected, atol=1.5 * scan.image.pixel)
    assert (scan.image.outside[~is_free] == 0).all()


def test_the_image_has_free_space_all_around():
    """The border of the image is as wide as the closing: no surface touches it."""
    for model in MODELS:
        kind = ball(model)[0].image.kind
        border = np.concatenate([kind[0], kind[-1], kind[:, 0], kind[:, -1]])
        assert set(border) <= {PixelKind.FREE, PixelKind.UNKNOWN}


def test_beyond_the_field_of_view_nothing_is_known():
    """The right half of the patch is outside the image: there is no free space to the right."""
    depth = bumps()
    whole, cut = (
        prepare(scan_of_depth(depth), CONFIG),
        prepare(scan_of_depth(depth[:, :45]), CONFIG),
    )
    for x in (46.0, 48.0):
        assert kind_at(whole, x, 45) is PixelKind.SURFACE
        assert kind_at(cut, x, 45) is PixelKind.UNKNOWN
    x, _ = xy_of(cut)
    assert (cut.image.kind[x > 45] == PixelKind.UNKNOWN).all()
    for scan in (whole, cut):
        assert kind_at(scan, 11, 45) is PixelKind.FREE
        assert kind_at(scan, 30, 11) is PixelKind.FREE


def test_a_gap_that_the_field_of_view_cuts_off_is_unknown():
    """A horseshoe, open to the right, where the image ends: its inside may be a hole."""
    depth = bumps()
    depth[30:60, 30:] = np.nan
    whole, cut = (
        prepare(scan_of_depth(depth), CONFIG),
        prepare(scan_of_depth(depth[:, :70]), CONFIG),
    )
    assert kind_at(whole, 60, 45) is PixelKind.FREE
    assert kind_at(cut, 60, 45) is PixelKind.UNKNOWN
    assert kind_at(cut, 40, 11) is PixelKind.FREE


def test_without_a_camera_the_field_of_view_is_not_held_against_the_scan():
    scan = scan_of_depth(bumps()[:, :45])
    blind = replace(scan, camera=None, grid=None)
    prepared = prepare(blind, CONFIG)
    assert prepared.image.camera.model is CameraModel.ORTHOGRAPHIC
    assert (prepared.image.kind == PixelKind.FREE).any()


def test_lost_returns_are_filled_or_unknown_never_free():
    depth = bumps()
    rng = np.random.default_rng(8)
    depth[rng.random(depth.shape) < 0.1] = np.nan
    depth[40:52, 40:52] = np.nan
    scan = prepare(scan_of_depth(depth), CONFIG)
    x, y = xy_of(scan)
    inside = (np.abs(x - 44.5) < 28) & (np.abs(y - 44.5) < 28)
    kind = scan.image.kind
    assert (kind[inside] != PixelKind.FREE).all()
    assert kind_at(scan, 46, 46) is PixelKind.UNKNOWN
    lost = np.isnan(depth[17:38, 17:38]).mean()
    patch = (np.abs(x - 27) < 10) & (np.abs(y - 27) < 10)
    assert (kind[patch] != PixelKind.SURFACE).mean() < 0.2 * lost


def notched(width: int) -> BoolArray:
    mask = np.zeros((80, 80), dtype=bool)
    mask[20:60, 20:60] = True
    mask[20:45, 40 - width // 2 : 40 + width // 2] = False
    return mask


def test_a_narrow_notch_is_unknown_a_wide_one_free():
    """A gap narrower than twice the closing radius may as well be a shadow."""
    everywhere = np.ones((80, 80), dtype=bool)
    narrow, _ = classify_pixels(notched(6), everywhere, 5.0)
    wide, outside = classify_pixels(notched(24), everywhere, 5.0)
    assert narrow[25, 40] == PixelKind.UNKNOWN
    assert wide[25, 40] == PixelKind.FREE
    assert outside[25, 40] == pytest.approx(12, abs=1.5)


def test_closing_changes_nothing_convex_and_shrinks_nothing():
    v, u = np.mgrid[:60, :60]
    disc = np.hypot(u - 30, v - 30) <= 15
    np.testing.assert_array_equal(close(disc, 6.0), disc)
    comb = notched(4)
    assert (close(comb, 4.0) >= comb).all() and close(comb, 4.0)[30, 40]
    np.testing.assert_array_equal(close(comb, 0.0), comb)


# Jumps, rims, pieces


def step(height: float) -> PreparedScan:
    """Two flat halves, the right one farther away by a height."""
    depth = np.full((90, 90), np.nan)
    depth[15:75, 15:45] = 200.0
    depth[15:75, 45:75] = 200.0 + height
    return prepare(scan_of_depth(depth), CONFIG)


def test_the_surface_is_cut_at_a_jump_and_both_sides_are_rim():
    scan = step(20.0)
    depth = scan.mesh.vertices[scan.mesh.faces][..., 2]
    assert np.ptp(depth, axis=1).max() == 0
    for x in (43.0, 44.0, 45.0, 46.0):
        column = round(x + scan.image.camera.cx)
        row = round(45 + scan.image.camera.cy)
        assert scan.image.is_rim[row, column]
    assert np.abs(scan.samples.points[:, 0] - 44.5).min() > 1.5
    np.testing.assert_allclose(scan.samples.normals, [[0, 0, -1]] * 800, atol=1e-9)


def test_a_low_step_is_no_jump():
    scan = step(3.0)
    assert np.ptp(scan.mesh.vertices[scan.mesh.faces][..., 2], axis=1).max() == 3.0
    assert not scan.image.is_rim[round(45 + scan.image.camera.cy), round(45 + scan.image.camera.cx)]


def test_the_rim_surrounds_the_surface():
    image = creature_pair(30).scans[0].image
    has = np.isfinite(image.depth)
    assert not (image.is_rim & ~has).any()
    beside = np.zeros_like(has)
    beside[1:-1, 1:-1] = ~(has[:-2, 1:-1] & has[2:, 1:-1] & has[1:-1, :-2] & has[1:-1, 2:])
    assert image.is_rim[has & beside].all()
    assert 0.05 < image.is_rim[has].mean() < 0.6


def test_tiny_pieces_are_dropped():
    depth = bumps()
    depth[4:7, 4:7] = 150.0
    depth[45:48, 45:48] = 120.0
    scan = prepare(scan_of_depth(depth), CONFIG)
    assert scan.mesh.vertices[:, 2].min() > 180
    assert kind_at(scan, 5, 5) is PixelKind.FREE
    assert kind_at(scan, 46, 46) is PixelKind.UNKNOWN


def test_larger_pieces_stay():
    depth = bumps()
    depth[40:60, 40:60] = 120.0
    assert prepare(scan_of_depth(depth), CONFIG).mesh.vertices[:, 2].min() == pytest.approx(120)


# Samples


def test_every_prefix_of_the_samples_is_evenly_spread():
    scan = creature_pair(30).scans[0]
    points = scan.samples.points
    for count in (20, 100, 400):
        prefix = KDTree(points[:count])
        spacing = prefix.query(points[:count], k=2)[0][:, 1].min()
        reach = prefix.query(points)[0].max()
        assert reach <= spacing + 1e-9


def test_samples_are_even_by_area_not_by_pixel():
    """A box at an angle: each face gets its share of the area, however slanted it is."""
    mesh = box(60, 80, 100)
    view = view_of(mesh, 25, 20, pixels=150)
    scan = prepare(scan_mesh(mesh, view.camera, view.world_from_sensor), CONFIG)
    normals = view.world_from_sensor.turn(scan.samples.normals)
    share = [(normals[:, axis] > 0.9).mean() for axis in range(3)]
    area = np.array([80 * 100, 60 * 100, 60 * 80], dtype=float)
    np.testing.assert_allclose(share, area / area.sum(), atol=0.05)


def test_samples_lie_on_the_surface_off_the_rim_and_not_at_grazing_incidence():
    scan = creature_pair(30).scans[0]
    image, samples = scan.image, scan.samples
    pixels, depth = image.camera.project(samples.points)
    column, row = np.rint(pixels).astype(int).T
    np.testing.assert_allclose(depth, image.depth[row, column])
    np.testing.assert_array_equal(samples.normals, image.normals[row, column])
    assert not image.is_rim[row, column].any()
    toward = -(image.camera.view_directions(samples.points) * samples.normals).sum(axis=1)
    assert toward.min() > CONFIG.min_cosine


def test_as_many_samples_as_asked_for():
    scan = ball(MODELS[0])[0].scan
    assert len(prepare(scan, CONFIG).samples.points) == CONFIG.num_samples
    assert len(prepare(scan, PrepareConfig(num_samples=150)).samples.points) == 150


def test_farthest_points_of_a_line():
    points = np.column_stack([np.arange(9.0), np.zeros(9), np.zeros(9)])
    chosen = farthest_points(points, 5).tolist()
    assert chosen[0] == 4
    assert sorted(chosen[:3]) == [0, 4, 8]
    assert sorted(chosen) == [0, 2, 4, 6, 8]
    assert len(farthest_points(points, 9, min_spacing=1.5)) == 5
    assert len(farthest_points(points[:0], 4)) == 0


# Other kinds of scans


def depths_at(scan: PreparedScan, points: FloatArray) -> FloatArray:
    pixels, depth = scan.image.camera.project(points)
    column, row = np.rint(pixels).astype(int).T
    return scan.image.depth[row, column] - depth


@pytest.mark.parametrize("keeps", ["points", "faces"])
def test_a_scan_without_a_grid_gives_the_same_surface(keeps: str):
    whole = creature_pair(30).scans[0]
    faces = None
    if keeps == "faces":
        faces = whole.mesh.faces
    bare = RangeScan(
        name="bare",
        points=whole.scan_from_sensor.apply(whole.mesh.vertices),
        faces=faces,
        scan_from_sensor=whole.scan_from_sensor,
        viewpoint=Viewpoint.GIVEN,
    )
    scan = prepare(bare, CONFIG)
    assert scan.diameter == pytest.approx(whole.diameter, rel=0.03)
    off = depths_at(scan, whole.samples.points)
    assert np.isfinite(off).mean() > 0.95
    assert np.nanmedian(np.abs(off)) < scan.image.pixel
    nearest = KDTree(whole.samples.points).query(scan.samples.points)[1]
    turn = angles_deg(scan.samples.normals, whole.samples.normals[nearest])
    assert np.median(turn) < 12


def test_a_fine_scan_is_thinned_to_the_working_resolution():
    scan = creature_pair(30).scans[0].scan
    coarse = prepare(scan, PrepareConfig(image_pixels=64))
    assert coarse.image.pixel == pytest.approx(coarse.diameter / 64)
    assert coarse.resolution < 0.8 * coarse.image.pixel


@pytest.mark.parametrize("model", MODELS)
def test_moving_a_scan_changes_nothing_seen_from_its_sensor(model: CameraModel):
    before = creature_pair(30, model).scans[0]
    motion = random_motion(np.random.default_rng(1), 5e3)
    after = prepare(moved(before.scan, motion), CONFIG)
    assert after.resolution == pytest.approx(before.resolution)
    assert after.diameter == pytest.approx(before.diameter)
    assert after.image.depth.shape == before.image.depth.shape
    np.testing.assert_allclose(after.image.depth, before.image.depth, rtol=1e-6)
    np.testing.assert_array_equal(after.image.kind, before.image.kind)
    np.testing.assert_allclose(
        after.scan_from_sensor.matrix(), (motion @ before.scan_from_sensor).matrix(), atol=1e-6
    )


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("factor", [1e-3, 1024.0])
def test_another_unit_changes_nothing_but_the_unit(model: CameraModel, factor: float):
    before = creature_pair(30, model).scans[0]
    after = prepare(scaled(before.scan, factor), CONFIG)
    assert after.resolution == pytest.approx(factor * before.resolution)
    assert after.diameter == pytest.approx(factor * before.diameter)
    assert after.image.pixel == pytest.approx(factor * before.image.pixel)
    np.testing.assert_allclose(after.image.depth, factor * before.image.depth, rtol=1e-6)
    np.testing.assert_allclose(after.image.normals, before.image.normals, atol=1e-5)
    np.testing.assert_allclose(after.image.outside, factor * before.image.outside, rtol=1e-6)
    np.testing.assert_allclose(after.samples.points, factor * before.samples.points, rtol=1e-6)


def test_the_content_hash_knows_content_not_name():
    scan = creature_pair(30).scans[0].scan
    points = scan.points.copy()
    points[0, 0] = np.nextafter(points[0, 0], np.inf)
    assert prepare(replace(scan, name="other"), CONFIG).content_hash == scan.content_hash()
    assert replace(scan, points=points).content_hash() != scan.content_hash()


def test_the_same_scan_gives_the_same_bytes():
    scan = pair_at_gap(30, pixels=100)[0]
    a, b = prepare(scan, CONFIG), prepare(scan, CONFIG)
    assert a.samples.points.tobytes() == b.samples.points.tobytes()
    assert a.image.normals.tobytes() == b.image.normals.tobytes()


def test_a_scan_with_hardly_any_surface_is_refused():
    rng = np.random.default_rng(0)
    cloud = RangeScan(
        name="dust",
        points=rng.uniform(-100, 100, size=(120, 3)) + np.array([0, 0, 500]),
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
    )
    with pytest.raises(InputError, match=r"^dust: only \d+ pixels of connected surface"):
        prepare(cloud, CONFIG)


def test_a_scan_of_a_few_points_is_refused():
    depth = np.full((90, 90), np.nan)
    depth[40:43, 40:43] = 100
    with pytest.raises(InputError, match=r"^drawn: a scan of 9 points"):
        prepare(scan_of_depth(depth), CONFIG)
