"""A budget of memory: how many points it leaves room for, and how scans are thinned to them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.memory import MEGABYTE, MIN_POINTS, parse_size, points_within
from scanweld.config import PrepareConfig
from scanweld.errors import BudgetError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.prepare import prepare
from scanweld.prepare.thinning import thinned
from tests.prepared import moved
from tests.scenes import creature_scene, random_motion


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


def test_more_memory_leaves_room_for_more_points_and_more_scans_for_fewer(tmp_path: Path):
    few, many = files(tmp_path, 5), files(tmp_path, 20)
    small, large = 900 * MEGABYTE, 2000 * MEGABYTE
    assert MIN_POINTS <= points_within(small, many) < points_within(small, few)
    assert points_within(small, many) < points_within(large, many)


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


def test_a_small_scan_is_left_as_it_is():
    scan = a_scan()
    assert thinned(bare(scan), len(scan.points)).notes == ()
    assert thinned(scan, 10 * len(scan.points)) is scan


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
