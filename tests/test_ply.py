"""PLY: odd files read right, broken ones refused in one line, written ones read back exactly."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from scanweld.errors import ReadError, WriteError
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io import read_mesh, read_scan, write_mesh_ply, write_scan_ply
from tests.data import require_data

ODD = Path(__file__).parent / "odd"
XYZ = "property float x\nproperty float y\nproperty float z\n"
GRID = "property list uchar int vertex_indices\n"


def ascii_ply(path: Path, header: str, body: str) -> Path:
    path.write_bytes(f"ply\nformat ascii 1.0\n{header}end_header\n{body}".encode())
    return path


def assert_same_scan(a: RangeScan, b: RangeScan) -> None:
    """Everything measured is the same to the last bit."""
    assert a.content_hash() == b.content_hash()
    assert a.viewpoint is b.viewpoint


# What odd files mean


@pytest.mark.parametrize("name", ["range_grid", "big_endian", "crlf"])
def test_the_same_range_grid_in_three_dresses(name: str) -> None:
    scan = read_scan(ODD / f"{name}.ply")
    assert scan.name == name
    np.testing.assert_array_equal(scan.points, [[0, 0, 1], [1, 0, 1.5], [0, 1, 2], [5, 5, 5]])
    assert scan.grid is not None
    np.testing.assert_array_equal(scan.grid, [[0, -1, 1], [-1, 2, -1]])
    assert scan.notes == ("1 points lie in no cell of the grid",)
    assert scan.viewpoint is Viewpoint.UNKNOWN
    assert scan.camera is None


def test_stray_header_lines_are_skipped_and_one_point_is_a_scan() -> None:
    scan = read_scan(ODD / "stray_lines.ply")
    assert scan.grid is not None
    np.testing.assert_array_equal(scan.grid, [[1, 0]])
    np.testing.assert_array_equal(read_scan(ODD / "one_point.ply").points, [[1, 2, 3]])


def test_points_that_are_not_finite_go_with_their_cells_and_faces() -> None:
    scan = read_scan(ODD / "nan_points.ply")
    assert scan.num_dropped == 3
    np.testing.assert_array_equal(scan.points, [[0, 0, 1], [1, 0, 1], [0, 1, 1]])
    assert scan.grid is not None and scan.faces is not None and scan.normals is not None
    np.testing.assert_array_equal(scan.grid, [[-1, 0], [1, -1], [2, -1]])
    np.testing.assert_array_equal(scan.faces, [[0, 1, 2]])
    np.testing.assert_array_equal(scan.normals, [[0, 0, 1], [0, 0, 0], [0, 1, 0]])


def test_polygons_become_fans() -> None:
    faces = [[1, 4, 2], [0, 1, 2], [0, 2, 3], [0, 1, 4], [0, 4, 5], [0, 5, 2]]
    scan = read_scan(ODD / "quads.ply", name="other")
    assert scan.name == "other"
    assert scan.faces is not None
    np.testing.assert_array_equal(scan.faces, faces)
    np.testing.assert_array_equal(read_mesh(ODD / "quads.ply").faces, faces)


def test_properties_in_odd_order_between_other_elements() -> None:
    scan = read_scan(ODD / "odd_order.ply")
    np.testing.assert_array_equal(scan.points, [[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    assert scan.faces is not None and scan.colors is not None and scan.confidence is not None
    np.testing.assert_array_equal(scan.faces, [[0, 1, 2]])
    np.testing.assert_array_equal(scan.colors, [[10, 20, 30], [11, 21, 31], [12, 22, 32]])
    np.testing.assert_array_equal(scan.confidence, [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("kind", "rows", "expected"),
    [
        ("float", "0 0.5 1", [0, 128, 255]),
        ("float", "0 128 255", [0, 128, 255]),
        ("uchar", "0 1 1", [0, 1, 1]),
        ("ushort", "0 257 65535", [0, 1, 255]),
    ],
)
def test_colors_follow_their_declared_type(
    tmp_path: Path, kind: str, rows: str, expected: list[int]
) -> None:
    colors = "".join(f"property {kind} {c}\n" for c in ("red", "green", "blue"))
    path = ascii_ply(tmp_path / "a.ply", f"element vertex 1\n{XYZ}{colors}", f"0 0 0 {rows}\n")
    scan = read_scan(path)
    assert scan.colors is not None
    np.testing.assert_array_equal(scan.colors, [expected])


def test_what_was_read_otherwise_or_left_out_is_noted(tmp_path: Path) -> None:
    header = f"element vertex 2\n{XYZ}property float intensity\n"
    scan = read_scan(ascii_ply(tmp_path / "a.ply", header, "0 0 0 0.2\n1 0 0 1\n"))
    assert scan.colors is not None
    np.testing.assert_array_equal(scan.colors, [[51, 51, 51], [255, 255, 255]])
    assert scan.notes == ("intensity read as grey",)
    header = f"element vertex 1\n{XYZ}property uchar alpha\nproperty float scalar_Time\n"
    scan = read_scan(ascii_ply(tmp_path / "a.ply", header, "0 0 0 255 7\n"))
    assert scan.notes == ("properties ignored: scalar_time",)
    header = f"element vertex 1\n{XYZ}element range_grid 1\n{GRID}"
    scan = read_scan(ascii_ply(tmp_path / "a.ply", header, "0 0 0\n1 0\n"))
    assert scan.grid is None
    assert scan.notes == ("range grid of unknown shape left out",)


@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("first_byte", [b"\n", b"\r", b" "])
def test_a_binary_body_may_begin_with_what_looks_like_a_line_end(
    tmp_path: Path, newline: bytes, first_byte: bytes
) -> None:
    lines = [b"ply", b"format binary_little_endian 1.0", b"element vertex 1"]
    lines += [b"property uchar flags", *(f"property float {c}".encode() for c in "xyz")]
    data = newline.join([*lines, b"end_header", first_byte + struct.pack("<3f", 1, 2, 3)])
    path = tmp_path / "a.ply"
    path.write_bytes(data)
    np.testing.assert_array_equal(read_scan(path).points, [[1, 2, 3]])


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_rows_with_lists_of_any_length(tmp_path: Path, order: str) -> None:
    endian = "little" if order == "<" else "big"
    header = (
        f"ply\nformat binary_{endian}_endian 1.0\nelement vertex 4\n{XYZ}element face 3\n"
        "property short flags\nproperty list ushort uint vertex_index\n"
        "property list uchar double weights\nend_header\n"
    )
    points = np.arange(12, dtype=order + "f4").tobytes()
    rows = [((0, 1, 2), (0.5,)), ((0, 1, 2, 3), ()), ((3, 2), (1.0, 2.0))]
    body = b"".join(
        struct.pack(f"{order}hH{len(f)}IB{len(w)}d", -7, len(f), *f, len(w), *w) for f, w in rows
    )
    path = tmp_path / "a.ply"
    path.write_bytes(header.encode() + points + body)
    np.testing.assert_array_equal(read_mesh(path).faces, [[0, 1, 2], [0, 1, 2], [0, 2, 3]])


# What is refused


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("empty", "file is empty"),
        ("text", "not a PLY file"),
        ("truncated", "truncated.*'vertex' of 40 rows"),
        ("missing", "No such file"),
    ],
)
def test_broken_files_are_refused_in_one_line(name: str, says: str) -> None:
    path = ODD / f"{name}.ply"
    with pytest.raises(ReadError, match=says) as caught:
        read_scan(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


CAMERA = "obj_info scanweld_camera"
MIRROR = "1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1"
GRID_OF_TWO = f"obj_info num_cols 2\nobj_info num_rows 1\nelement vertex 1\n{XYZ}"
TWO_CELLS = f"{GRID_OF_TWO}element range_grid 2\n{GRID}"


@pytest.mark.parametrize(
    ("header", "body", "says"),
    [
        (f"element vertex 1\n{XYZ}", "0 0 0\n1 1 1\n", "more than its header says"),
        (f"element vertex 2\n{XYZ}", "0 0 0\n", "ends too early"),
        (f"element vertex 2\n{XYZ}", "0 0 0\n1 oops 1\n", "line 9: 'oops' is not a number"),
        (f"element vertex 1\n{XYZ}", "nan 0 0\n", "not finite"),
        (f"element vertex 0\n{XYZ}", "", "holds no points"),
        (f"element point 1\n{XYZ}", "0 0 0\n", "no element 'vertex'"),
        ("element vertex 1\nproperty float x\n", "0\n", "lack x, y or z"),
        ("element vertex -1\n", "", "not 'element NAME COUNT'"),
        ("element vertex 1\nproperty floatt x\n", "0\n", "not a property of a known type"),
        (TWO_CELLS, "0 0 0\n1 0\n1 1\n", "name point 1, but"),
        (TWO_CELLS, "0 0 0\n1 0\n2 0 0\n", "several points"),
        (f"{GRID_OF_TWO}element range_grid 3\n{GRID}", "0 0 0\n1 0\n0\n0\n", "has 3 cells"),
        (TWO_CELLS, "0 0 0\n1 0\n0.5\n", "whole number"),
        (TWO_CELLS, "0 0 0\n1 0\n-1\n", "whole number"),
        (TWO_CELLS, "0 0 0\n1 0.5\n0\n", "whole number"),
        (TWO_CELLS, "0 0 0\n1 0\n1e300\n", "ends too early"),
        (f"{GRID_OF_TWO}element face 1\n{GRID}", "0 0 0\n3 0 -2 0\n", "name point -2"),
        (f"{GRID_OF_TWO}{CAMERA} fisheye 1 1 1 1 0 0\n", "0 0 0\n", "is not a model"),
        (f"{GRID_OF_TWO}{CAMERA}\n", "0 0 0\n", "is not a model"),
        (f"{GRID_OF_TWO}obj_info scanweld_scan_from_sensor 1 2 3\n", "0 0 0\n", "instead of 16"),
        (f"obj_info scanweld_scan_from_sensor {MIRROR}\n{GRID_OF_TWO}", "0 0 0\n", "not a rigid"),
        (f"{CAMERA} pinhole 2 2 1 1 0 0\n{TWO_CELLS}", "0 0 0\n1 0\n0\n", "2 x 2 pixels"),
    ],
)
def test_contradictions_are_refused(tmp_path: Path, header: str, body: str, says: str) -> None:
    path = ascii_ply(tmp_path / "a.ply", header, body)
    with pytest.raises(ReadError, match=says) as caught:
        read_scan(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_every_truncation_of_a_binary_scan_is_refused(tmp_path: Path) -> None:
    data = (ODD / "big_endian.ply").read_bytes()
    path = tmp_path / "cut.ply"
    for size in range(len(data)):
        path.write_bytes(data[:size])
        with pytest.raises(ReadError, match=re.escape(str(path))):
            read_scan(path)


def test_unknown_suffix_and_points_as_mesh_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="unknown format"):
        read_scan(tmp_path / "a.docx")
    with pytest.raises(ReadError, match="no faces"):
        read_mesh(ODD / "range_grid.ply")


# What is written comes back

lengths = st.floats(-1e6, 1e6)


@st.composite
def scans(draw: st.DrawFn) -> RangeScan:
    n = draw(st.integers(1, 6))
    single = draw(st.booleans())
    values = st.floats(-1e6, 1e6, width=32) if single else lengths
    maybe = lambda make: draw(st.one_of(st.none(), make))  # noqa: E731
    rows, columns = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    pose = Pose(rotation=random_rotation(rng), translation=rng.normal(size=3) * 10)
    has_pose = draw(st.booleans())
    camera = Camera(
        model=draw(st.sampled_from(CameraModel)),
        width=columns,
        height=rows,
        fx=draw(st.floats(1e-3, 1e4)),
        fy=draw(st.floats(1e-3, 1e4)),
        cx=draw(lengths),
        cy=draw(lengths),
    )
    return RangeScan(
        name="scan",
        points=draw(nps.arrays(np.float64, (n, 3), elements=values)),
        grid=maybe(nps.arrays(np.int64, (rows, columns), elements=st.integers(-1, n - 1))),
        faces=maybe(
            nps.arrays(np.int64, (draw(st.integers(1, 5)), 3), elements=st.integers(0, n - 1))
        ),
        normals=maybe(nps.arrays(np.float64, (n, 3), elements=st.floats(-1, 1))),
        colors=maybe(nps.arrays(np.uint8, (n, 3))),
        confidence=maybe(nps.arrays(np.float64, (n,), elements=st.floats(0, 1))),
        camera=camera if draw(st.booleans()) else None,
        scan_from_sensor=pose if has_pose else None,
        viewpoint=Viewpoint.GIVEN if has_pose else Viewpoint.UNKNOWN,
    )


@settings(max_examples=150)
@given(scan=scans())
def test_a_written_scan_is_read_back_exactly(scan: RangeScan, tmp_path: Path) -> None:
    path = tmp_path / "scan.ply"
    write_scan_ply(path, scan)
    again = read_scan(path)
    assert_same_scan(scan, again)
    first = path.read_bytes()
    write_scan_ply(path, again)
    assert path.read_bytes() == first
    assert [entry.name for entry in tmp_path.iterdir()] == ["scan.ply"]


def test_an_estimated_viewpoint_is_not_written_as_given(tmp_path: Path) -> None:
    scan = RangeScan(name="a", points=np.eye(3))
    write_scan_ply(tmp_path / "a.ply", scan.with_sensor(Pose.identity(), Viewpoint.ESTIMATED))
    assert read_scan(tmp_path / "a.ply").viewpoint is Viewpoint.UNKNOWN


def test_a_written_mesh_is_read_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(5, 3))
    mesh = TriangleMesh(
        vertices=rng.normal(size=(5, 3)) * 1e3,
        faces=rng.integers(0, 5, size=(4, 3)),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        colors=rng.integers(0, 256, size=(5, 3), dtype=np.uint8),
    )
    write_mesh_ply(tmp_path / "mesh.ply", mesh)
    again = read_mesh(tmp_path / "mesh.ply")
    np.testing.assert_array_equal(again.vertices, mesh.vertices)
    np.testing.assert_array_equal(again.faces, mesh.faces)
    assert mesh.normals is not None and again.normals is not None
    assert again.colors is not None and mesh.colors is not None
    np.testing.assert_array_equal(again.normals, mesh.normals.astype(np.float32))
    np.testing.assert_array_equal(again.colors, mesh.colors)


@pytest.mark.parametrize("is_file", [False, True])
def test_a_failed_write_names_the_target_and_leaves_what_is_there(tmp_path: Path, is_file: bool):
    if is_file:
        (tmp_path / "nowhere").write_text("a file")
    target = tmp_path / "a.ply"
    target.mkdir()
    (target / "kept").write_text("kept")
    before = sorted(tmp_path.rglob("*"))
    for path in (tmp_path / "nowhere" / "a.ply", target):
        with pytest.raises(WriteError, match=re.escape(str(path))):
            write_scan_ply(path, RangeScan(name="a", points=np.eye(3)))
    assert sorted(tmp_path.rglob("*")) == before


# The real files


@pytest.mark.parametrize(("folder", "count"), [("stanford-bunny", 10), ("stanford-dragon", 15)])
def test_all_stanford_scans_fill_their_grids(folder: str, count: int, tmp_path: Path) -> None:
    paths = sorted(p for p in require_data(folder).glob("*.ply") if "zipper" not in p.name)
    assert len(paths) == count
    for path in paths:
        scan = read_scan(path)
        assert scan.grid is not None
        seen = scan.grid[scan.grid >= 0]
        np.testing.assert_array_equal(np.sort(seen), np.arange(len(scan.points)))
        assert scan.num_dropped == 0 and not scan.notes
        # Neighbours in a row of the grid are neighbours on the object: the pitch is 0.5 mm.
        left, right = scan.grid[:, :-1], scan.grid[:, 1:]
        both = (left >= 0) & (right >= 0)
        steps = np.linalg.norm(scan.points[right[both]] - scan.points[left[both]], axis=1)
        assert 0.4e-3 < np.median(steps) < 0.8e-3
        write_scan_ply(tmp_path / "again.ply", scan)
        assert_same_scan(scan, read_scan(tmp_path / "again.ply"))


@pytest.mark.parametrize(
    ("name", "num_vertices", "num_faces"),
    [
        ("meshes/armadillo.ply", 49990, 99976),
        ("meshes/bunny.ply", 34834, 69451),
        ("stanford-bunny/bun_zipper.ply", 35947, 69451),
    ],
)
def test_real_meshes(name: str, num_vertices: int, num_faces: int) -> None:
    mesh = read_mesh(require_data(name))
    assert mesh.vertices.shape == (num_vertices, 3)
    assert mesh.faces.shape == (num_faces, 3)
    edges = np.linalg.norm(np.diff(mesh.vertices[mesh.faces[:, :2]], axis=1), axis=2)
    extent = np.ptp(mesh.vertices, axis=0).max()
    assert np.median(edges) < 0.02 * extent
