"""A budget of memory: how many points it leaves room for, and how scans are thinned to them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from scanweld.app import job
from scanweld.app.fuse import fuse_job
from scanweld.app.job import Limits, report_job, run_job
from scanweld.app.memory import (
    MEGABYTE,
    MIN_POINTS,
    parse_size,
    points_within,
    workers_within,
)
from scanweld.config import Config, FusionConfig, PrepareConfig
from scanweld.errors import BudgetError
from scanweld.evaluation.primitives import sphere
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.preparation import prepare
from scanweld.preparation.thinning import thinned
from tests.prepared import moved
from tests.scenes import creature_scene, random_motion, write_scans


def a_scan(model: CameraModel = CameraModel.PINHOLE) -> RangeScan:
    return creature_scene(2, model=model).scans[0]


def bare(scan: RangeScan) -> RangeScan:
    return RangeScan(
        name=scan.name,
        points=scan.points,
        scan_from_sensor=scan.scan_from_sensor,
        viewpoint=Viewpoint.GIVEN,
    )


@pytest.mark.parametrize(
    ("text", "size"),
    [("800M", 800), ("2G", 2048), ("1.5g", 1536), (" 700 MB ", 700), ("1500", 1500)],
)
def test_sizes(text: str, size: int):
    assert parse_size(text) == size * MEGABYTE


@pytest.mark.parametrize("text", ["", "much", "-2G", "0", "2T", "2 G B", "1e9"])
def test_what_is_no_size_is_refused_in_one_line(text: str):
    with pytest.raises(BudgetError, match="is no size; give one such as 2G") as error:
        parse_size(text)
    assert "\n" not in str(error.value)


def files(folder: Path, count: int, megabytes: int = 0) -> list[Path]:
    paths = [folder / f"{k}.ply" for k in range(count)]
    for path in paths:
        path.touch()
    with paths[0].open("wb") as file:
        file.truncate(megabytes * MEGABYTE)
    return paths


def test_room_for_points_by_memory_scans_and_formats(tmp_path: Path):
    few, many = files(tmp_path, 5), files(tmp_path, 20)
    small, large = 900 * MEGABYTE, 2000 * MEGABYTE
    assert MIN_POINTS <= points_within(small, many) < points_within(small, few)
    assert points_within(small, many) < points_within(large, many)
    left = []
    for suffix in (".ply", ".off"):
        path = (tmp_path / "a").with_suffix(suffix)
        with path.open("wb") as file:
            file.truncate(30 * MEGABYTE)
        left.append(points_within(1000 * MEGABYTE, [path] * 10))
    assert left[0] > left[1] >= MIN_POINTS


def test_too_little_memory_is_refused_with_what_is_needed(tmp_path: Path):
    paths = files(tmp_path, 10, megabytes=200)
    with pytest.raises(BudgetError, match=r"300M: is too little for 10 scans .* 200 MB; give") as e:
        points_within(300 * MEGABYTE, paths)
    asked = int(str(e.value).split("at least ")[1].split("M")[0])
    assert points_within(asked * MEGABYTE, paths) >= MIN_POINTS
    with pytest.raises(BudgetError):
        points_within((asked - 2) * MEGABYTE, paths)


@pytest.mark.parametrize("make", [a_scan, lambda: bare(a_scan())], ids=["grid", "points"])
def test_a_thinned_scan_has_no_more_points_and_says_so(make: Callable[[], RangeScan]):
    scan = make()
    most = len(scan.points) // 5
    smaller = thinned(scan, most)
    assert 0.3 * most < len(smaller.points) <= most
    assert f"thinned from {len(scan.points)} to {len(smaller.points)} points" in smaller.notes[-1]
    original = {point.tobytes() for point in scan.points}
    assert all(point.tobytes() in original for point in smaller.points)


def test_a_small_scan_is_left_as_it_is_but_not_a_grid_of_empty_cells():
    scan = a_scan()
    assert thinned(bare(scan), len(scan.points)).notes == ()
    assert thinned(scan, 10 * len(scan.points)) is scan
    assert scan.grid is not None and scan.grid.size > 4 * len(scan.points)
    assert thinned(scan, len(scan.points)) is scan
    wide = np.full((12 * len(scan.grid), scan.grid.shape[1]), -1)
    wide[::12] = scan.grid
    smaller = thinned(replace(scan, grid=wide, camera=None), len(scan.points))
    assert smaller.grid is not None
    assert smaller.grid.size <= 8 * len(scan.points) and len(smaller.points) > 100


@pytest.mark.parametrize("model", [CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC])
def test_the_camera_of_a_thinned_grid_sees_the_points_in_their_cells(model: CameraModel):
    smaller = thinned(a_scan(model), 1500)
    assert smaller.grid is not None and smaller.camera is not None
    rows, columns = np.nonzero(smaller.grid >= 0)
    seen = smaller.sensor_pose.inverse().apply(smaller.points[smaller.grid[rows, columns]])
    pixels, _ = smaller.camera.project(seen)
    np.testing.assert_allclose(pixels, np.stack([columns, rows], axis=1), atol=1e-6)
    assert smaller.grid.shape == (smaller.camera.height, smaller.camera.width)


def test_a_thinned_mesh_keeps_its_surface():
    prepared = prepare(a_scan(), PrepareConfig())
    mesh = prepared.mesh
    scan = replace(bare(a_scan()), points=mesh.vertices, faces=mesh.faces)
    smaller = thinned(scan, len(scan.points) // 3)
    assert smaller.faces is not None and len(smaller.faces) > 0.15 * len(mesh.faces)

    def area(points: FloatArray, faces: IntArray) -> float:
        a, b, c = points[faces].swapaxes(0, 1)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    assert area(smaller.points, smaller.faces) == pytest.approx(
        area(mesh.vertices, mesh.faces), rel=0.15
    )


def test_moving_a_scan_does_not_change_what_stays():
    scan = bare(a_scan())
    motion = random_motion(np.random.default_rng(3), 500.0)
    here, there = thinned(scan, 1000), thinned(moved(scan, motion), 1000)
    assert len(here.points) == len(there.points)
    np.testing.assert_allclose(motion.apply(here.points), there.points, atol=1e-6)
    scan = replace(bare(a_scan()), confidence=np.arange(float(len(a_scan().points))))
    smaller = thinned(scan, 700)
    assert smaller.confidence is not None
    np.testing.assert_array_equal(scan.points[smaller.confidence.astype(int)], smaller.points)


def test_few_large_scans_leave_room_to_prepare_them(tmp_path: Path):
    """A million points take little while they are kept, and much while they are worked on."""
    budget = 1024 * MEGABYTE
    points = points_within(budget, files(tmp_path, 2))
    assert points < 600_000
    assert workers_within(budget, [points, points], 64) >= 2
    counts = [workers_within(budget, [points] * 10, 8) for points in (1000, 10**5, 10**6)]
    assert counts[0] == 8 and counts == sorted(counts, reverse=True) and counts[-1] == 1
    assert workers_within(budget, [1000], 1) == workers_within(budget, [], 1) == 1


def test_points_are_thinned_evenly_to_about_what_there_is_room_for():
    ball = sphere().vertices
    for most in (2000, 500, 60):
        smaller = thinned(RangeScan(name="ball", points=ball), most)
        assert 0.7 * most < len(smaller.points) <= most
        reach, _ = KDTree(smaller.points).query(ball)
        assert reach.max() < 3.0 * np.sqrt(4 * np.pi * 50.0**2 / len(smaller.points))
    points = np.random.default_rng(0).normal(size=(3000, 3)) * [30.0, 20.0, 4.0]
    points[-1] = [1e9, 0.0, 0.0]
    assert len(thinned(RangeScan(name="a", points=points), 500).points) > 250


@pytest.mark.parametrize("place", [0.0, 1.0, 0.1])
def test_points_in_one_place_become_one(place: float):
    scan = RangeScan(name="a", points=np.full((100, 3), place))
    assert len(thinned(scan, 10).points) == 1


@pytest.mark.slow
def test_large_scans_are_thinned_as_they_are_read_and_the_report_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    small = creature_scene(2, pixels=60.0).scans
    folder = write_scans(tmp_path / "scans", [*small, replace(a_scan(), name="large")])
    config = Config(fusion=FusionConfig(max_voxels_across=60))
    monkeypatch.setattr(job, "points_within", lambda budget, paths: 1200)
    limits = Limits(memory=10_000 * MEGABYTE, workers=1)
    run_job([folder], tmp_path / "model", config, limits=limits)
    told = json.loads((tmp_path / "model" / "report.json").read_text(encoding="utf-8"))["scans"]
    assert told["large"]["num_points"] <= 1200
    assert any("thinned from" in note for note in told["large"]["notes"])
    assert not any("thinned" in note for note in told["scan_01"]["notes"])
    # Who looks at the scans again thins them alike, and finds what the model was made of.
    assert told["large"]["verdict"] != "unplaced"
    page = (tmp_path / "model" / "report.html").read_bytes()
    assert report_job(tmp_path / "model").read_bytes() == page
    assert fuse_job([folder], tmp_path / "model", tmp_path / "fused", config).mesh is not None
