"""Files of scans that other programs write: grid, pose and colours kept, all else told."""

import gzip
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from benchmarks.sample_files import (
    COLUMNS,
    GROUND,
    ROWS,
    SAMPLES,
    WITH_LIBRARIES,
    colors,
    npy,
    surface,
)
from scanweld.errors import ReadError
from scanweld.geometry.scan import Viewpoint
from scanweld.io import collect, read_scan
from scanweld.io.raw import POSE_NOTE
from scanweld.io.scans import read_scans
from tests.scan_files import SEEN, UNSEEN_NOTE, assert_has_colors, assert_is_surface, write


def test_ptx_gives_several_scans_with_poses(tmp_path: Path):
    path = write(tmp_path, "two.ptx")
    assert [(file.name, file.part) for file in collect([tmp_path])] == [("two_1", 0), ("two_2", 1)]
    first, second = read_scans(path)
    assert (first.name, second.name) == ("two_1", "two_2")
    for scan in (first, second):
        assert_is_surface(scan)
    assert first.notes == (UNSEEN_NOTE, "intensity read as grey")
    assert second.notes == (UNSEEN_NOTE, POSE_NOTE)
    assert_has_colors(second)
    assert first.world_from_scan is not None and second.world_from_scan is not None
    np.testing.assert_array_equal(first.world_from_scan.matrix(), np.eye(4))
    np.testing.assert_array_equal(second.world_from_scan.matrix(), GROUND)
    assert first.content_hash() != second.content_hash()  # colours
    with pytest.raises(ReadError, match="has no scan 3, but 2"):
        read_scan(path, part=2)


def test_a_local_origin_is_told_by_packed_files_too(tmp_path: Path):
    text = b"# scanweld_shift 1000000 0 -2.5\n0 0 1\n1 0 1\n"
    scan = read_scan(write(tmp_path, "a.xyz.gz", gzip.compress(text, mtime=0)))
    np.testing.assert_array_equal(scan.points, [[1e6, 0, -1.5], [1e6 + 1, 0, -1.5]])
    broken = text.replace(b"-2.5", b"nan")
    with pytest.raises(ReadError, match="its scanweld_shift is not three numbers"):
        read_scan(write(tmp_path, "a.xyz.gz", gzip.compress(broken, mtime=0)))


def test_names_of_several_scans_do_not_clash(tmp_path: Path):
    write(tmp_path, "two.ptx")
    lines = SAMPLES["two.ptx"]().splitlines(keepends=True)
    write(tmp_path, "two_1.ptx", b"".join(lines[: 10 + ROWS * COLUMNS]))
    files = collect([tmp_path])
    assert [file.name for file in files] == ["two.ptx/1", "two.ptx/2", "two_1"]
    assert [file.part for file in files] == [0, 1, 0]


@pytest.mark.parametrize("name", ["organised.ply", "packed.pcd.gz", "grid.npy", "grid.npz"])
def test_grids_of_other_formats(name: str, tmp_path: Path):
    path = write(tmp_path, name)
    scan = read_scan(path)
    assert_is_surface(scan)
    assert scan.name == name.partition(".")[0] == collect([path])[0].name
    if name.endswith((".gz", ".npz")):
        assert_has_colors(scan)


@pytest.mark.parametrize("name", ["ascii.vtk", "binary.vtk"])
def test_vtk_structured_grid(name: str, tmp_path: Path):
    scan = read_scan(write(tmp_path, name))
    assert scan.grid is not None and scan.colors is not None and scan.notes == ()
    np.testing.assert_allclose(scan.points[scan.grid], np.nan_to_num(surface()), rtol=1e-7)
    np.testing.assert_array_equal(scan.colors, colors())


def test_vtk_polygons_of_old_and_new_versions(tmp_path: Path):
    head = "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n"
    head += "0 0 0 1 0 0 1 1 0 0 1 0\nVERTICES 1 2\n1 0\n"
    tail = "POINT_DATA 4\nNORMALS n float\n" + "0 0 1 " * 4 + "\nTENSORS t float\n1 2\n"
    for version, cells in (
        ("3.0", "POLYGONS 2 9\n4 0 1 2 3\n3 0 1 2\n"),
        (
            "5.1",
            "POLYGONS 3 7\nOFFSETS vtktypeint64\n0 4 7\nCONNECTIVITY vtktypeint64\n0 1 2 3 0 1 2\n",
        ),
    ):
        if version == "5.1":
            head = head.replace("VERTICES 1 2\n1 0\n", "")
        scan = read_scan(write(tmp_path, "a.vtk", (head + cells + tail).encode()))
        assert scan.faces is not None and scan.normals is not None
        np.testing.assert_array_equal(scan.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2]])
        np.testing.assert_array_equal(scan.normals, [[0, 0, 1]] * 4)
        assert scan.notes == ("left out from TENSORS on",)


def test_glb_nodes_move_their_meshes_exactly(tmp_path: Path):
    scan = read_scan(write(tmp_path, "nodes.glb"))
    origin = np.array([4e6, 5e5, 0.25])
    square = 2 * np.array([[0, 0, 0], [0, 1, 0], [-1, 1, 0], [-1, 0, 0]])
    np.testing.assert_allclose(scan.points[:4] - origin, square, atol=1e-9)
    np.testing.assert_array_equal(scan.points[4:] - origin, [[1, 0, 7], [0, 1, 7]])
    np.testing.assert_array_equal(scan.faces, [[0, 1, 2], [0, 2, 3]])


def test_ply_element_camera_gives_the_place_of_the_sensor(tmp_path: Path):
    names = ["view_px", "view_py", "view_pz"]
    names += [f"{axis}_axis{part}" for axis in "xyz" for part in "xyz"]
    head = "ply\nformat ascii 1.0\nelement vertex 4\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "element camera 1\n"
    head += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    points = "0 0 5\n1 0 5\n0 1 5\n1 1 6\n"
    for numbers, is_given in (("0.5 0.5 0", True), ("0 0 0", False), ("0.5 0.5 5.2", False)):
        data = head + points + numbers + " 1 0 0 0 1 0 0 0 1\n"
        scan = read_scan(write(tmp_path, "a.ply", data.encode()))
        assert (scan.viewpoint is Viewpoint.GIVEN) is is_given
    assert "lies among the points" in scan.notes[0]


def test_obj_with_colors_on_some_vertices_is_read_without(tmp_path: Path):
    scan = read_scan(write(tmp_path, "a.obj", b"v 0 0 1 1 0 0\nv 1 2 3\nv 4 5 6 0 0 1\n"))
    np.testing.assert_array_equal(scan.points, [[0, 0, 1], [1, 2, 3], [4, 5, 6]])
    assert scan.colors is None and "colours on some" in scan.notes[0]


def test_e57_gives_several_scans_by_their_names(tmp_path: Path):
    library, make = WITH_LIBRARIES["two.e57"]
    pytest.importorskip(library)
    path = write(tmp_path, "two.e57", make())
    left, right = read_scans(path)
    assert (left.name, right.name) == ("left", "right")
    for scan in (left, right):
        assert scan.grid is not None
        np.testing.assert_array_equal(scan.grid >= 0, SEEN)
        np.testing.assert_array_equal(scan.points[scan.grid[SEEN]], surface()[SEEN])
        assert_has_colors(scan)
    assert right.world_from_scan is not None and right.notes == (POSE_NOTE,)
    np.testing.assert_allclose(right.world_from_scan.matrix(), GROUND, atol=1e-12)
    with pytest.raises(ReadError, match="is not read packed"):
        read_scan(write(tmp_path, "a.e57.gz", gzip.compress(make(), mtime=0)))
    for data in (make()[:-600], b"hello", make()[:3000] + bytes(9) + make()[3009:]):
        with pytest.raises(ReadError, match="not an E57 file, or a broken one"):
            for file in collect([write(tmp_path, "b.e57", data)]):
                file.read()


@pytest.mark.parametrize("name", ["points.las", "points.laz"])
def test_las_keeps_map_coordinates_and_colors(name: str, tmp_path: Path):
    library, make = WITH_LIBRARIES[name]
    pytest.importorskip(library)
    scan = read_scan(write(tmp_path, name, make()))
    told = np.nan_to_num(np.round(surface(), 2)).reshape(-1, 3) + np.array([4e6, 5e5, 0])
    np.testing.assert_allclose(scan.points, told, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(scan.colors, colors())
    for data in (make()[:-30], b"hello", make()[:200]):
        with pytest.raises(ReadError):
            read_scan(write(tmp_path, name, data))


def test_arrays_with_named_fields(tmp_path: Path):
    """As PDAL and pyntcloud save them."""
    shades = colors().reshape(ROWS, COLUMNS, 3)
    fields = [(name, "<f4") for name in ("Z", "Y", "X")] + [("GpsTime", "<f8")]
    fields += [(name, "<u2") for name in ("Red", "Green", "Blue")]
    records = np.zeros((ROWS, COLUMNS), fields)
    for k, name in enumerate("XYZ"):
        records[name] = surface()[..., k]
    for k, name in enumerate(("Red", "Green", "Blue")):
        records[name] = 257 * shades[..., k].astype(np.uint16)
    scan = read_scan(write(tmp_path, "a.npy", npy(records)))
    assert_is_surface(scan)
    assert_has_colors(scan)
    assert scan.notes[0] == "columns ignored: gpstime"
    scan = read_scan(write(tmp_path, "a.npy", npy(records.ravel())))
    np.testing.assert_array_equal(scan.points, surface()[SEEN])
    for odd in (np.zeros(9, [("x", "<f4"), ("y", "<f4")]), records[None], records[:0]):
        with pytest.raises(ReadError, match=r"records .* save x, y and z"):
            read_scan(write(tmp_path, "a.npy", npy(odd)))


def test_e57_may_tell_angles_and_ranges(tmp_path: Path):
    library = pytest.importorskip("pye57.libe57")
    names = ("sphericalRange", "sphericalAzimuth", "sphericalElevation", "sphericalInvalidState")
    table = np.array([[2, 0, 0, 0], [1, np.pi / 2, 0, 0], [3, 0, np.pi / 2, 0], [9, 0, 0, 1]]).T
    file = library.ImageFile(str(tmp_path / "a.e57"), "w")
    text, root = (lambda value: library.StringNode(file, value)), file.root()
    row, scan = library.StructureNode(file), library.StructureNode(file)
    buffers, scans = library.VectorSourceDestBuffer(), library.VectorNode(file, True)
    for name, column in zip(names, table.copy(), strict=True):
        row.set(name, library.FloatNode(file, 0.0, library.E57_DOUBLE, -9.0, 9.0))
        buffers.append(library.SourceDestBuffer(file, name, column, len(column), True, True))
    root.set("formatName", text("ASTM E57 3D Imaging Data File"))
    root.set("data3D", scans)
    scans.append(scan)
    scan.set("guid", text("one"))
    points = library.CompressedVectorNode(file, row, library.VectorNode(file, True))
    scan.set("points", points)
    writer = points.writer(buffers)
    writer.write(table.shape[1])
    writer.close()
    file.close()
    found = read_scan(tmp_path / "a.e57")
    np.testing.assert_allclose(found.points, [[2, 0, 0], [0, 1, 0], [0, 0, 3]], atol=1e-15)
    assert found.num_dropped == 1


def test_e57_numbers_may_be_scaled():
    libe57 = pytest.importorskip("pye57.libe57")
    from scanweld.io.scan_formats.e57 import number_of

    with TemporaryDirectory() as folder:
        image = libe57.ImageFile(f"{folder}/a.e57", "w")
        assert number_of(libe57.ScaledIntegerNode(image, 50, 0, 255, 0.5, 3.0)) == 28
        assert number_of(libe57.IntegerNode(image, 7, 0, 255)) == 7
        image.cancel()
