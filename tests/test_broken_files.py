"""Files of scans that are broken, or not what they are called: refused in one line, or read."""

import gzip
import re
import sys
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fuzz
from benchmarks.sample_files import (
    COLUMNS,
    HOLES,
    ROWS,
    SAMPLES,
    WITH_LIBRARIES,
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
from scanweld.io import read_scan
from scanweld.io.unpack import SMALL
from tests.scan_files import pcd_of, write


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
        # What is not what it is called.
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
def test_broken_files_say_what_is_wrong(name: str, data: bytes, says: str, tmp_path: Path):
    if name == "a.e57":
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
