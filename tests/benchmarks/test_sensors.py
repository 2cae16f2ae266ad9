"""What real sensors do, what people cut off, what does not move along: each is what it says."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import KDTree

from benchmarks.virtual import disturbances as harm
from benchmarks.virtual import sensors, trims
from benchmarks.virtual.bodies import Body, make_body
from benchmarks.virtual.depth_images import depth_of
from benchmarks.virtual.disturbances import alike, drawn, each, in_turn, one_of
from benchmarks.virtual.rooms import in_standing_room, turned_before_sensor, with_lid_opened
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Group, make_scene
from benchmarks.virtual.shots import SLIGHT, Shot, ring, take_shots
from scanweld.evaluation.primitives import box, sphere
from scanweld.evaluation.scanner import NoiseModel
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter

CLEAN = NoiseModel()


@cache
def ball() -> Shot:
    """A ball of radius 50, from three diameters away, 120 pixels across."""
    body = Body(sphere())
    views = ring(body, np.random.default_rng(0), count=1, pixels=(120.0,))
    return take_shots(body, views, CLEAN, 0)[0]


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def seen(scan: RangeScan) -> np.ndarray:
    assert scan.grid is not None
    return scan.grid >= 0


def away_from_axis(scan: RangeScan) -> FloatArray:
    """Angle (N,) in degrees between a ball's rays and its normals."""
    centre = np.array([0.0, 0.0, ball().pose.translation @ -ball().pose.rotation[:, 2]])
    normals = scan.points - centre
    rays = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
    cosine = -np.sum(normals * rays, axis=1) / np.linalg.norm(normals, axis=1)
    return np.degrees(np.arccos(cosine))


@pytest.mark.parametrize(
    "change",
    [
        drawn(sensors.depth_waves, rms_diameters=(0.01, 0.02), length_diameters=(0.2, 0.4)),
        drawn(sensors.eaten_edges, least=(0.0, 1.0), most=(2.0, 4.0)),
        drawn(trims.trimmed_along_curve, share=(0.5, 0.9)),
        drawn(trims.boxed, share=(0.5, 0.9)),
        drawn(trims.with_holes, count=(1.0, 3.0), radius_diameters=(0.05, 0.1)),
        one_of(each(harm.as_points), each(harm.as_points_seen)),
    ],
)
def test_changes_repeat_with_the_seed_and_leave_the_truth(change: harm.Disturbance):
    shots = [ball(), ball()]
    one, again = (change(shots, np.random.default_rng(3)) for _ in "ab")
    other = change(shots, np.random.default_rng(4))
    bits = [[shot.scan.points.tobytes() for shot in run] for run in (one, again, other)]
    assert bits[0] == bits[1] != bits[2] and bits[0][0] != bits[0][1]
    assert all(shot.world_from_sensor == ball().world_from_sensor for shot in one)
    same = [shot.scan.points.tobytes() for shot in alike(change)(shots, rng())]
    assert same[0] == same[1]


def test_waves_have_their_size_and_neighbours_err_alike():
    scan = ball().scan
    size, pixel = principal_diameter(scan.points), 120.0
    waved = sensors.depth_waves(scan, rng(), rms_diameters=0.015, length_diameters=0.25)
    off = (depth_of(waved) - depth_of(scan)) / size
    assert np.sqrt(np.nanmean(off**2)) == pytest.approx(0.015, rel=1e-9)
    assert abs(np.nanmean(off)) < 0.01
    for step, low, high in ((1, 0.98, 1.0), (int(0.12 * pixel), -0.9, 0.7)):
        one, other = off[:, step:], off[:, :-step]
        both = np.isfinite(one) & np.isfinite(other)
        assert low < np.corrcoef(one[both], other[both])[0, 1] < high, step
    deeper = sensors.depth_waves(scan, rng(), of_depth=0.01, length_diameters=0.25)
    share = (depth_of(deeper) - depth_of(scan)) / depth_of(scan)
    assert np.sqrt(np.nanmean(share**2)) == pytest.approx(0.01, rel=1e-9)


def test_quantised_depth_has_whole_steps_and_no_more_than_half_an_error():
    scan = ball().scan
    step = 0.005 * principal_diameter(scan.points)
    depth = depth_of(sensors.quantised(scan, rng(), step_diameters=0.005))
    assert np.nanmax(np.abs(depth / step - np.round(depth / step))) < 1e-9
    assert np.nanmax(np.abs(depth - depth_of(scan))) <= 0.5001 * step


def test_edges_are_eaten_as_wide_as_asked():
    scan = ball().scan
    lost = seen(scan) & ~seen(sensors.eaten_edges(scan, rng(), least=1.0, most=4.0))
    inwards = np.asarray(ndimage.distance_transform_edt(seen(scan)))
    # At the very limb of a ball the depth jumps: there the band begins a pixel further in.
    assert (inwards[lost] <= 5.0).all() and lost[seen(scan) & (inwards <= 1.0)].all()
    share = lost[seen(scan) & (inwards <= 4.0)].mean()
    assert 0.4 < share < 0.8
    # Pixels that lie on both sides of a jump are lost in any case.
    none = seen(sensors.eaten_edges(scan, rng(), least=0.0, most=0.0))
    assert none.sum() > 0.97 * seen(scan).sum()


def test_a_second_camera_leaves_a_band_on_one_side_of_what_is_near():
    """A plate of 40 before a wall: the band is as wide as the disparities differ."""
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    body = Body(_squares(20.0 * corners + [0, 0, 100], 100.0 * corners + [0, 0, 200]))
    view = ring(body, np.random.default_rng(0), count=1)[0]
    view = replace(view, world_from_sensor=Pose.identity())
    camera = replace(view.camera, width=201, height=201, fx=200.0, fy=200.0, cx=100.0, cy=100.0)
    scan = take_shots(body, [replace(view, camera=camera)], CLEAN, 0)[0].scan
    size = principal_diameter(scan.points)
    shadowed = sensors.stereo_shadow(scan, rng(), baseline_diameters=20.0 / size)
    lost = seen(scan) & ~seen(shadowed)
    width = 200.0 * 20.0 * (1 / 100.0 - 1 / 200.0)
    row = np.flatnonzero(lost[100])
    assert len(row) == pytest.approx(width, abs=1) and row[-1] == 100 - 40 - 1
    assert not lost[0].any()


def _squares(*squares: FloatArray) -> TriangleMesh:
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    return TriangleMesh(
        vertices=np.concatenate(squares),
        faces=np.concatenate([faces + 4 * k for k in range(len(squares))]),
    )


def test_grazing_returns_are_those_beyond_the_limit():
    scan = ball().scan
    kept = sensors.without_grazing(scan, rng(), max_incidence_deg=60.0)
    angles = away_from_axis(kept)
    assert angles.max() < 65.0
    assert len(angles) == pytest.approx((away_from_axis(scan) < 60.0).sum(), rel=0.06)


def test_cuts_keep_a_share_and_differ_by_scan():
    scan = ball().scan
    for cut in (trims.trimmed_along_curve, trims.boxed):
        one, other = (cut(scan, np.random.default_rng(k), share=0.7) for k in (0, 1))
        assert len(one.points) == pytest.approx(0.7 * len(scan.points), abs=2)
        assert (seen(one) != seen(other)).sum() > 0.05 * len(scan.points)
    holed = trims.with_holes(scan, rng(), count=2.0, radius_diameters=0.1)
    lost = scan.points[~np.isin(np.arange(len(scan.points)), _numbers(scan, holed))]
    # Within reach of one of two centres: not all of it within reach of any one place.
    radius = 0.1 * principal_diameter(scan.points)
    away = np.linalg.norm(lost[:, None] - lost, axis=2)
    assert len(lost) > 0 and away.max() > 2 * radius
    ends = np.unravel_index(away.argmax(), away.shape)
    assert away[list(ends)].min(axis=0).max() <= 2 * radius
    none = trims.with_holes(scan, rng(), count=0.0, radius_diameters=0.1)
    assert len(none.points) == len(scan.points)


def _numbers(scan: RangeScan, part: RangeScan) -> np.ndarray:
    """Numbers of a scan's points that another one of the same pixels has kept."""
    assert scan.grid is not None
    return scan.grid[seen(part)]


def test_scales_are_told_and_files_say_what_they_say():
    shots = harm.scales([ball()] * 5, rng(), within=0.02)
    factors = [shot.factor for shot in shots]
    assert len(set(factors)) == 5 and max(abs(f - 1.0) for f in factors) <= 0.02
    for shot in shots:
        np.testing.assert_allclose(shot.scan.points, shot.factor * ball().scan.points)
        middle = shot.world_points.mean(axis=0) - ball().world_points.mean(axis=0)
        assert np.linalg.norm(middle) < 1e-9
    bare, from_there = (f(ball().scan, rng()) for f in (harm.as_points, harm.as_points_seen))
    assert bare.viewpoint is Viewpoint.UNKNOWN and from_there.viewpoint is Viewpoint.GIVEN
    assert from_there.scan_from_sensor == ball().scan.scan_from_sensor
    assert from_there.grid is None and from_there.camera is None
    assert set(map(tuple, bare.points)) == set(map(tuple, ball().scan.points))
    both = in_turn(each(harm.as_points), partial(harm.scales, within=0.02))([ball()], rng())
    assert both[0].scan.grid is None and both[0].factor != 1.0


def test_the_room_stands_in_the_image_and_the_object_turns():
    body = make_body("thing", 1)
    views = turned_before_sensor(body, rng(), count=3)
    shots = in_standing_room(body, views, CLEAN, 1)
    images = [depth_of(shot.scan) for shot in shots]
    masks = [shot.mask for shot in shots if shot.mask is not None]
    elsewhere = ~np.any(masks, axis=0)
    for image in images[1:]:
        np.testing.assert_allclose(image[elsewhere], images[0][elsewhere], rtol=1e-6)
    # The wall fills the image, and the object is a small part of it that changes.
    assert len(masks) == 3 and all(0.005 < mask.mean() < 0.15 for mask in masks)
    assert all(np.isfinite(image).mean() > 0.95 for image in images)
    surface = KDTree(body.mesh.vertices)
    for shot in shots:
        assert np.quantile(surface.query(shot.world_points[shot.on_object])[0], 0.99) < 2.0
        assert np.median(surface.query(shot.world_points[~shot.on_object])[0]) > 20.0
    moved = np.abs(images[1] - images[0]) > 0.01 * principal_diameter(body.mesh.vertices)
    assert moved.any() and not moved[elsewhere].any()
    steps = [views[0].world_from_sensor.inverse() @ v.world_from_sensor for v in views[1:]]
    assert all(abs(s.angle_deg() - 120.0) <= 10.0 for s in steps)


def test_the_scene_of_a_standing_room_is_about_the_object():
    scene = make_scene(SCENARIOS["standing background"], 1001)
    for scan in scene.scans:
        on_object = scene.on_object[scan.name]
        assert on_object.shape == (len(scan.points),) and 0.003 < on_object.mean() < 0.15
        np.testing.assert_allclose(scene.centroids[scan.name], scan.points[on_object].mean(axis=0))
        spread = np.linalg.norm(scan.points[on_object] - scene.centroids[scan.name], axis=1)
        assert np.quantile(spread, 0.95) < scene.diameter


def test_a_lid_is_elsewhere_in_the_second_half():
    body = Body(box())
    views = ring(body, rng(), count=4)
    plain = KDTree(np.concatenate([s.world_points for s in take_shots(body, views, CLEAN, 1)]))
    lids = []
    for shot in with_lid_opened(body, views, CLEAN, 1):
        away = plain.query(shot.world_points)[0]
        lids.append(shot.world_points[(away > 3.0) & (shot.world_points[:, 2] > 50.5)])
    heights = [np.quantile(lid[:, 2], 0.98) for lid in lids]
    assert max(heights[:2]) < 50.0 + 0.05 * 150 < min(heights[2:])


@pytest.mark.parametrize("name", [n for n, s in SCENARIOS.items() if s.group is Group.SENSOR])
def test_settings_of_real_sensors_differ_by_seed_and_leave_a_scan(name: str):
    counts = set[tuple[int, ...]]()
    for seed in (1001, 1003):
        scene = make_scene(SCENARIOS[name], seed)
        again = make_scene(SCENARIOS[name], seed)
        for scan, same in zip(scene.scans, again.scans, strict=True):
            assert scan.points.tobytes() == same.points.tobytes() and len(scan.points) > 300
        counts.add(tuple(len(scan.points) for scan in scene.scans))
        assert scene.limits == SCENARIOS[name].limits
    assert len(counts) == 2


def test_scans_taken_twice_differ_in_their_noise_alone():
    body = make_body("thing", 1)
    views = SCENARIOS["taken twice"].views(body, rng())
    shots = take_shots(body, views, SLIGHT, 1)
    for k in range(3):
        one, other = shots[k], shots[k + 6]
        assert (one.pose.inverse() @ other.pose).angle_deg() < 1e-6
        off = depth_of(one.scan) - depth_of(other.scan)
        assert 0 < np.nanmedian(np.abs(off)) < 0.003 * principal_diameter(one.scan.points)
