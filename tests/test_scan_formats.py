"""Files of scans that other programs write: grid, pose and colours kept, all else told."""

import gzip
import re
import sys
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from benchmarks import fuzz
from benchmarks.sample_files import (
    COLUMNS,
    GROUND,
    HOLES,
    ROWS,
    SAMPLES,
    WITH_LIBRARIES,
    colors,
    glb,
    npy,
    pcd_binary,
    pcd_compressed,
    pcd_head,
    surface,
    vtk,
)
from benchmarks.sample_texts import SCANS
from scanweld.errors import ReadError
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io import collect, read_scan
from scanweld.io.raw import POSE_NOTE
from scanweld.io.scans import read_scans
from scanweld.io.unpack import SMALL

SEEN = np.isfinite(surface()).all(axis=2)
UNSEEN_NOTE = f"{len(HOLES)} points that are not finite dropped: nothing was seen there"


def write(folder: Path, name: str, data: bytes | None = None) -> Path:
    """A sample, or other bytes, as a file."""
    path = folder / name
    path.write_bytes(SAMPLES[name]() if data is None else data)
    return path


def assert_is_surface(scan: RangeScan) -> None:
    """A scan shows the samples' surface, with its grid."""
    assert scan.grid is not None and scan.grid.shape == (ROWS, COLUMNS)
    np.testing.assert_array_equal(scan.grid >= 0, SEEN)
    assert scan.num_dropped == len(HOLES)
    np.testing.assert_allclose(scan.points[scan.grid[SEEN]], surface()[SEEN], rtol=1e-7)


def assert_has_colors(scan: RangeScan) -> None:
    assert scan.grid is not None and scan.colors is not None
    np.testing.assert_array_equal(
        scan.colors[scan.grid[SEEN]], colors().reshape(ROWS, COLUMNS, 3)[SEEN]
    )


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


def pcd_of(told: str, *lines: str, viewpoint: str = "0 0 0 1 0 0 0") -> bytes:
    """An ASCII PCD without a grid; ``told`` are its fields, all single precision."""
    count = len(told.split())
    kinds = f"SIZE {'4 ' * count}\nTYPE {'F ' * count}\nWIDTH {len(lines)}\nHEIGHT 1"
    head = f"FIELDS {told}\r\n{kinds}\nVIEWPOINT {viewpoint}\nDATA ascii\n"
    return (head + "\n".join(lines)).encode()


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


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for library, name, extra in (("pye57", "a.e57", "e57"), ("laspy", "a.laz", "las")):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(ReadError, match=rf"pip install 'scanweld\[{extra}"):
            read_scan(write(tmp_path, name, b"anything"))


@pytest.mark.parametrize(
    ("name", "data", "what"),
    [
        ("a.pcd", pcd_of("x y z intensity", "0 0 1 -9", "1 0 1 900"), "intensities"),
        ("a.pcd", pcd_of("x y z r g b", "0 0 1 0 0 -1", "1 0 1 1 1 1"), "colours"),
        ("a.obj", b"v 0 0 1 0 0 900\nv 1 0 1 1 1 1\n", "colours"),
        ("a.off", b"COFF 2 0 0\n0 0 1 0 0 -1 1\n1 0 1 0 0 0 1\n", "colours"),
        ("a.ptx", SAMPLES["two.ptx"]().replace(b" 0.5", b" -2047"), "intensities"),
        (
            "a.ply",
            SCANS["mesh.ply"].replace("uchar", "int", 1).replace("0 4\n", "0 -4\n").encode(),
            "i",
        ),
    ],
)
def test_shades_on_no_known_scale_are_left_out_with_a_note(
    name: str, data: bytes, what: str, tmp_path: Path
):
    scan = read_scan(write(tmp_path, name, data))
    assert scan.colors is None
    assert any(re.match(rf"{what}.* ignored: on no known scale", note) for note in scan.notes)


@pytest.mark.parametrize(
    ("name", "change", "note"),
    [
        ("a.obj", lambda data: b"\xef\xbb\xbf" + data, ""),
        ("a.ply", lambda data: b"\xef\xbb\xbf" + data, ""),
        ("a.ptx", lambda data: data.replace(b"\n", b"\r"), ""),
        ("a.obj", lambda data: data + b"vn 0 0 1\n", "normals left out"),
        ("a.stl", bytes.upper, ""),
        ("a.vtk", lambda data: data.replace(b"ASCII", b"ascii").replace(b"POINTS", b"points"), ""),
        ("a.ply", lambda data: data.replace(b"other", b"strip"), "elements ignored: strip"),
        ("a.ply", lambda data: data.replace(b"num_cols 3", b"num_cols 9"), "9 x 1, are not its"),
    ],
)  # fmt: skip
def test_odd_dresses_change_nothing(
    name: str, change: Callable[[bytes], bytes], note: str, tmp_path: Path
):
    samples = {
        "a.obj": b"v 1 2 3\nv 4 5 6\nv 7 8 10\n",
        "a.ply": b"ply\nformat ascii 1.0\nobj_info num_cols 3\nobj_info num_rows 1\n"
        b"element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        b"element other 0\nend_header\n"
        b"1 2 3\n4 5 6\n7 8 10\n",
        "a.ptx": SAMPLES["two.ptx"](),
        "a.stl": b"solid a\nvertex 1 2 3\nvertex 4 5 6\nvertex 7 8 10\nendsolid a\n",
        "a.vtk": vtk(is_binary=False),
    }
    plain = read_scan(write(tmp_path, name, samples[name]))
    odd = read_scan(write(tmp_path, name, change(samples[name])))
    np.testing.assert_array_equal(odd.points, plain.points)
    assert note in "; ".join(odd.notes)


def test_bombs_are_refused(tmp_path: Path):
    bomb = gzip.compress(bytes(SMALL + 1))
    with pytest.raises(ReadError, match="unpacks to more than 64 MB"):
        read_scan(write(tmp_path, "a.ply.gz", bomb))
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", bytes(SMALL + 1))
    with pytest.raises(ReadError, match="unpacks to more than 64 MB"):
        read_scan(write(tmp_path, "a.npz", stream.getvalue()))


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.pcd", b"hello\n", "no line DATA"),
        ("a.pcd", pcd_head("x y", "4 4", "F F", "ascii") + b"0 0\n" * 42, "lack x, y or z"),
        ("a.pcd", pcd_head("x y z", "4 4", "F F F", "ascii"), "as many SIZE"),
        ("a.pcd", pcd_head("x y z x", "4 4 4 4", "F F F F", "ascii"), "two of its FIELDS"),
        ("a.pcd", pcd_head("x y z", "4 4 3", "F F F", "ascii"), "SIZE 3"),
        ("a.pcd", pcd_head("x y z", "4 4 4", "F F F", "zip"), "unknown DATA 'zip'"),
        ("a.pcd", pcd_head("x y z", "4 4 4", "F F F", "ascii") + b"0 0 0\n", "is shorter than 42"),
        ("a.pcd", pcd_head("x y z", "4 4 4", "F F F", "ascii") + b"0 0 0\n" * 43, "longer"),
        ("a.pcd", pcd_head("x y z", "4 4 4", "F F F", "ascii") + b"0 a 0\n" * 42, "line 12: 'a'"),
        ("a.pcd", pcd_binary()[:-1], "shorter"),
        ("a.pcd", pcd_binary() + b"1", "longer"),
        ("a.pcd", pcd_binary().replace(b"POINTS 42", b"POINTS 43"), "WIDTH x HEIGHT"),
        ("a.pcd", pcd_compressed()[:-9], "shorter"),
        # The first thing compressed is a copy of what is not there.
        ("a.pcd", re.sub(rb"(?s)(?<=compressed\n.{8}).", b"\xe0", pcd_compressed()), "broken"),
        ("a.pcd", pcd_binary().replace(b"WIDTH 7", b"WIDTH 0"), "WIDTH x HEIGHT"),
        ("a.xyz.gz", gzip.compress(b"0 0 0\n", mtime=0)[:-3], "cannot be unpacked"),
        ("a.gz", gzip.compress(b"0 0 0\n", mtime=0), "unknown format"),
        ("a.xyz.gz", gzip.compress(b"", mtime=0), "holds no points"),
        ("a.obj", b"v 0 0 0\nf 1 1 " + b"9" * 30, "line 2: .* is broken"),
        ("a.ply", SAMPLES["organised.ply"]().replace(b"end_h", b"element vertex 0\nend_h"), "two"),
        ("a.npy", npy(surface())[:-1], "truncated"),
        ("a.npy", npy(np.zeros((4, 5))), r"shape \(4, 5\)"),
        ("a.npy", npy(np.array([{}])), "save the points as numbers"),
        ("a.npz", b"PK\3\4", "cannot be unpacked"),
        ("a.vtk", b"hello", "not a VTK legacy file"),
        ("a.vtk", vtk(is_binary=True)[:-9], "too early"),
        ("a.vtk", vtk(is_binary=False)[:-90], "too early"),
        ("a.vtk", vtk(is_binary=False).replace(b"STRUCTURED_GRID", b"FIELD"), "POLYDATA"),
        ("a.glb", b"glTF", "not a GLB file"),
        ("a.glb", glb()[:-9], "truncated"),
        ("a.glb", glb().replace(b'"count": 4', b'"count": 9'), "smaller than it says"),
        ("a.glb", glb().replace(b"[0, 2]", b"[0, 1]"), "no tree"),
        ("a.glb", glb().replace(b'"mode": 0', b'"mode": 5'), "strips"),
        ("a.ptx", b"3\n2\n0 0 0\n", "no scan of a PTX file begins here"),
        ("a.ptx", SAMPLES["two.ptx"]()[:-900], "scan 2 has"),
        ("a.ptx", SAMPLES["two.ptx"]() + b"7\n", "line 105: no scan"),
        (
            "a.glb",
            glb().replace(b'"asset": {"version": "2.0"}', b'"extensionsRequired":["EX"]'),
            "needs EX, which is not read",
        ),
        ("a.stl", SAMPLES["binary.stl"]() + b"\0" * 7, "goes on behind its"),
        ("a.xyz.gz", b"0 0 1\n1 0 1\n", "is not packed; take .gz off"),
    ],
)
def test_broken_files_say_what_is_wrong(name: str, data: bytes, says: str, tmp_path: Path):
    with pytest.raises(ReadError, match=says) as caught:
        read_scan(write(tmp_path, name, data))
    assert str(caught.value).startswith(f"{tmp_path / name}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.xyz", pcd_binary(), "is PCD by its content; call it .pcd"),
        ("a.ply", gzip.compress(pcd_binary(), mtime=0), "is packed by gzip; add .gz to its name"),
        ("a.ply.gz", gzip.compress(pcd_binary(), mtime=0), "is PCD by its content"),
        ("a.e57", b"0 0 1\n1 0 1\n", "begins with numbers as text; call it .xyz"),
        ("a.obj", b"<!DOCTYPE html><html>", "is a web page; download the file again"),
        (
            "a.las",
            b"version https://git-lfs.github.com/spec/v1\n",
            "is a pointer of Git LFS; fetch",
        ),
        ("a.stl", b"PK\3\4abc", "is a ZIP archive; unpack it"),
        ("a.xyz", b"BZh91AY", "is packed; unpack it"),
        ("a.xyz.gz", gzip.compress(gzip.compress(b"0 0 1\n", mtime=0), mtime=0), "packed twice"),
        ("a.obj", "v 1 2 3\n".encode("utf-16"), "is text in UTF-16; save it as UTF-8"),
        ("a.pcd", b"\x89PNG\r\n", "is a picture or a document; leave it out"),
        (
            "a.xyz",
            b"7 7 7\n" * 60,
            r"none that was seen \(60 points that are all \(7, 7, 7\) dropped",
        ),
    ],
)
def test_files_that_are_not_what_they_are_called_say_what_they_are(
    name: str, data: bytes, says: str, tmp_path: Path
):
    if name.endswith("e57"):
        pytest.importorskip("pye57")
    with pytest.raises(ReadError, match=says) as caught:
        read_scan(write(tmp_path, name, data))
    assert str(caught.value).startswith(f"{tmp_path / name}: ") and "\n" not in str(caught.value)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", fuzz.samples())
def test_mutated_files_are_read_or_refused(name: str, tmp_path: Path):
    data = fuzz.samples()[name]()
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    for seed in range(50):
        broken = fuzz.broken_file(name, data, np.random.default_rng(seed))
        fuzz.read_all(name, write(tmp_path, name, broken))
    assert fuzz.read_all(name, write(tmp_path, name, data))


@pytest.mark.filterwarnings("error")
def test_numbers_that_no_arithmetic_holds_are_dropped_without_warnings(tmp_path: Path):
    signalling = np.full(3, 0x7FA00000, "<u4").tobytes()
    data = pcd_head("x y z", "4 4 4", "F F F", "binary") + surface().astype("<f4").tobytes()
    scan = read_scan(write(tmp_path, "a.pcd", data[:-12] + signalling))
    assert scan.num_dropped == len(HOLES) + 1
    lines = SAMPLES["two.ptx"]().replace(b"1 0 0 0", b"1e300 1e300 0 0", 1)
    assert "no rigid motion" in read_scan(write(tmp_path, "a.ptx", lines)).notes[0]


def test_wrong_sizes_of_packed_pieces_end_nothing(tmp_path: Path, capfd: pytest.CaptureFixture):
    """What reads LAZ in parallel believes them, reserves the memory, and ends the process."""
    pytest.importorskip("lazrs")
    data = WITH_LIBRARIES["points.laz"][1]()
    start = int.from_bytes(data[96:100], "little")
    table = int.from_bytes(data[start : start + 8], "little") + 8
    lying = data[:table] + b"\xff" * (len(data) - table)
    assert len(read_scan(write(tmp_path, "a.laz", lying)).points) == ROWS * COLUMNS
    head = data.index(b"laszip encoded") + 52
    unchunked = data[:head] + b"\1\0" + data[head + 2 :]
    with pytest.raises(ReadError, match="without chunks, as LASzip 1 did; unpack it to LAS"):
        read_scan(write(tmp_path, "a.laz", unchunked))
    assert capfd.readouterr() == ("", "")


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
