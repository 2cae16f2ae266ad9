"""Where the sensor stood: exact cameras on rendered grids, directions and sides on real scans."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter
from scanweld.io import read_scan
from scanweld.preparation import prepare
from scanweld.preparation.resolution import point_spacing
from scanweld.preparation.sensor import locate_sensor
from tests.data import require_data
from tests.depth_scans import angles_deg
from tests.prepared import moved
from tests.scenes import random_motion

PINHOLE = Camera(
    model=CameraModel.PINHOLE, width=200, height=160, fx=220.0, fy=200.0, cx=95.0, cy=83.0
)
ORTHOGRAPHIC = Camera(
    model=CameraModel.ORTHOGRAPHIC, width=200, height=160, fx=50.0, fy=40.0, cx=95.0, cy=83.0
)
MIRRORS = {
    "as seen": lambda grid: grid,
    "rows up": lambda grid: grid[::-1],
    "columns leftwards": lambda grid: grid[:, ::-1],
    "upside down": lambda grid: grid[::-1, ::-1],
    "transposed": lambda grid: grid.T,
}
BUNNY = [f"stanford-bunny/{name}.ply" for name in ("bun000", "bun090", "chin", "top3")]
DRAGON = [f"stanford-dragon/dragonStandRight_{angle}.ply" for angle in range(0, 360, 72)]


def lumpy_depth(x: FloatArray, y: FloatArray) -> FloatArray:
    """A lumpy ellipsoid about (0.1, 0, 5), as depth over the ray's x/z, y/z or x, y."""
    with np.errstate(invalid="ignore"):
        bulge = np.sqrt(1 - ((x - 0.1) / 1.2) ** 2 - (y / 0.95) ** 2)
    return 5 - bulge + 0.06 * np.sin(6 * x) * np.cos(5 * y + 1)


def render(camera: Camera) -> FloatArray:
    """Points (H, W, 3) that the camera sees of the lumpy body, NaN beside it."""
    rows, columns = np.mgrid[: camera.height, : camera.width].astype(float)
    reach = 1.0 if camera.model is CameraModel.ORTHOGRAPHIC else 4.5
    x = reach * (columns - camera.cx) / camera.fx
    y = reach * (rows - camera.cy) / camera.fy
    return camera.unproject_image(lumpy_depth(x, y))


def organised(image: FloatArray, pose: Pose, name: str = "body") -> RangeScan:
    """A scan with a grid from an image (H, W, 3) of points in the sensor frame."""
    seen = np.isfinite(image[..., 2])
    grid = np.full(seen.shape, -1)
    grid[seen] = np.arange(seen.sum())
    return RangeScan(name=name, points=pose.apply(image[seen]), grid=grid)


def any_pose(seed: int) -> Pose:
    return random_motion(np.random.default_rng(seed), 20.0)


def viewing(scan: RangeScan) -> FloatArray:
    """The viewing direction that was found, in the scan frame."""
    return scan.sensor_pose.rotation[:, 2]


def grid_faces(grid: IntArray) -> IntArray:
    """Two faces a cell, counter-clockwise from the sensor if rows go down and columns right."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([c, b, d], -1)]).reshape(-1, 3)
    return faces[(faces >= 0).all(axis=1)]


@pytest.mark.parametrize("mirror", MIRRORS)
@pytest.mark.parametrize("camera", [PINHOLE, ORTHOGRAPHIC], ids=["pinhole", "orthographic"])
def test_camera_behind_a_grid_is_recovered(camera: Camera, mirror: str):
    pose = any_pose(len(mirror))
    scan = organised(render(camera), pose)
    assert scan.grid is not None
    found = locate_sensor(replace(scan, grid=MIRRORS[mirror](scan.grid)))
    assert found.viewpoint is Viewpoint.FITTED and found.grid is not None
    assert found.camera is not None and found.camera.model is camera.model
    assert (found.camera.height, found.camera.width) == found.grid.shape
    rows, columns = np.nonzero(found.grid >= 0)
    in_sensor = found.sensor_pose.inverse().apply(found.points[found.grid[rows, columns]])
    pixels, depth = found.camera.project(in_sensor)
    assert np.abs(pixels - np.stack([columns, rows], axis=1)).max() < 1e-6
    assert depth.min() > 0
    assert angles_deg(viewing(found), pose.rotation[:, 2]) < 1e-5
    if camera.model is CameraModel.PINHOLE:
        assert np.allclose(found.sensor_pose.translation, pose.translation, atol=1e-6)
        assert sorted([found.camera.fx, found.camera.fy]) == pytest.approx([200, 220], abs=1e-5)
        noise = np.random.default_rng(0).normal(scale=1e-3, size=scan.points.shape)
        single = (scan.points + noise).astype(np.float32)
        rough = locate_sensor(replace(scan, points=single))
        shift = rough.sensor_pose.translation - pose.translation
        assert np.linalg.norm(shift) < 0.01 * 5 and rough.camera is not None
        assert sorted([rough.camera.fx, rough.camera.fy]) == pytest.approx([200, 220], rel=0.01)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000), scale=st.sampled_from([1e-3, 1.0, 1e4]))
def test_side_of_an_orthographic_grid_does_not_depend_on_frame_or_unit(seed: int, scale: float):
    pose = any_pose(seed)
    scan = organised(render(ORTHOGRAPHIC), pose)
    found = locate_sensor(replace(scan, points=scale * scan.points))
    assert angles_deg(viewing(found), pose.rotation[:, 2]) < 1e-5
    assert found.camera is not None
    assert found.camera.fx == pytest.approx(50 / scale)


@pytest.mark.parametrize("oblique_deg", [0.0, 28.0])
def test_line_scanner_is_seen_along_its_fan(oblique_deg: float):
    """Columns step along x, seen obliquely or not; rows fan out from the line y = 0, z = 0."""
    rows, columns = np.mgrid[:160, :200].astype(float)
    x, y = (columns - 95) / 50, (rows - 83) / 40
    z = lumpy_depth(x, y)
    image = np.stack([x + np.tan(np.radians(oblique_deg)) * (z - 5), y * z / 5, z], axis=-1)
    scan = organised(image, pose := any_pose(7))
    found = locate_sensor(scan)
    centre = pose.inverse().apply(scan.points.mean(axis=0))
    truth = np.array([np.tan(np.radians(oblique_deg / 2)), centre[1] / centre[2], 1.0])
    assert found.camera is None and found.viewpoint is Viewpoint.FITTED
    assert angles_deg(viewing(found), pose.turn(truth)) < 1.0
    assert any("halfway" in note for note in found.notes) == (oblique_deg > 0)


@pytest.mark.slow
@pytest.mark.parametrize("path", BUNNY + DRAGON)
def test_real_grids_give_the_viewing_direction_in_any_frame(path: str):
    """Truth: -z of the file; the bunny's rays lean by 3.4 deg, the dragon's camera by 28 deg."""
    scan = read_scan(require_data(path))
    found = locate_sensor(scan)
    assert angles_deg(viewing(found), np.array([0, 0, -1.0])) < (4 if path in BUNNY else 18)
    assert found.viewpoint is Viewpoint.FITTED
    assert found.scan_from_sensor is not None
    assert found.scan_from_sensor.inverse().apply(scan.points)[:, 2].min() > 0
    pose = any_pose(len(scan.points))
    turned = locate_sensor(moved(scan, pose))
    assert np.abs(viewing(turned) - pose.turn(viewing(found))).max() < 1e-6


@pytest.mark.parametrize("path", [BUNNY[0], BUNNY[2], DRAGON[0], DRAGON[3]])
def test_viewpoint_of_bare_points_is_estimated(path: str):
    scan = replace(read_scan(require_data(path)), grid=None)
    truth = np.array([-0.24 if path in DRAGON else 0, -0.06, -1])
    pose = any_pose(len(scan.points))
    found = locate_sensor(moved(scan, pose))
    assert found.viewpoint is Viewpoint.ESTIMATED and "estimated" in " ".join(found.notes)
    assert angles_deg(viewing(found), pose.turn(truth)) < 15


def test_estimate_turns_with_the_points_and_ignores_the_unit():
    image = render(PINHOLE)
    scan = replace(organised(image, Pose.identity()), grid=None)
    pose = any_pose(5)
    found = locate_sensor(scan)
    turned = locate_sensor(replace(scan, points=1e3 * pose.apply(scan.points)))
    assert angles_deg(viewing(found), np.array([0, 0, 1.0])) < 10
    assert angles_deg(viewing(turned), pose.turn(viewing(found))) < 1.0


def test_winding_of_an_open_mesh_and_normals_tell_the_side():
    """A hollow bowl falls off the wrong way; its winding knows better, and the doubt is told."""
    scan = organised(render(ORTHOGRAPHIC), pose := any_pose(11))
    assert scan.grid is not None
    faces = grid_faces(scan.grid)
    front = locate_sensor(replace(scan, grid=None, faces=faces))
    hollow = locate_sensor(replace(scan, grid=None, faces=faces[:, ::-1]))
    assert angles_deg(viewing(front), pose.rotation[:, 2]) < 10
    assert angles_deg(viewing(hollow), -pose.rotation[:, 2]) < 10
    assert any("contradict" in note for note in hollow.notes)
    assert not any("contradict" in note for note in front.notes)
    scan = organised(render(ORTHOGRAPHIC), pose := any_pose(12))
    normals = np.tile(pose.rotation[:, 2], (len(scan.points), 1))
    found = locate_sensor(replace(scan, grid=None, normals=normals))
    assert angles_deg(viewing(found), -pose.rotation[:, 2]) < 10


def test_complete_model_is_called_one_and_what_is_no_surface_refused():
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(4000, 3)) * (1.0, 1.2, 0.8)
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    found = locate_sensor(RangeScan(name="ball", points=ball))
    assert any("complete model" in note for note in found.notes)
    line = np.linspace(0, 1, 100)[:, None] * np.array([1.0, 2.0, 3.0])
    for points, told in (
        (rng.normal(size=(10, 3)), "it: a scan of 10 points"),
        (line, "one line"),
        (np.ones((100, 3)), "one line"),
    ):
        with pytest.raises(InputError, match=told):
            locate_sensor(RangeScan(name="it", points=points))


def test_flat_scan_is_seen_squarely_and_its_side_called_a_guess():
    rows, columns = np.mgrid[:60, :80].astype(float)
    image = np.stack([columns, rows, np.zeros_like(rows)], axis=-1)
    scan = organised(image, pose := any_pose(2))
    for flat in (scan, replace(scan, grid=None)):
        found = locate_sensor(flat)
        tilt = angles_deg(viewing(found), pose.rotation[:, 2])
        assert min(tilt, 180 - tilt) < 2
        assert any("guess" in note for note in found.notes)


def test_grid_that_does_not_fit_its_points_is_not_believed():
    scan = organised(render(PINHOLE), pose := any_pose(4))
    assert scan.grid is not None
    shuffled = scan.grid.copy()
    shuffled[shuffled >= 0] = np.random.default_rng(0).permutation(shuffled[shuffled >= 0])
    row = np.arange(len(scan.points))[None]
    for grid in (shuffled, None, row, np.zeros((20, 20), dtype=int), np.full((20, 20), -1)):
        found = locate_sensor(replace(scan, grid=grid))
        assert found.viewpoint is Viewpoint.ESTIMATED and found.camera is None
        assert angles_deg(viewing(found), pose.rotation[:, 2]) < 10


def test_given_sensor_is_kept_and_one_without_a_camera_stands_well_before_the_object():
    scan = organised(render(PINHOLE), Pose.identity())
    given_scan = replace(scan.with_sensor(Pose.identity(), Viewpoint.GIVEN), camera=PINHOLE)
    assert locate_sensor(given_scan) is given_scan
    found = locate_sensor(replace(scan, grid=None))
    distance = np.linalg.norm(found.sensor_pose.translation - scan.points.mean(axis=0))
    assert distance == pytest.approx(2 * principal_diameter(scan.points))


@pytest.mark.parametrize("has_grid", [True, False])
def test_camera_without_a_pose_holds_only_where_the_points_fit_it(has_grid: bool):
    scan = replace(organised(render(PINHOLE), Pose.identity()), camera=PINHOLE)
    scan = scan if has_grid else replace(scan, grid=None)
    at_home = locate_sensor(scan)
    assert at_home.camera == PINHOLE and at_home.scan_from_sensor is not None
    assert np.array_equal(at_home.scan_from_sensor.matrix(), np.eye(4))
    pose = any_pose(9)
    away = locate_sensor(moved(scan, pose))
    assert angles_deg(viewing(away), pose.rotation[:, 2]) < (1e-5 if has_grid else 10)
    assert (away.camera is not None) == has_grid


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_point_spacing_of_a_lattice(scale: float):
    rows, columns = np.mgrid[:70, :90].astype(float)
    lattice = scale * np.stack([columns.ravel(), 3 * rows.ravel(), 0 * rows.ravel()], axis=1)
    assert point_spacing(lattice) == pytest.approx(scale)
    assert point_spacing(np.repeat(lattice, 2, axis=0)) == pytest.approx(scale)
    planes = np.concatenate([lattice, lattice + np.array([0.0, 0.0, 1e4 * scale])])
    assert point_spacing(planes + 1e6 * scale) == pytest.approx(scale)


@pytest.mark.parametrize("copies", [1, 3, 4])
def test_point_spacing_is_what_a_tree_finds(copies: int):
    points = np.repeat(np.random.default_rng(0).normal(size=(700, 3)), copies, axis=0)
    distances = np.linalg.norm(points[::copies, None] - points[None, ::copies], axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = np.median(distances.min(axis=1))
    assert point_spacing(points) == pytest.approx(0.0 if copies == 4 else nearest)
    assert point_spacing(points[:1]) == 0.0


def around(width: int, turn: float, *, step: float = 2 * np.pi / 1600, up: int = 1) -> RangeScan:
    """A lumpy body 5 away, seen by a scanner at the origin that turns about z.

    Args:
        width: Columns, from the azimuth ``turn`` on; they grow with it.
        turn: In radians.
        step: Between columns and between rows, likewise.
        up: 1 if rows count upward, -1 if downward.
    """
    rows, columns = np.mgrid[:160, :width].astype(float)
    azimuth, elevation = turn + step * columns, up * step * (rows - 70)
    away = (azimuth + np.pi) % (2 * np.pi) - np.pi
    with np.errstate(invalid="ignore"):
        bulge = np.sqrt(1 - (away / 0.25) ** 2 - (elevation / 0.2) ** 2)
    distance = 5 - bulge + 0.06 * np.sin(20 * away) * np.cos(25 * elevation)
    level = distance * np.cos(elevation)
    points = [level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)]
    return organised(np.stack(points, axis=-1), Pose.identity())


@pytest.mark.parametrize("up", [1, -1])
@pytest.mark.parametrize(
    ("width", "turn"), [(1600, -np.pi), (1600, 0.0), (1595, 0.01), (200, -0.4)]
)
def test_scanner_that_turns_is_found_wherever_its_grid_begins(width: int, turn: float, up: int):
    found = locate_sensor(around(width, turn, up=up))
    camera = found.camera
    assert camera is not None and camera.model is CameraModel.SPHERICAL and found.grid is not None
    rows, columns = np.nonzero(found.grid >= 0)
    in_sensor = found.sensor_pose.inverse().apply(found.points[found.grid[rows, columns]])
    pixels, _ = camera.project(in_sensor)
    assert np.abs(pixels - np.stack([columns, rows], axis=1)).max() < 1e-6
    assert np.array_equal(found.sensor_pose.translation, np.zeros(3))
    assert angles_deg(viewing(found), np.array([1.0, 0, 0])) < 1.0
    prepared = prepare(found, PrepareConfig())
    assert prepared.image.camera.model is CameraModel.PINHOLE


def test_scanner_amid_what_it_saw_is_refused():
    scan = around(200, -0.4)
    assert scan.grid is not None
    wide = np.full((160, 1600), -1)
    wide[:, :200] = scan.grid
    wide[:, 800:1000] = np.where(scan.grid >= 0, scan.grid + len(scan.points), -1)
    both = replace(scan, points=np.concatenate([scan.points, scan.points * (-1, -1, 1)]), grid=wide)
    with pytest.raises(InputError, match="amid what it saw"):
        locate_sensor(both)
