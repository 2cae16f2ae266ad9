"""PCD files: every encoding, the sensor's place, normals, colours and intensities."""

from pathlib import Path

import numpy as np
import pytest

from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io import read_scan
from tests.scan_files import UNSEEN_NOTE, assert_has_colors, assert_is_surface, pcd_of, write


@pytest.mark.parametrize("name", ["ascii.pcd", "binary.pcd", "compressed.pcd"])
def test_pcd_of_every_kind_keeps_grid_and_colors(name: str, tmp_path: Path):
    scan = read_scan(write(tmp_path, name))
    assert_is_surface(scan)
    assert scan.viewpoint is Viewpoint.UNKNOWN
    if name == "ascii.pcd":
        assert scan.colors is None
    else:
        assert_has_colors(scan)
    told = ("fields left out: label",) if name == "binary.pcd" else ()
    assert scan.notes == (*told, UNSEEN_NOTE)


def test_pcd_normals_intensity_and_colors_written_as_numbers(tmp_path: Path):
    lines = ["0 0 1 0 0 -1 4.2108e+06", "1 0 1 0 0 -1 0", "0 1 nan 0 0 -1 255"]
    scan = read_scan(
        write(tmp_path, "a.pcd", pcd_of("x y z normal_x normal_y normal_z rgb", *lines))
    )
    assert scan.normals is not None and scan.colors is not None
    np.testing.assert_array_equal(scan.normals, [[0, 0, -1]] * 2)
    np.testing.assert_array_equal(scan.colors, [[64, 64, 112], [0, 0, 0]])
    tiny = np.uint32(0x0A141E).view(np.float32)
    scan = read_scan(write(tmp_path, "b.pcd", pcd_of("X Y Z RGB", f"0 0 1 {tiny:.9g}", "1 0 1 0")))
    assert scan.colors is not None
    np.testing.assert_array_equal(scan.colors, [[10, 20, 30], [0, 0, 0]])
    scan = read_scan(write(tmp_path, "c.pcd", pcd_of("x y z intensity", "0 0 1 0.2", "1 0 1 1")))
    assert scan.notes == ("intensity read as grey",)


def test_pcd_viewpoint_is_believed_if_it_sees_the_points(tmp_path: Path):
    lines = [f"{x} {y} {5 + x * y / 9}" for x in range(4) for y in range(4)]

    def read(viewpoint: str) -> RangeScan:
        return read_scan(write(tmp_path, "a.pcd", pcd_of("x y z", *lines, viewpoint=viewpoint)))

    scan = read("1.5 1.5 -2 1 0 0 0")
    assert scan.viewpoint is Viewpoint.GIVEN and "VIEWPOINT" in scan.notes[0]
    np.testing.assert_allclose(scan.sensor_pose.translation, [1.5, 1.5, -2])
    assert scan.sensor_pose.rotation[2, 2] > 0.99
    # The whole scan turned over is no reason to look away from it: Kinect tutorials write that.
    assert read("0 0 0 0 1 0 0").sensor_pose.rotation[2, 2] > 0.8
    scan = read("1.5 1.5 5.2 1 0 0 0")
    assert scan.viewpoint is Viewpoint.UNKNOWN and "left out" in scan.notes[0]
    assert read("0 0 0 1 0 0 0").viewpoint is Viewpoint.UNKNOWN
