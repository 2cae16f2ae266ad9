"""Meshes and text as scans: what they mean, and what is refused with the line that is wrong."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from scanweld.errors import ReadError
from scanweld.io import read_mesh, read_scan

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def put(path: Path, text: str) -> Path:
    path.write_bytes(text.encode("utf-8"))
    return path


def obj_text(vertices: np.ndarray, faces: np.ndarray) -> str:
    lines = [f"v {' '.join(map(repr, v))}" for v in vertices.tolist()]
    return "\n".join(lines + [f"f {' '.join(str(k + 1) for k in f)}" for f in faces.tolist()])


def off_text(vertices: np.ndarray, faces: np.ndarray) -> str:
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(map(repr, v)) for v in vertices.tolist()]
    return "\n".join(lines + [f"3 {' '.join(map(str, f))}" for f in faces.tolist()])


@settings(max_examples=40)
@given(
    vertices=nps.arrays(np.float64, (5, 3), elements=st.floats(-1e9, 1e9)),
    faces=nps.arrays(np.int64, (4, 3), elements=st.integers(0, 4)),
)
def test_obj_and_off_are_read_exactly(vertices: np.ndarray, faces: np.ndarray, tmp_path: Path):
    for name, text in (("a.obj", obj_text(vertices, faces)), ("a.off", off_text(vertices, faces))):
        mesh = read_mesh(put(tmp_path / name, text))
        np.testing.assert_array_equal(mesh.vertices, vertices)
        np.testing.assert_array_equal(mesh.faces, faces)


def test_obj_corners_of_all_kinds_and_none(tmp_path: Path):
    text = """# a square and a triangle
    mtllib some.mtl
    v 0 0 0 1.0 0.0 0.5
    v 1 0 0 0 1 0
    v 1 1 0 0 0 0
    v 0 1 0 0 0 1  # blue
    vt 0.5 0.5
    vn 0 0 1
    f 1/1/1 2/1/1 \\
      3//1 4
    f -4 -3/1 -2
    """
    scan = read_scan(put(tmp_path / "a.obj", text))
    assert scan.faces is not None and scan.colors is not None
    np.testing.assert_array_equal(scan.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2]])
    np.testing.assert_array_equal(scan.colors[:2], [[255, 0, 128], [0, 255, 0]])
    scan = read_scan(put(tmp_path / "a.obj", "v 1 2 3\nv nan 0 0\nv 4 5 6\n"))
    assert scan.faces is None
    assert scan.num_dropped == 1
    np.testing.assert_array_equal(scan.points, [[1, 2, 3], [4, 5, 6]])


def test_off_with_everything(tmp_path: Path):
    text = "CNOFF 3 1 0 # counts here\n\n0 0 0 0 0 1 255 0 0 255\n1 0 0 0 0 1 0 9 0 255\n"
    text += "0 1 0 0 0 1 0 0 9 255\n3 0 1 2 0.5 0.5 0.5\n"
    mesh = read_mesh(put(tmp_path / "a.off", text))
    assert mesh.normals is not None and mesh.colors is not None
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 3)
    np.testing.assert_array_equal(mesh.colors, [[255, 0, 0], [0, 9, 0], [0, 0, 9]])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])


def stl_bytes(corners: np.ndarray, head: bytes = b"solid binary nonetheless") -> bytes:
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *facet.ravel(), 0) for facet in corners)
    return head.ljust(80, b"\0") + struct.pack("<I", len(corners)) + facets


def test_a_binary_stl_has_a_vertex_where_corners_coincide_and_is_whole(tmp_path: Path):
    collapsed = np.array([[[0, 0, 0], [1, 0, 0], [1, 0, 0]]])
    path = tmp_path / "a.stl"
    path.write_bytes(stl_bytes(np.concatenate([TETRAHEDRON[FACES], collapsed, -0.0 * collapsed])))
    mesh = read_mesh(path)
    # In the order of first appearance: corners 0, 2, 1 of the first face, then 3.
    np.testing.assert_array_equal(mesh.vertices, TETRAHEDRON[[0, 2, 1, 3]])
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], TETRAHEDRON[FACES])
    data = stl_bytes(TETRAHEDRON[FACES])
    path = tmp_path / "cut.stl"
    for size in range(len(data)):
        path.write_bytes(data[:size])
        with pytest.raises(ReadError):
            read_scan(path)


def test_ascii_stl(tmp_path: Path):
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x:g} {y:g} {z:e}\n" for x, y, z in facet)
        + "endloop\nendfacet\n"
        for facet in TETRAHEDRON[FACES]
    )
    mesh = read_mesh(put(tmp_path / "a.stl", f"solid vertex\n{facets}endsolid vertex\n"))
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], TETRAHEDRON[FACES])


@pytest.mark.parametrize(
    "text",
    [
        "0 0 1\n1 0 2\n0 1 3\n",
        "# x y z\n0 0 1\n\n1 0 2 # second\n0 1 3",
        "x,y,z\n0,0,1\n1,0,2\n0,1,3\n",
        "\ufeff//X Y Z\r\n0;0;1\r\n1;0;2\r\n0;1;3\r\n",
        "3\n0\t0\t1\n1, 0, 2\n0 1 3\n",
        "0 0 1\n1 0 2\nnan 1.#QNAN 0\n0 1 3\n",
    ],
)
def test_text_of_points(text: str, tmp_path: Path):
    for suffix in ("xyz", "txt", "csv"):
        scan = read_scan(put(tmp_path / f"a.{suffix}", text))
        np.testing.assert_array_equal(scan.points, [[0, 0, 1], [1, 0, 2], [0, 1, 3]])
        assert scan.num_dropped == text.count("nan")


def test_three_more_columns_are_normals_or_colors(tmp_path: Path):
    normals = read_scan(put(tmp_path / "a.xyz", "0 0 0 0 0.6 0.8\n1 0 0 0 0 -1\n1 1 1 0 0 0\n"))
    assert normals.normals is not None and normals.colors is None
    np.testing.assert_array_equal(normals.normals, [[0, 0.6, 0.8], [0, 0, -1], [0, 0, 0]])
    colors = read_scan(put(tmp_path / "b.xyz", "0 0 0 0 0 0\n1 0 0 255 16 1\n"))
    assert colors.colors is not None and colors.normals is None
    np.testing.assert_array_equal(colors.colors, [[0, 0, 0], [255, 16, 1]])


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.xyz", "# only\n", "holds no points"),
        ("a.xyz", "0 0 0\n1 0\n", "line 2: 2 numbers where the lines before have 3"),
        ("a.xyz", "# hello\n0 0 0\n1 o 0\n", "line 3: 'o' is not a number"),
        ("a.xyz", "Our scans\nare in the folder.\n", "line 1: 'Our' is not a number"),
        ("a.xyz", "5\n0 0 0\n1 1 1\n", "2 points but says 5"),
        ("a.xyz", "0 0\n1 1\n", "2 columns"),
        ("a.obj", "f 1 2 3\n", "no vertices"),
        ("a.obj", "v 0 0 0\nv 1 x 0\n", "line 2: 'v 1 x 0' is broken"),
        ("a.obj", "v 0 0 0\nf 0 1 1\n", "line 2: 'f 0 1 1' is broken"),
        ("a.obj", "v 0 0 0\nf 1 -2 1\n", "line 2: 'f 1 -2 1' is broken"),
        ("a.obj", "v 0 0 0\nf 1 2 1\n", "name point 1, but"),
        ("a.obj", "v 0 0\n", r"\[2\] numbers"),
        ("a.obj", "v 1_0 0 0\n", "line 1: 'v 1_0 0 0' is broken"),
        ("a.off", "OFF\n1 0 0\n0 1_0 0\n", "line 3: '0 1_0 0' is broken"),
        ("a.off", "hello\n", "not an OFF file"),
        ("a.off", "OFF\n", "broken"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n", "2 lines for 3 vertices and 1 faces"),
        ("a.off", "OFF\n1 1 0\n0 0 0\n3 0 0\n", "line 4: '3 0 0' is broken"),
        ("a.off", "OFF\n1 1 0\n0 y 0\n3 0 0 0\n", "line 3: '0 y 0' is broken"),
        ("a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 7\n", "name point 7"),
        # Superscripts are digits to Python and no numbers.
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 3²\nend_header\n",
            "is not 'element NAME COUNT'",
        ),
        ("a.stl", "just some text\n", "not an STL file"),
        ("a.stl", "solid a\nvertex 0 0 0\nvertex 1 0 0\nendsolid\n", "2 corners"),
        ("a.stl", "solid a\nvertex 0 0 0\nvertex 1 0 0\n", "truncated"),
        ("a.stl", "solid a\nvertex 0 0\nendsolid\n", "line 2: 'vertex 0 0' is broken"),
        ("a.stl", "solid a\nendsolid\n", "holds no points"),
    ],
)
def test_broken_files_are_refused_in_one_line(name: str, text: str, says: str, tmp_path: Path):
    path = put(tmp_path / name, text)
    with pytest.raises(ReadError, match=says) as caught:
        read_scan(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
