"""The scenes of the trust benchmark: their truth holds, and conditions are what they say."""

from functools import cache

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from benchmarks.virtual.bodies import BODIES, make_body
from benchmarks.virtual.brackets import bracket
from benchmarks.virtual.scenarios import FROM_ABOVE_DEG, SCALE, SCENARIOS, SIX
from benchmarks.virtual.scene import CHAIN_OVERLAP, Group, Scene, make_scene, mark_pixels
from benchmarks.virtual.scenery import OVER
from benchmarks.virtual.shots import SLIGHT, Shot, ring, shot_overlaps, take_shots
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import rotation_exp
from scanweld.geometry.scan import RangeScan

SEED = 1
"""Its thing is a made part."""


@cache
def scene_of(name: str) -> Scene:
    return make_scene(SCENARIOS[name], SEED)


def by_source(scene: Scene) -> dict[str, RangeScan]:
    return {scene.sources[scan.name]: scan for scan in scene.scans}


def in_sensor(scan: RangeScan) -> FloatArray:
    assert scan.scan_from_sensor is not None
    return scan.scan_from_sensor.inverse().apply(scan.points)


def in_world(scene: Scene, scan: RangeScan) -> FloatArray:
    return scene.truth[scan.name].apply(scan.points)


def depths(scene: Scene, source: str) -> FloatArray:
    """Depth image, NaN where nothing was seen."""
    scan = by_source(scene)[source]
    assert scan.grid is not None
    return np.where(scan.grid >= 0, in_sensor(scan)[scan.grid, 2], np.nan)


def thinned(scan: RangeScan) -> RangeScan:
    """A few thousand of its points."""
    return RangeScan(name=scan.name, points=scan.points[:: max(1, len(scan.points) // 2500)])


@pytest.mark.parametrize(
    "name",
    [
        *("ring of 6", "resolutions 1:4", "scale error 1 %", "crop to a ball", "crop by hand"),
        *("table, turned over", "hand", "two objects", "mirrored scan", "bare points"),
        *("near-duplicates", "figure with a mirror plane"),
    ],
)
def test_scans_lie_on_each_other_under_the_truth(name: str):
    scene = scene_of(name)
    shots = [
        Shot(scan=thinned(scan), world_from_sensor=scene.truth[scan.name])
        for scan in scene.scans
        if scan.name in scene.truth
    ]
    shares = shot_overlaps(shots)
    np.fill_diagonal(shares, 0.0)
    assert shares.max(axis=1).min() > 0.6 * CHAIN_OVERLAP
    # A wrong pose brings next to nothing together.
    moved = [
        Shot(scan=s.scan, world_from_sensor=scene.truth[shots[k - 1].scan.name])
        for k, s in enumerate(shots)
    ]
    assert np.median(shot_overlaps(moved)) < 0.6 * CHAIN_OVERLAP


def test_runs_repeat_and_conditions_leave_the_chains_as_they_are():
    make_body.cache_clear()
    hand, again = scene_of("hand"), make_scene(SCENARIOS["hand"], SEED)
    assert [s.points.tobytes() for s in hand.scans] == [s.points.tobytes() for s in again.scans]
    clean = scene_of("ring of 6").truth
    for name in ("noise 0.5 %", "outliers 20 %", "hand", "flying pixels", "dropouts 30 %"):
        for scan, pose in scene_of(name).truth.items():
            np.testing.assert_allclose(pose.matrix(), clean[scan].matrix())


def test_noise_is_a_share_of_the_diameter():
    clean = scene_of("ring of 6")
    for name, share in (("noise 0.25 %", 0.0025), ("noise 1 %", 0.01)):
        off = [np.abs(depths(scene_of(name), s) - depths(clean, s)) for s in by_source(clean)]
        # 0.67 sigma is the median; sigma grows where the surface is seen at an angle.
        sigma = np.nanmedian(np.concatenate(off, axis=None)) / 0.674 / clean.diameter
        assert 0.9 * share < sigma < 2.0 * share


def test_sensors_err_as_much_as_they_should():
    names = ("ring of 6", "outliers 20 %", "dropouts 30 %", "flying pixels", "resolutions 1:4")
    clean, outliers, dropouts, flying, resolutions = map(scene_of, names)
    tree = KDTree(np.concatenate([in_world(clean, scan) for scan in clean.scans]))
    for source, scan in by_source(clean).items():
        off = np.abs(depths(outliers, source) - depths(clean, source))
        share = (off > 0.01 * clean.diameter).sum() / np.isfinite(off).sum()
        assert share == pytest.approx(0.2, abs=0.05)
        left = len(by_source(dropouts)[source].points) / len(scan.points)
        assert left == pytest.approx(0.7, abs=0.04)
        between = tree.query(in_world(flying, by_source(flying)[source]))[0]
        assert 0.02 < (between > 0.03 * clean.diameter).mean() < 0.35
    trees = [(KDTree(scan.points), scan.points[::9]) for scan in resolutions.scans]
    spacing = [np.median(tree.query(points, k=2)[0][:, 1]) for tree, points in trees]
    assert 3.0 < max(spacing) / min(spacing) < 5.5


def test_a_scaled_scan_is_larger_and_keeps_its_camera():
    scene = scene_of("scale error 1 %")
    (name,) = scene.factors
    scaled = next(scan for scan in scene.scans if scan.name == name)
    plain = by_source(scene_of("ring of 6"))[scene.sources[name].removesuffix(" scaled")]
    assert scaled.camera == plain.camera
    np.testing.assert_allclose(in_sensor(scaled), SCALE * in_sensor(plain), atol=1e-9)
    # It lies where it fits best: not moved as a whole.
    off = in_world(scene, scaled) - in_world(scene_of("ring of 6"), plain)
    assert np.linalg.norm(off.mean(axis=0)) < 1e-9 * scene.diameter


def test_no_rigid_motion_takes_a_mirrored_scan_to_what_was_seen():
    scene, clean = scene_of("mirrored scan"), scene_of("ring of 6")
    (scan,) = (scan for scan in scene.scans if scan.name not in scene.truth)
    original = by_source(clean)[scene.sources[scan.name].removesuffix(" mirrored")]
    a, b = scan.points - scan.points.mean(axis=0), original.points - original.points.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    assert np.linalg.det(u @ vt) < 0
    np.testing.assert_allclose(a @ u @ vt, b, atol=1e-6 * clean.diameter)
    assert scan.camera is None


@pytest.mark.parametrize("name", ["table", "table, turned over", "turntable"])
def test_what_the_object_stands_on_is_in_every_scan(name: str):
    scene = scene_of(name)
    body = make_body(SCENARIOS[name].body, SEED)
    for scan in scene.scans:
        lies = name == "table, turned over" and int(scene.sources[scan.name]) >= 5
        up = OVER.T[:, 2] if lies else np.array([0.0, 0.0, 1.0])
        height = in_world(scene, scan) @ up - (body.mesh.vertices @ up).min()
        assert (np.abs(height) < 0.005 * scene.diameter).mean() > 0.25, scene.sources[scan.name]
        assert height.min() > -0.05 * scene.diameter


def test_an_arm_is_a_tenth_of_the_scans_that_it_is_in():
    scene = scene_of("hand")
    mesh = make_body("thing", SEED).mesh
    surface = KDTree(trimesh.Trimesh(mesh.vertices, mesh.faces).sample(60_000, seed=0))
    arms = {}
    for scan in scene.scans:
        points = in_world(scene, scan)[::5]
        off = surface.query(points)[0] > 0.02 * scene.diameter
        if "held" in scene.sources[scan.name]:
            assert 0.04 < off.mean() < 0.16
            arms[scan.name] = points[off].mean(axis=0)
        else:
            assert off.mean() < 0.01
    one, other = arms.values()
    assert np.linalg.norm(one - other) > 0.2 * scene.diameter


@pytest.mark.parametrize("name", [n for n, s in SCENARIOS.items() if s.group is Group.CROP])
def test_crops_leave_a_part(name: str):
    scene = scene_of(name)
    views = SCENARIOS[name].views(make_body("thing", SEED), np.random.default_rng([SEED, 0, 0]))
    whole = take_shots(make_body("thing", SEED), views, SLIGHT, SEED)
    for scan in scene.scans:
        full = len(whole[int(scene.sources[scan.name])].scan.points)
        assert 300 < len(scan.points) < 0.95 * full


def test_strangers_have_no_truth_and_see_nothing_in_common():
    strange = {"2 of another object": (6, 2), "2 of a like object": (6, 2), "noise scan": (6, 1)}
    others = {"mirrored scan": (5, 1), "two objects": (12, 0), "duplicates": (9, 0)}
    for name, (belonging, strangers) in {**strange, **others}.items():
        scene = scene_of(name)
        assert (len(scene.truth), len(scene.scans)) == (belonging, belonging + strangers), name
    body = make_body("other thing", SEED)
    shots = take_shots(body, ring(body, np.random.default_rng(0), count=2), SLIGHT, 0)
    assert shot_overlaps(shots)[0, 1] < 0.1


def test_near_duplicates_are_half_a_degree_apart():
    scene = scene_of("near-duplicates")
    scans = by_source(scene)
    for k in range(3):
        one, other = (scans[str(n)] for n in (k, k + 6))
        a, b = (scene.truth[scan.name] @ scan.sensor_pose for scan in (one, other))
        assert (a.inverse() @ b).angle_deg() == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "fold", "has_flip"),
    [
        *(("sphere", 7, True), ("cylinder", 7, True), ("box", 2, True), ("plate", 2, True)),
        *(("cone", 7, False), ("vase", 7, False), ("gear", 12, True)),
    ],
)
def test_symmetries_leave_the_solid_as_it_is(name: str, fold: int, has_flip: bool):
    body = make_body(name, SEED)
    solid = trimesh.Trimesh(body.mesh.vertices, body.mesh.faces, process=False)
    points = np.asarray(solid.sample(400, seed=0), dtype=float)
    tree = KDTree(solid.sample(100_000, seed=1))
    for turn in range(fold):
        rotated = points @ rotation_exp(np.array([0.0, 0.0, 2 * np.pi * turn / fold])).T
        assert tree.query(rotated)[0].max() < 1.5
    assert bool(tree.query(points * [1.0, -1.0, -1.0])[0].max() < 1.5) is has_flip
    scene = make_scene(SCENARIOS[name], SEED)
    assert body.is_symmetric and scene.is_open == set(scene.truth)
    assert SCENARIOS[name].group is Group.SYMMETRIC


@pytest.mark.parametrize("name", ["vase with a knob", "gear with a worn tooth"])
def test_marks_are_seen_in_two_scans_or_more(name: str):
    scene, body = scene_of(name), make_body(SCENARIOS[name].body, SEED)
    assert len(scene.scans) - len(scene.is_open) >= 2 and body.unmarked is not None
    differs = KDTree(body.unmarked.vertices).query(body.mesh.vertices)[0] > 0.25
    size = np.ptp(body.mesh.vertices[differs], axis=0)
    resolution = scene.diameter / 240.0
    assert (np.sort(size)[1:] > 5 * resolution).all()
    counts = mark_pixels(body, ring(body, np.random.default_rng(0), count=8))
    assert min(counts) < 4 and max(counts) > 50


@pytest.mark.parametrize("seed", range(4))
def test_a_bracket_is_one_closed_body_of_its_own(seed: int):
    mesh = bracket(seed, voxels=60)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight and solid.body_count == 1 and solid.volume > 0
    assert len(bracket(seed + 1, voxels=60).vertices) != len(mesh.vertices)


def test_scenarios_differ_from_the_clean_ring_in_one_thing():
    hard = [s for s in SCENARIOS.values() if s.group is Group.HARD and s.body == "thing"]
    assert sum(s.views is SIX for s in hard) >= 10 and min(FROM_ABOVE_DEG) > 15
    assert all(s.min_overlap == CHAIN_OVERLAP for s in hard)
    symmetric = {name for name in BODIES if make_body(name, SEED).is_symmetric}
    assert symmetric == {s.body for s in SCENARIOS.values() if s.group is Group.SYMMETRIC}
