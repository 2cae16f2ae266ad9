"""Points that stand for nothing are dropped and told, and give the grid back that they fill."""

from pathlib import Path

import numpy as np
import pytest

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.scan import RangeScan
from scanweld.io.raw import RawScan, to_scan
from tests.depth_scans import bumps, scan_of_depth
from tests.scenes import random_motion

IMAGE = scan_of_depth(bumps(60, 80, 9))
RNG = np.random.default_rng(5)


def read(points: FloatArray, faces: np.ndarray | None = None) -> RangeScan:
    return to_scan(Path("a.ply"), "a", RawScan(points=points.copy(), faces=faces))


def organised(hole: float | FloatArray, moved: bool = False) -> tuple[FloatArray, FloatArray]:
    """All pixels' points, those of holes at one place, and the points that were seen."""
    assert IMAGE.grid is not None
    seen = IMAGE.points
    if moved:
        seen = random_motion(RNG, 300.0).apply(seen)
    points = np.tile(np.asarray(hole, dtype=float), (IMAGE.grid.size, 1))
    if points.shape[1] == 1:
        points = np.tile(points, (1, 3))
    points[IMAGE.grid.reshape(-1) >= 0] = seen
    return points, seen


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("hole", [[0.0], [-1.0], [np.nan], [np.inf], [1e9], [7.0, 7.0, 65535.0]])
def test_holes_are_dropped_and_their_grid_is_found(hole: list[float], moved: bool):
    points, seen = organised(np.array(hole), moved)
    scan = read(points)
    np.testing.assert_array_equal(scan.points, seen)
    np.testing.assert_array_equal(scan.grid, IMAGE.grid)
    assert scan.num_dropped == len(points) - len(seen)
    assert len(scan.notes) == 2 and scan.notes[0].startswith(f"{scan.num_dropped} points that are")


def test_a_grid_is_only_what_certainly_is_one():
    points, seen = organised(np.zeros(1))
    for unclear in (
        points[:-7],  # no number of whole rows
        RNG.permutation(points),
        np.concatenate([seen, np.zeros((20, 3))]),
        np.concatenate([RNG.normal(size=(137 * 137 - 20, 3)), np.full((20, 3), np.nan)]),
    ):
        scan = read(unclear)
        assert scan.grid is None
        assert scan.num_dropped == (~np.isfinite(unclear).all(1) | (unclear == 0).all(1)).sum()


def test_holes_far_away_at_one_depth_are_told_by_it():
    points, seen = organised(np.zeros(1))
    holes = (points == 0).all(axis=1)
    points[holes] = RNG.uniform(-3e4, 3e4, (holes.sum(), 3))
    points[holes, 2] = 65535
    scan = read(points)
    np.testing.assert_array_equal(scan.points, seen)
    assert f"{holes.sum()} points with z = 65535 dropped" in scan.notes[0]


def test_what_was_measured_stays():
    cone = np.concatenate([np.zeros((60, 3)), RNG.normal(size=(120, 3))])
    soup = np.stack([np.arange(60), np.arange(60, 120), np.arange(120, 180)], axis=1)
    plates = RNG.normal(size=(400, 3))
    plates[:, 2] = np.repeat([0.1, 5.0], 200)
    coarse = RNG.integers(-9, 9, (20_000, 3)).astype(float)
    coarse[(coarse == 0).all(axis=1)] = 1.0
    few = np.concatenate([np.zeros((9, 3)), RNG.normal(size=(300, 3))])
    wall = RNG.normal(size=(300, 3)) * [1, 0, 1] + [0, 65535, 0]
    for points, faces in ((cone, soup), (plates, None), (coarse, None), (few, None), (wall, None)):
        scan = read(points, faces)
        assert scan.num_dropped == 0 and scan.notes == () and scan.grid is None
