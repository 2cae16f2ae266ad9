"""Preparing scans: what the sensor saw and did not see, normals, samples, rims, odd scans."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.primitives import box
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind, PreparedScan
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.preparation import prepare
from scanweld.preparation.sampling import farthest_points
from tests.depth_scans import (
    CONFIG,
    MODELS,
    RADIUS,
    angles_deg,
    ball,
    bumps,
    kind_at,
    scan_of_depth,
)
from tests.prepared import creature_pair, moved, scaled
from tests.scenes import random_motion


@pytest.mark.parametrize("model", MODELS)
def test_the_image_and_the_normals_of_a_ball_are_the_ball(model: CameraModel):
    scan, centre = ball(model)
    image, points = scan.image, scan.image.points()
    has = np.isfinite(image.depth)
    assert image.camera.model is model
    np.testing.assert_array_equal(image.kind == PixelKind.SURFACE, has)
    radii = np.linalg.norm(points[has & ~image.is_rim] - centre, axis=1)
    np.testing.assert_allclose(radii, RADIUS, atol=0.3 * image.pixel)
    assert scan.diameter == pytest.approx(2 * RADIUS * np.sqrt(2.25), rel=0.04)
    assert image.pixel == pytest.approx(scan.resolution, rel=1e-9)
    radius = RADIUS
    if model is CameraModel.PINHOLE:
        half_angle = np.arcsin(RADIUS / np.linalg.norm(centre))
        radius = np.median(image.depth[has]) * np.tan(half_angle)
    assert has.sum() * image.pixel**2 == pytest.approx(np.pi * radius**2, rel=0.06)
    outward, rays = (points - centre) / RADIUS, image.camera.view_directions(points)
    facing = -np.einsum("hwk,hwk->hw", rays, outward)
    np.testing.assert_allclose(np.linalg.norm(image.normals[has], axis=1), 1.0)
    inner = has & ~image.is_rim & (np.nan_to_num(facing) > 0.3)
    off = angles_deg(image.normals[inner], outward[inner])
    assert np.median(off) < 0.7 and off.max() < 4.0
    assert (np.einsum("hwk,hwk->hw", rays, image.normals)[has] < 0).all()
    off = angles_deg(scan.samples.normals, (scan.samples.points - centre) / RADIUS)
    assert np.median(off) < 0.7


def test_the_mesh_is_the_image_and_the_rim_surrounds_it():
    """Vertices are the surface pixels in row-major order; faces look to the sensor."""
    scan = creature_pair(30).scans[0]
    image, mesh = scan.image, scan.mesh
    has = np.isfinite(image.depth)
    np.testing.assert_array_equal(mesh.vertices, image.points()[has])
    np.testing.assert_array_equal(mesh.normals, image.normals[has])
    corners = mesh.vertices[mesh.faces]
    looks = face_normals(mesh.vertices, mesh.faces) * corners.mean(axis=1)
    assert (looks.sum(axis=1) < 0).all()
    assert np.ptp(corners[..., 2], axis=1).max() <= CONFIG.jump_pixels * image.pixel
    assert not (image.is_rim & ~has).any()
    beside = np.zeros_like(has)
    beside[1:-1, 1:-1] = ~(has[:-2, 1:-1] & has[2:, 1:-1] & has[1:-1, :-2] & has[1:-1, 2:])
    assert image.is_rim[has & beside].all()
    assert 0.05 < image.is_rim[has].mean() < 0.6


# Free and unknown


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
    scan = step(3.0)
    assert np.ptp(scan.mesh.vertices[scan.mesh.faces][..., 2], axis=1).max() == 3.0
    assert not scan.image.is_rim[round(45 + scan.image.camera.cy), round(45 + scan.image.camera.cx)]


def test_tiny_pieces_are_dropped_and_larger_ones_stay():
    depth = bumps()
    depth[4:7, 4:7] = 150.0
    depth[45:48, 45:48] = 120.0
    scan = prepare(scan_of_depth(depth), CONFIG)
    assert scan.mesh.vertices[:, 2].min() > 180
    assert kind_at(scan, 5, 5) is PixelKind.FREE
    assert kind_at(scan, 46, 46) is PixelKind.UNKNOWN
    depth = bumps()
    depth[40:60, 40:60] = 120.0
    assert prepare(scan_of_depth(depth), CONFIG).mesh.vertices[:, 2].min() == pytest.approx(120)


# Samples


def test_samples_are_even_by_area_not_by_pixel():
    """A box at an angle: each face gets its share of the area, however slanted it is."""
    mesh = box(60, 80, 100)
    view = view_of(mesh, 25, 20, pixels=150)
    scan = prepare(scan_mesh(mesh, view.camera, view.world_from_sensor), CONFIG)
    normals = view.world_from_sensor.turn(scan.samples.normals)
    share = [(normals[:, axis] > 0.9).mean() for axis in range(3)]
    area = np.array([80 * 100, 60 * 100, 60 * 80], dtype=float)
    np.testing.assert_allclose(share, area / area.sum(), atol=0.05)


def test_samples_lie_evenly_on_the_surface_off_the_rim_and_not_at_grazing_incidence():
    """Every prefix of them is as even as all."""
    scan = creature_pair(30).scans[0]
    image, samples = scan.image, scan.samples
    pixels, depth = image.camera.project(samples.points)
    column, row = np.rint(pixels).astype(int).T
    np.testing.assert_allclose(depth, image.depth[row, column])
    np.testing.assert_array_equal(samples.normals, image.normals[row, column])
    assert not image.is_rim[row, column].any()
    toward = -(image.camera.view_directions(samples.points) * samples.normals).sum(axis=1)
    assert toward.min() > CONFIG.min_cosine
    assert len(samples.points) == CONFIG.num_samples
    for count in (20, 100, 400):
        prefix = KDTree(samples.points[:count])
        spacing = prefix.query(samples.points[:count], k=2)[0][:, 1].min()
        assert prefix.query(samples.points)[0].max() <= spacing + 1e-9
    assert len(prepare(scan.scan, PrepareConfig(num_samples=150)).samples.points) == 150
    coarse = prepare(scan.scan, PrepareConfig(image_pixels=64))
    assert coarse.image.pixel == pytest.approx(coarse.diameter / 64)
    assert coarse.resolution < 0.8 * coarse.image.pixel


def test_farthest_points_of_a_line():
    points = np.column_stack([np.arange(9.0), np.zeros(9), np.zeros(9)])
    chosen = farthest_points(points, 5).tolist()
    assert chosen[0] == 4
    assert sorted(chosen[:3]) == [0, 4, 8]
    assert sorted(chosen) == [0, 2, 4, 6, 8]
    assert len(farthest_points(points, 9, min_spacing=1.5)) == 5
    assert len(farthest_points(points[:0], 4)) == 0


# Other kinds of scans


@pytest.mark.parametrize("keeps", ["points", "faces"])
def test_a_scan_without_a_grid_gives_the_same_surface(keeps: str):
    whole = creature_pair(30).scans[0]
    bare = RangeScan(
        name="bare",
        points=whole.scan_from_sensor.apply(whole.mesh.vertices),
        faces=whole.mesh.faces if keeps == "faces" else None,
        scan_from_sensor=whole.scan_from_sensor,
        viewpoint=Viewpoint.GIVEN,
    )
    scan = prepare(bare, CONFIG)
    assert scan.diameter == pytest.approx(whole.diameter, rel=0.03)
    pixels, depth = scan.image.camera.project(whole.samples.points)
    column, row = np.rint(pixels).astype(int).T
    off = scan.image.depth[row, column] - depth
    assert np.isfinite(off).mean() > 0.95
    assert np.nanmedian(np.abs(off)) < scan.image.pixel
    nearest = KDTree(whole.samples.points).query(scan.samples.points)[1]
    turn = angles_deg(scan.samples.normals, whole.samples.normals[nearest])
    assert np.median(turn) < 12


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("factor", [1.0, 1e-3, 1024.0])
def test_another_frame_or_unit_changes_nothing_but_the_unit(model: CameraModel, factor: float):
    before = creature_pair(30, model).scans[0]
    motion = random_motion(np.random.default_rng(1), 5e3)
    after = prepare(
        moved(before.scan, motion) if factor == 1.0 else scaled(before.scan, factor), CONFIG
    )
    for name in ("resolution", "diameter"):
        assert getattr(after, name) == pytest.approx(factor * getattr(before, name))
    assert after.image.pixel == pytest.approx(factor * before.image.pixel)
    np.testing.assert_allclose(after.image.depth, factor * before.image.depth, rtol=1e-6)
    np.testing.assert_array_equal(after.image.kind, before.image.kind)
    np.testing.assert_allclose(after.image.normals, before.image.normals, atol=1e-5)
    np.testing.assert_allclose(after.image.outside, factor * before.image.outside, rtol=1e-6)
    np.testing.assert_allclose(after.samples.points, factor * before.samples.points, rtol=1e-6)
    if factor == 1.0:
        want = (motion @ before.scan_from_sensor).matrix()
        np.testing.assert_allclose(after.scan_from_sensor.matrix(), want, atol=1e-6)


def test_the_content_hash_knows_content_not_name():
    scan = creature_pair(30).scans[0].scan
    points = scan.points.copy()
    points[0, 0] = np.nextafter(points[0, 0], np.inf)
    assert prepare(replace(scan, name="other"), CONFIG).content_hash == scan.content_hash()
    assert replace(scan, points=points).content_hash() != scan.content_hash()


def test_a_scan_with_hardly_any_surface_or_points_is_refused():
    cloud = RangeScan(
        name="dust",
        points=np.random.default_rng(0).uniform(-100, 100, size=(120, 3)) + np.array([0, 0, 500]),
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
    )
    with pytest.raises(InputError, match=r"^dust: only \d+ pixels of connected surface"):
        prepare(cloud, CONFIG)
    depth = np.full((90, 90), np.nan)
    depth[40:43, 40:43] = 100
    with pytest.raises(InputError, match=r"^drawn: a scan of 9 points"):
        prepare(scan_of_depth(depth), CONFIG)
