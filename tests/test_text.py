"""Points as text: every way to write the same numbers is read alike, or refused with its reason."""

import gzip
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanweld.errors import ReadError
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_scan

RNG = np.random.default_rng(3)
POINTS = np.round(RNG.normal(0, 50, (12, 3)), 3)
NORMALS = np.round(POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True), 4)
COLORS = RNG.integers(0, 256, (12, 3))
SCALARS = np.round(RNG.random((12, 2)), 3)
INDEX = np.arange(1, 13)[:, None]


def table(*columns: np.ndarray, mark: str = " ", comma: bool = False) -> str:
    rows = [[f"{value:g}" for value in row] for row in np.hstack(columns)]
    if comma:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    return "".join(mark.join(row) + "\n" for row in rows)


def read(folder: Path, text: str | bytes, suffix: str = "txt") -> RangeScan:
    path = folder / f"a.{suffix}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_scan(path)


def same(found: np.ndarray | None, wanted: np.ndarray) -> None:
    assert found is not None
    np.testing.assert_array_equal(found, wanted)


def reason(folder: Path, text: str, suffix: str = "txt") -> str:
    with pytest.raises(ReadError) as caught:
        read(folder, text, suffix)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("//X;Y;Z;R;G;B;Nx;Ny;Nz", [POINTS, COLORS, NORMALS]),
        ("# nx ny nz red green blue x y z", [NORMALS, COLORS, POINTS]),
        ('"Z","Y","X","Normal_X","Normal_Y","Normal_Z","r","g","b"',
         [POINTS[:, ::-1], NORMALS, COLORS]),
        ("# scan 7, 2024-05-01\nx[mm]\ty[mm]\tz[mm]\tB\tG\tR\tnx\tny\tnz",
         [POINTS, COLORS[:, ::-1], NORMALS]),
        ("Points:0,Points:1,Points:2,Normals:0,Normals:1,Normals:2,R,G,B",
         [POINTS, NORMALS, COLORS]),
        ("X_pos Y_pos Z_pos nx ny nz r g b", [POINTS, NORMALS, COLORS]),
        ("12\nx y z nx ny nz r g b", [POINTS, NORMALS, COLORS]),
        ("x y z nx ny nz r g b", [INDEX, POINTS, NORMALS, COLORS]),  # as R writes tables
        (",x,y,z,nx,ny,nz,r,g,b", [INDEX, POINTS, NORMALS, COLORS]),  # as pandas does
    ],
)  # fmt: skip
def test_columns_are_found_by_their_names(head: str, columns: list[np.ndarray], tmp_path: Path):
    for mark in (" ", ",", ";"):
        scan = read(tmp_path, head + "\r\n" + table(*columns, mark=mark))
        same(scan.points, POINTS)
        same(scan.normals, NORMALS)
        same(scan.colors, COLORS)
        assert not any("ignored" in note for note in scan.notes)


def test_columns_of_other_names_are_ignored_and_told(tmp_path: Path):
    head = "Time X Y Z Curvature Rf Gf Bf\n"
    scan = read(tmp_path, head + table(SCALARS[:, :1], POINTS, SCALARS[:, 1:], COLORS / 255))
    same(scan.points, POINTS)
    same(scan.colors, COLORS)
    assert scan.notes == ("columns ignored: time, curvature",)
    scan = read(tmp_path, "x,y,z,Zeit-Größe,\u65f6\n1,2,3,7 Uhr,9\n")
    assert scan.notes == ("columns ignored: zeitgrösse, \u65f6",)
    scan = read(tmp_path, "x y z Intensity\n" + table(POINTS, COLORS[:, :1] * 257))
    same(scan.colors, np.repeat(COLORS[:, :1], 3, axis=1))
    scan = read(tmp_path, "x y z r g b\n" + table(POINTS, -1 - COLORS))
    assert scan.colors is None and "no known scale" in scan.notes[0]


@pytest.mark.parametrize(
    ("columns", "normals", "colors", "note"),
    [
        ([POINTS], False, False, ""),
        ([POINTS, SCALARS], False, False, "4, 5"),
        ([POINTS, SCALARS, SCALARS[:, :1]], False, False, "4, 5, 6"),
        ([POINTS, COLORS / 255], False, False, "4, 5, 6"),
        ([POINTS, NORMALS], True, False, "4 to 6 read as unit normals"),
        ([POINTS, COLORS], False, True, "4 to 6 read as colours"),
        ([POINTS, COLORS, NORMALS], True, True, "7 to 9 read as unit normals"),
        ([POINTS, NORMALS, COLORS, SCALARS[:, :1]], True, True, "no names: 10"),
        ([POINTS, SCALARS, COLORS, SCALARS, SCALARS], False, True, "4, 5, 9, 10, 11, 12"),
        ([POINTS, COLORS, COLORS[:, :1]], False, False, "4, 5, 6, 7"),  # which three?
        ([INDEX, POINTS], False, False, "it counts the points"),
        ([INDEX - 1, POINTS, COLORS], False, True, "it counts the points"),
    ],
)  # fmt: skip
def test_without_names_only_what_is_certain_is_read(
    columns: list[np.ndarray], normals: bool, colors: bool, note: str, tmp_path: Path
):
    scan = read(tmp_path, table(*columns))
    same(scan.points, POINTS)
    assert (scan.normals is not None, scan.colors is not None) == (normals, colors)
    if normals:
        same(scan.normals, NORMALS)
    if colors:
        same(scan.colors, COLORS)
    assert note in "; ".join(scan.notes)
    assert bool(scan.notes) == bool(note)


def test_pts_has_intensity_before_colours(tmp_path: Path):
    scan = read(tmp_path, "12\n" + table(POINTS, COLORS[:, :1], COLORS), "pts")
    same(scan.colors, COLORS)
    text = "12\n" + table(POINTS, COLORS[:, :1])
    for scan in (
        read(tmp_path, text, "pts"),
        read(tmp_path, gzip.compress(text.encode()), "pts.gz"),
    ):
        same(scan.colors, np.repeat(COLORS[:, :1], 3, axis=1))


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ([POINTS[np.argsort(POINTS[:, 0])], SCALARS], "only rises"),  # or a time
        ([np.repeat(np.arange(6), 2)[:, None], COLORS[:, :1], POINTS], "row and column of a pixel"),
        ([NORMALS, POINTS], "may be normals or colours"),
        ([COLORS, POINTS], "may be normals or colours"),
        ([POINTS, *[SCALARS] * 5], "13 columns without names"),
        ([POINTS[:, :2]], "2 columns"),
        ([INDEX, POINTS[:, :1]], "2 columns"),
    ],
)
def test_columns_that_may_be_something_else_need_names(
    columns: list[np.ndarray], says: str, tmp_path: Path
):
    assert says in reason(tmp_path, table(*columns))


@pytest.mark.parametrize("mark", ["\t", ";", "; ", "   ", '","'])
def test_decimal_commas_are_read_right_where_they_can_be_nothing_else(mark: str, tmp_path: Path):
    text = table(POINTS, mark=mark, comma=True)
    if '"' in mark:
        text = "".join(f'"{line}"\n' for line in text.splitlines())
    for head in ("", "# x y z\n", "12\n"):
        scan = read(tmp_path, head + text)
        same(scan.points, POINTS)
        assert scan.notes == ("decimal commas read as points",)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1,5,2,5,3,5\n4,5,5,5,6,5\n", "line 1: '1,5,2,5,3,5': its commas may be decimal ones"),
        ("x,y,z\n1,5,2,5,3,5\n4,5,5,5,6,5\n", "3 column names|may be decimal"),
        ("1,5, 2,5, 3,5\n", "may be decimal ones"),
        ("12,05,3\n", "may be decimal ones"),
        ("1,034.5,2,100.0,7.5\n", "may be decimal ones"),
        ("1,234 5,678 9,012\n", "may separate thousands or decimals"),
        ("1,234.5 2,345.6 3.0\n", "commas and points"),
        ("1.234,5;2.345,6;3,0\n", "commas and points"),
        ("1.5 2.5 3.5\n1,5 2,5 3,5\n", "line 2: '1,5 2,5 3,5': commas and points"),
        ("1,234,567 2 3\n", "commas as well as semicolons or spaces"),
        ("1,2,3;4,5,6\n", "commas as well as semicolons or spaces"),
        ("1.234.567 2 3\n", "'1.234.567' is not a number"),
        ("1_000 2 3\n", "'1_000' is not a number"),
        ("1'000 2 3\n", "is not a number"),
        ("1 2 3 wall\n4 5 6 door\n", "line 1: 'wall' is not a number"),
        ("1 2 3\n4 5 6 7\n", "line 2: 4 numbers where the lines before have 3"),
        ("# a\n\n1 2 3\n4 5\n", "line 4: 2 numbers"),
        ("1,2,3\n1,,3\n4,5\n", "line 3: 2 numbers"),
        ("o 2 3\n4 5 6\n", "'o' in its first line of numbers is not a number"),
        ("lat lon h\n4 5 6\n", "no x, y and z among its column names 'lat lon h'"),
        ("z y x i\n4 5 6\n", "4 column names .* above 3 columns"),
        ("x y z r g b\n4 5 6 7\n", "6 column names .* above 4 columns"),
        ("x y z x\n4 5 6 7\n", "two columns are named x"),
        ("1 234,5;2 000,1;3,0\n", "line 1: '1 234,5;.*: a space in its numbers may separate"),
        ("1 234.5\t2 000.1\t3\n", "a space in its numbers may separate thousands"),
        ("1 234.5 2 000.1 3 7\n", "a space in its numbers may separate thousands"),
        ("1\xa0234.5 2 3\n", r"line 1: '1\\xa0234.5' is not a number"),
        ("0.1+03 0.2+01 3.5\n1 2 3\n", "'0.1.03' in its first line of numbers"),
        ("\u22121 \u22122 \u22123\n1 2 3\n", "in its first line of numbers is not a number"),
        ("ncols 2\nnrows 1\nxll 0\nyll 0\ncellsize 1\n1 2 3\n", "raster of heights"),
        ("x,y,z,t\n1,2,3,wall\n4,o,6,door\n", "line 3: 'o' is not a number"),
        ("x y z\n1 2 3 wall\n", "line 1: 'x' is not a number|'wall'"),
        ("a b\n" * 6 + "1 2 3\n", "6 lines of words above the numbers"),
        ("x y z\n", "holds no points"),
    ],
)
def test_what_is_not_certain_is_refused_with_its_reason(text: str, says: str, tmp_path: Path):
    assert re.search(says, reason(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("1.5D+02 -2d0 .5D-1\n", [[150, -2, 0.05]]),
        ("1.5,2,3,\n4,5,6,\n", [[1.5, 2, 3], [4, 5, 6]]),
        ("1, 2, 3\n4, 5, 6\n", [[1, 2, 3], [4, 5, 6]]),
        ("1,-2,3\n4,5,6\n", [[1, -2, 3], [4, 5, 6]]),
        ("x,y,z,q,p\n1,2,3,4,5\n", [[1, 2, 3]]),
        ("x,y,q,z\n1,2,,3\n,2,3,4\n5,6,7,8\n", [[1, 2, 3], [5, 6, 8]]),
        ("0,1,2\n0.5,1.5,2.5\n", [[0.5, 1.5, 2.5]]),  # pandas, without names
        (",0,1,2\n0,1.5,0,1\n1,2.5,7,1\n2,.5,9,3\n", [[1.5, 0, 1], [2.5, 7, 1], [0.5, 9, 3]]),
        ("inf 0 0 1e200\ninf 1 0 inf\n1 2 3 nan\n", [[1, 2, 3]]),
        ("0 0 1e300 1e200 inf 9\n1 2 -1e200 1e200 nan -inf\n", [[0, 0, 1e300], [1, 2, -1e200]]),
        ("x y z\n1 2 3\n4 #N/A 6\n7 NA 9\nnull 1 -1.#INF\n4 5 6 # 7\n", [[1, 2, 3], [4, 5, 6]]),
        ('t,x,y,z,l\n07:00:01,1,2,3,"a, b"\n07:00:02,4,5,6,c\n', [[1, 2, 3], [4, 5, 6]]),
        ("x;y;z;name\n1,5;2,5;3;a\n", [[1.5, 2.5, 3]]),
        ("x,y,z\nmm,mm,mm\n1.5,2,3\n", [[1.5, 2, 3]]),
        ("1 2;3\n4\t;5;\t6\n", [[1, 2, 3], [4, 5, 6]]),
        ("1 2 3\r4 5 6\r", [[1, 2, 3], [4, 5, 6]]),
        ("Export of 3 points\nfrom the big scanner\n1 2 3\n4 5 6\x1a", [[1, 2, 3], [4, 5, 6]]),
    ],
)
def test_odd_spellings_are_read_right(text: str, points: list[list[float]], tmp_path: Path):
    same(read(tmp_path, text).points, np.array(points))


@pytest.mark.parametrize(
    "encoding",
    ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be"],
)
def test_every_encoding_gives_the_same_points(encoding: str, tmp_path: Path):
    text = ("# gemessen in München\n" + table(POINTS)) if "sig" in encoding else table(POINTS)
    same(read(tmp_path, text.encode(encoding)).points, POINTS)


def test_what_is_no_text_is_named(tmp_path: Path):
    for data, says in ((b"\0\1\0\0" * 9, "is binary"), (b"\xff\xfe1\0 ", "begins as UTF-16 but")):
        (tmp_path / "a.xyz").write_bytes(data)
        with pytest.raises(ReadError, match=says):
            read_scan(tmp_path / "a.xyz")


@given(
    cells=st.lists(st.tuples(*[st.integers(-99999, 99999)] * 3), min_size=1, max_size=6),
    mark=st.sampled_from(["\t", ";", " ", ",", ", "]),
    digits=st.integers(0, 4),
    comma=st.booleans(),
)
def test_no_notation_is_read_as_another(
    cells: list[tuple[int, int, int]], mark: str, digits: int, comma: bool, tmp_path: Path
):
    rows = [[f"{value / 10**digits:.{digits}f}" for value in row] for row in cells]
    lines = [mark.join(cell.replace(".", "," if comma else ".") for cell in row) for row in rows]
    try:
        scan = read(tmp_path, "\n".join(lines))
    except ReadError:
        assert comma and digits  # points and whole numbers are always clear
    else:
        same(scan.points, np.array(rows, dtype=float))
