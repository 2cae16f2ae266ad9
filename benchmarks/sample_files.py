"""Small files of every format of scans, made here: what readers are tested and mutated with.

All show the same surface, of 6 rows and 7 columns, of which two cells saw nothing.
"""

import gzip
import json
import struct
from collections.abc import Callable
from importlib import import_module
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.sample_texts import SCANS
from scanweld.geometry.arrays import ByteArray, FloatArray

Columns = dict[str, NDArray]

ROWS, COLUMNS = 6, 7
HOLES = ((0, 0), (3, 4))
GROUND = np.array([[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, -3], [0, 0, 0, 1]], dtype=np.float64)
"""world_from_scan (4, 4) of the second scan of files that hold two; the first's is the identity."""


def surface() -> FloatArray:
    """Points (6, 7, 3), exact in single precision; NaN where nothing was seen."""
    v, u = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    points = np.stack([u / 4, v / 4, 8 + (u - 3) ** 2 / 32 + v * u / 64], axis=-1)
    for hole in HOLES:
        points[hole] = np.nan
    return points


def colors() -> ByteArray:
    """Their colours (42, 3), row after row."""
    return (np.arange(3 * ROWS * COLUMNS).reshape(-1, 3) * 2 % 256).astype(np.uint8)


def pcd_head(
    fields: str,
    sizes: str,
    types: str,
    data: str,
    counts: str = "",
    shape: tuple[int, int] = (ROWS, COLUMNS),
) -> bytes:
    """The header of a PCD file of so many rows and columns, those of the surface if not given."""
    counts = counts or " ".join("1" for _ in fields.split())
    rows, columns = shape
    return (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nCOUNT {counts}\n"
        f"WIDTH {columns}\nHEIGHT {rows}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {rows * columns}\n"
        f"DATA {data}\n"
    ).encode()


def pcd_ascii() -> bytes:
    """With padding of four numbers a point, as old versions of PCL write it."""
    lines = [f"{x:g} {y:g} {z:.9g} 0 0 128 63" for x, y, z in surface().reshape(-1, 3)]
    head = pcd_head("x y z _", "4 4 4 1", "F F F U", "ascii", "1 1 1 4")
    return head + "\n".join(lines).encode() + b"\n"


def packed_colors() -> FloatArray:
    """The colours as bits 0x00RRGGBB of single precision numbers (42,)."""
    red, green, blue = colors().astype(np.uint32).T
    return (red << 16 | green << 8 | blue).view(np.float32)


def pcd_binary() -> bytes:
    """With padding between the fields and packed colours."""
    table = np.zeros(ROWS * COLUMNS, "<f4, <f4, <f4, <u4, <f4, <u2")
    for k, column in enumerate(surface().reshape(-1, 3).T):
        table[f"f{k}"] = column
    table["f4"] = packed_colors()
    head = pcd_head("x y z _ rgb label", "4 4 4 1 4 2", "F F F U F U", "binary", "1 1 1 4 1 1")
    return head + table.tobytes()


def pcd_compressed() -> bytes:
    """Field after field, in LZF."""
    fields = [*surface().reshape(-1, 3).T.astype("<f4"), packed_colors()]
    whole = b"".join(field.tobytes() for field in fields)
    packed = lzf_compress(whole)
    head = pcd_head("x y z rgb", "4 4 4 4", "F F F F", "binary_compressed")
    return head + struct.pack("<II", len(packed), len(whole)) + packed


def lzf_compress(data: bytes) -> bytes:
    """LZF that copies what lies four bytes before, as in columns of like numbers, and no more."""
    out, at, literal = bytearray(), 0, bytearray()

    def flush() -> None:
        for begin in range(0, len(literal), 32):
            run = literal[begin : begin + 32]
            out.extend([len(run) - 1, *run])
        literal.clear()

    while at < len(data):
        length = 0
        while at >= 4 and at + length < len(data) and data[at + length] == data[at + length - 4]:
            length += 1
        length = min(length, 264)
        if length < 3:
            literal.append(data[at])
            at += 1
            continue
        flush()
        out.extend([(length - 2) << 5, 3] if length < 9 else [7 << 5, length - 9, 3])
        at += length
    flush()
    return bytes(out)


def ptx() -> bytes:
    """Two scans, the second with colours."""
    cells = np.nan_to_num(surface()).transpose(1, 0, 2).reshape(-1, 3)
    shades = colors().reshape(ROWS, COLUMNS, 3).transpose(1, 0, 2).reshape(-1, 3)
    text = ""
    for matrix in (np.eye(4), GROUND):
        text += f"{COLUMNS}\n{ROWS}\n"
        for row in (matrix[:3, 3], *matrix[:3, :3].T, *matrix.T):
            text += " ".join(f"{number:g}" for number in row) + "\n"
        for point, shade in zip(cells, shades, strict=True):
            color = " {} {} {}".format(*shade) if matrix is GROUND else ""
            text += "{:g} {:g} {:.9g} 0.5".format(*point) + color + "\n"
    return text.encode()


def ply_organised() -> bytes:
    """With capitals and NaN, as PCL writes grids."""
    head = f"ply\nformat binary_little_endian 1.0\nobj_info num_cols {COLUMNS}\n"
    head += f"obj_info num_rows {ROWS}\nelement vertex {ROWS * COLUMNS}\n"
    head += "".join(f"property float {axis}\n" for axis in "XYZ") + "end_header\n"
    return head.encode() + surface().astype("<f4").tobytes()


def npy(array: NDArray) -> bytes:
    """An array as NumPy saves it."""
    stream = BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def stl() -> bytes:
    """Two triangles, binary."""
    facets = np.zeros(2, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("-", "<u2")]))
    facets["corners"] = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1], [0, 1, 0]]]
    return bytes(80) + struct.pack("<I", 2) + facets.tobytes()


def ply_big_endian() -> bytes:
    """A mesh of doubles with colours and lists of faces."""
    points, shades = np.nan_to_num(surface()).reshape(-1, 3), colors()
    head = f"ply\nformat binary_big_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    table = np.zeros(len(points), np.dtype([("p", ">f8", 3), ("c", "u1", 3)]))
    table["p"], table["c"] = points, shades
    return head.encode() + table.tobytes() + struct.pack(">B3iB4i", 3, 0, 1, 8, 4, 1, 2, 9, 8)


def depth_image(kind: str, *, is_float: bool = False) -> bytes:
    """A depth image, in whole millimetres or in metres, as Pillow saves it."""
    image = import_module("PIL.Image")
    depth = np.nan_to_num(surface()[..., 2])
    values = depth.astype(np.float32) if is_float else np.rint(1000 * depth).astype(np.uint16)
    stream = BytesIO()
    image.fromarray(values).save(stream, kind)
    return stream.getvalue()


def npz(**arrays: NDArray) -> bytes:
    """Arrays by their names as NumPy saves them."""
    stream = BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]  # no flag among them
    return stream.getvalue()


def vtk(*, is_binary: bool) -> bytes:
    """A structured grid with cell data before the colours of the points."""
    points = np.nan_to_num(surface()).reshape(-1, 3)
    kind = "BINARY" if is_binary else "ASCII"
    body = f"# vtk DataFile Version 4.2\na scan\n{kind}\nDATASET STRUCTURED_GRID\n".encode()
    body += f"DIMENSIONS {COLUMNS} {ROWS} 1\nPOINTS {len(points)} float\n".encode()
    body += _vtk_values(points, ">f4", is_binary)
    body += b"METADATA\nINFORMATION 0\n\nCELL_DATA 2\nSCALARS id int 1\nLOOKUP_TABLE default\n"
    body += _vtk_values(np.array([7, 9]), ">i4", is_binary)
    body += f"POINT_DATA {len(points)}\nCOLOR_SCALARS rgb 3\n".encode()
    return body + _vtk_values(colors() / (1 if is_binary else 255), ">u1", is_binary)


def _vtk_values(values: NDArray, kind: str, is_binary: bool) -> bytes:
    if is_binary:
        return values.astype(kind).tobytes() + b"\n"
    return " ".join(f"{value:.9g}" for value in values.ravel()).encode() + b"\n"


def glb() -> bytes:
    """Two triangles and two points under nodes that turn, scale and shift."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
    corners = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
    body = points.tobytes() + corners.tobytes()
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [1]}],
        "nodes": [
            {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.5**0.5, 0.5**0.5]},
            {"children": [0, 2], "translation": [4e6, 5e5, 0.25]},
            {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 7, 1]},
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]},
            {"primitives": [{"attributes": {"POSITION": 2}, "mode": 0}]},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
            {"buffer": 0, "byteOffset": 12, "byteLength": 36, "byteStride": 24},
        ],
        "buffers": [{"byteLength": len(body)}],
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def e57() -> bytes:
    """Two scans, the second with a pose."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS].reshape(2, -1)
    points, seen = surface().reshape(-1, 3), np.isfinite(surface()).all(axis=2).ravel()
    table = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points[seen].T, strict=True))
    table |= {"rowIndex": rows[seen], "columnIndex": columns[seen]}
    table |= zip(("colorRed", "colorGreen", "colorBlue"), colors()[seen].T, strict=True)
    half = np.array([0.5**0.5, 0, 0, 0.5**0.5])
    turned = {"rotation": half, "translation": GROUND[:3, 3]}
    return e57_of(left=(table, {}), right=(table, turned))


def e57_of(**scans: tuple[Columns, Columns]) -> bytes:
    """Scans by their names, each with its columns and its pose, as pye57 writes them."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.e57"
        file = import_module("pye57").E57(str(path), mode="w")
        for name, (table, pose) in scans.items():
            file.write_scan_raw(table, name=name, **pose)
        file.close()
        return path.read_bytes()


def las(*, is_packed: bool) -> bytes:
    """At map coordinates in hundredths, with colours."""
    origin = np.array([4e6, 5e5, 0])
    points = np.nan_to_num(np.round(surface(), 2)).reshape(-1, 3) + origin
    channels = (colors().astype(np.uint16) * 257).T
    shades = dict(zip(("red", "green", "blue"), channels, strict=True))
    return las_of(points, 0.01, origin, is_packed=is_packed, **shades)


def las_of(
    points: FloatArray, scale: float, origin: FloatArray, *, is_packed: bool, **shades: NDArray
) -> bytes:
    """Points (N, 3) in steps of a scale as laspy writes them."""
    laspy = import_module("laspy")
    header = laspy.LasHeader(point_format=2 if shades else 0, version="1.2")
    header.offsets, header.scales = origin, np.full(3, scale)
    found, stream = laspy.LasData(header), BytesIO()
    found.xyz = points
    for name, channel in shades.items():
        setattr(found, name, channel)
    found.write(stream, do_compress=is_packed)
    return stream.getvalue()


SAMPLES: dict[str, Callable[[], bytes]] = {
    "ascii.pcd": pcd_ascii,
    "binary.pcd": pcd_binary,
    "compressed.pcd": pcd_compressed,
    "two.ptx": ptx,
    "organised.ply": ply_organised,
    "big_endian.ply": ply_big_endian,
    "binary.stl": stl,
    "packed.pcd.gz": lambda: gzip.compress(pcd_binary(), mtime=0),
    "grid.npy": lambda: npy(surface()),
    "grid.npz": lambda: npz(points=surface(), colors=colors().reshape(ROWS, COLUMNS, 3)),
    "ascii.vtk": lambda: vtk(is_binary=False),
    "binary.vtk": lambda: vtk(is_binary=True),
    "nodes.glb": glb,
    "utf16.txt": lambda: SCANS["plain.xyz"].encode("utf-16"),
    "packed.xyz.gz": lambda: gzip.compress(SCANS["plain.xyz"].encode(), mtime=0),
}
"""Makers of the files by their names,"""
DEPTH_IMAGES: dict[str, Callable[[], bytes]] = {
    "a.png": lambda: depth_image("PNG"),
    "a.tif": lambda: depth_image("TIFF"),
    "float.tif": lambda: depth_image("TIFF", is_float=True),
    "a.npy": lambda: npy(np.nan_to_num(surface()[..., 2])),
    "a.npz": lambda: npz(depth=np.rint(1000 * np.nan_to_num(surface()[..., 2]))),
}
"""those of depth images,"""
WITH_LIBRARIES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "two.e57": ("pye57", e57),
    "points.las": ("laspy", lambda: las(is_packed=False)),
    "points.laz": ("lazrs", lambda: las(is_packed=True)),
}
"""and of those that a library writes: its name, and the maker."""
