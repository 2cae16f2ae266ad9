"""Coordinates far from the origin: steps that are too coarse."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.io import read_scan
from scanweld.io.coarseness import refuse_coarse

FAR = np.array([450_000.0, 5_400_000.0, 300.0])
"""Map coordinates."""


def dome(count: int = 4000, diameter: float = 1.3) -> FloatArray:
    """Points on half a sphere."""
    rng = np.random.default_rng(7)
    points = rng.normal(size=(count, 3))
    points[:, 2] = np.abs(points[:, 2])
    return 0.5 * diameter * points / np.linalg.norm(points, axis=1, keepdims=True)


def single(points: NDArray) -> FloatArray:
    """The points as single precision holds them."""
    return points.astype(np.float32).astype(np.float64)


def refused(points: FloatArray, **kind: bool) -> str:
    with pytest.raises(ReadError) as raised:
        refuse_coarse(Path("scan.ply"), points, **kind)
    return str(raised.value)


def test_single_precision_is_refused_where_it_no_longer_holds_the_object(tmp_path: Path):
    path = tmp_path / "scan.ply"
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 4000\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(head.encode() + (dome() + FAR).astype("<f4").tobytes())
    with pytest.raises(ReadError, match=r"too coarsely: steps of 0\.5 beside a size of 1\.\d; "):
        read_scan(path)
    path.write_bytes(head.replace("float", "double").encode() + (dome() + FAR).tobytes())
    assert np.array_equal(read_scan(path).points, dome() + FAR)


def test_digits_lost_before_the_text_was_written_are_found(tmp_path: Path):
    path = tmp_path / "scan.xyz"
    np.savetxt(path, single(dome() + FAR), fmt="%.3f")
    with pytest.raises(ReadError, match=r"steps of 0\.5 beside"):
        read_scan(path)
    np.savetxt(path, dome() + FAR, fmt="%.4f")
    assert np.abs(read_scan(path).points - (dome() + FAR)).max() < 1e-4


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_the_limit_is_the_resolution_in_any_unit(scale: float):
    """4000 points over 1.9 resolve 0.03: steps of 0.036 and more are too large."""
    for far, fits in ((600_000.0, False), (120_000.0, True)):
        points = single(scale * single(dome() + np.array([far, 0.0, 0.0])))
        assert fits == (not _is_refused(points))


def test_too_few_decimals_are_refused_and_lattices_are_not():
    """Rounded to steps so large that points coincide; one point a cell is a fair scan."""
    rounded = np.round(dome(count=8000), 1)
    assert "steps of 0.1 beside a size of" in refused(rounded)
    assert not _is_refused(np.unique(rounded, axis=0))
    assert not _is_refused(np.round(dome(), 2))
    assert not _is_refused(rounded, are_vertices=True)


def test_profiles_planes_and_strays_are_not_mistaken_for_coarse_steps():
    profiles = dome()
    profiles[:, 1] = np.round(profiles[:, 1], 1)
    assert not _is_refused(profiles)
    terrain = 0.5 * np.indices((60, 60)).reshape(2, -1).T
    heights = np.random.default_rng(0).uniform(0, 3, len(terrain))
    assert not _is_refused(np.column_stack([terrain + FAR[:2], heights]).astype(np.float64))
    flat = dome() * [1, 0, 1] + FAR
    assert not _is_refused(flat)
    stray = single(dome())
    stray[:20] = 1e9
    assert not _is_refused(stray)


def test_a_size_below_one_step_is_refused_too():
    """All points then have the same coordinate, as if they were of a plane."""
    points = single(0.1 * dome() + np.array([0.0, 5_400_000.1, 0.0]))
    assert len(np.unique(points[:, 1])) == 1
    assert re.search(r"steps of 0\.5 beside a size of 0\.1", refused(points))


def test_numbers_beyond_single_precision_are_left_to_others():
    assert not _is_refused(dome() * 1e300)


def _is_refused(points: FloatArray, **kind: bool) -> bool:
    try:
        refuse_coarse(Path("scan.ply"), points, **kind)
    except ReadError:
        return True
    return False
