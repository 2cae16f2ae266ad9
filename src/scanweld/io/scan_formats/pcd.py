"""PCD of the Point Cloud Library: ascii, binary or binary_compressed.

Specification: "The PCD (Point Cloud Data) file format" of PCL's documentation. NaN is nothing.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.pose import Pose
from scanweld.io.lzf import lzf_decompress
from scanweld.io.pcd_header import PcdField, PcdHeader, parse_pcd_header
from scanweld.io.raw import RawScan, full_grid, noted_bytes, side_by_side
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.text import parse_numbers
from scanweld.io.viewed_from import viewpoint_told

_NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))
_COLORS = (("r", "g", "b"), ("red", "green", "blue"))
_PACKED = ("rgb", "rgba")
_PADDING = "_"
Columns = dict[str, NDArray]


def read_pcd(path: Path, data: bytes) -> RawScan:
    """A PCD file's points, with its rows and columns as the grid.

    Where it has a grid its viewpoint is left to be found from that; else a viewpoint that is told
    is believed if the points lie before it.

    Raises:
        ReadError: If the file is broken or its points lack x, y or z.
    """
    header = parse_pcd_header(path, data)
    columns = _columns(path, header, data)
    points = _three(columns, ("x", "y", "z"))
    if points is None:
        raise ReadError(f"{path}: its points lack x, y or z; export the scan with its points")
    colors, used, no_colors = _colors(columns)
    shades = columns.get("intensity")
    kind = "" if shades is None else shades.dtype.str[1:]
    intensity, no_shades = noted_bytes("intensities", shades, kind)
    grid = full_grid(header.height, header.width) if header.height > 1 else None
    pose, notes = (None, ()) if grid is not None else _viewpoint(header, points)
    known = {"x", "y", "z", "intensity", _PADDING, *used, *(n for names in _NORMALS for n in names)}
    left_out = [field.name for field in header.fields if field.name not in known]
    normals = next(
        filter(lambda found: found is not None, (_three(columns, n) for n in _NORMALS)), None
    )
    return RawScan(
        points=points,
        grid=grid,
        normals=normals,
        colors=colors,
        intensity=intensity,
        scan_from_sensor=pose,
        notes=(
            *((f"fields left out: {', '.join(left_out)}",) if left_out else ()),
            *no_colors,
            *no_shades,
            *notes,
        ),
    )


def _columns(path: Path, header: PcdHeader, data: bytes) -> Columns:
    """The fields' values (N,), those of several values a point and padding left out."""
    body = memoryview(data)[header.body_start :]
    if header.encoding == "ascii":
        first_line = 1 + data.count(b"\n", 0, header.body_start)
        return _ascii_columns(header, parse_numbers(path, bytes(body), first_line), path)
    if header.encoding == "binary_compressed":
        return _compressed_columns(path, header, body)
    size = sum(field.size for field in header.fields)
    if header.num_points * size > len(body):
        raise _wrong_size(path, header)
    if bytes(body[header.num_points * size :]).strip(b"\0\r\n\t "):
        raise _wrong_size(path, header, "longer")
    kept, offsets = _kept(header.fields)
    row = np.dtype(
        {
            "names": [field.name for field in kept],
            "formats": ["<" + field.type for field in kept],
            "offsets": offsets,
            "itemsize": size,
        }
    )
    rows = np.frombuffer(body, row, header.num_points)
    return {field.name: rows[field.name] for field in kept}


def _ascii_columns(header: PcdHeader, numbers: FloatArray, path: Path) -> Columns:
    width = sum(field.count for field in header.fields)
    if len(numbers) != header.num_points * width:
        is_short = len(numbers) < header.num_points * width
        raise _wrong_size(path, header, "shorter" if is_short else "longer")
    table = numbers.reshape(-1, width)
    first = np.cumsum([0, *(field.count for field in header.fields)])
    return {
        field.name: _as_stored(field, table[:, k])
        for field, k in zip(header.fields, first[:-1], strict=True)
        if field.count == 1 and field.name != _PADDING
    }


def _as_stored(field: PcdField, values: FloatArray) -> NDArray:
    """Numbers of a text in the type that their field has in binary files, if that matters.

    Packed colours of type F are the bits of a float: written as such they are tiny or negative,
    written as the whole number that the bits are they are large.
    """
    if field.name not in _PACKED:
        return values
    known = np.nan_to_num(values, posinf=0.0, neginf=0.0)
    if field.type[0] == "f" and (known != np.rint(known)).any():
        with np.errstate(over="ignore"):
            return known.astype("<f4")
    return (np.clip(known, -(2**31), 2**32 - 1).astype(np.int64) & 0xFFFFFFFF).astype("<u4")


def _compressed_columns(path: Path, header: PcdHeader, body: memoryview) -> Columns:
    """Field after field; padding has no place there."""
    kept = [field for field in header.fields if field.name != _PADDING]
    size = header.num_points * sum(field.size for field in kept)
    if len(body) < 8:
        raise _wrong_size(path, header)
    packed, whole = (int(n) for n in np.frombuffer(body, "<u4", 2))
    if packed > len(body) - 8 or whole != size:
        raise _wrong_size(path, header)
    values = lzf_decompress(np.frombuffer(body, np.uint8, packed, 8), size)
    if values is None:
        raise ReadError(f"{path}: its compressed points are broken; copy it again")
    columns: Columns = {}
    begin = 0
    for field in kept:
        end = begin + header.num_points * field.size
        if field.count == 1:
            columns[field.name] = values[begin:end].view("<" + field.type)
        begin = end
    return columns


def _kept(fields: tuple[PcdField, ...]) -> tuple[list[PcdField], list[int]]:
    """Fields of one value a point, each name once, and their offsets in bytes."""
    kept: dict[str, tuple[PcdField, int]] = {}
    offset = 0
    for field in fields:
        if field.count == 1 and field.name != _PADDING:
            kept[field.name] = (field, offset)
        offset += field.size
    return [field for field, _ in kept.values()], [at for _, at in kept.values()]


def _wrong_size(path: Path, header: PcdHeader, how: str = "shorter") -> ReadError:
    return ReadError(
        f"{path}: its body is {how} than {header.num_points} points of its fields (truncated, or "
        "a wrong count); copy it again or export it anew"
    )


def _three(columns: Columns, names: tuple[str, ...]) -> FloatArray | None:
    found = [columns[name] for name in names if name in columns]
    return side_by_side(found) if len(found) == len(names) else None


def _colors(columns: Columns) -> tuple[ByteArray | None, tuple[str, ...], tuple[str, ...]]:
    """Red, green, blue (N, 3), the fields that they come from, and a note on them."""
    for name in _PACKED:
        if name in columns and columns[name].itemsize == 4:
            bits = np.ascontiguousarray(columns[name]).view("<u4")
            parts = [(bits >> shift & 255).astype(np.uint8) for shift in (16, 8, 0)]
            return np.stack(parts, axis=1), (name,), ()
    for names in _COLORS:
        values = _three(columns, names)
        if values is not None:
            colors, notes = noted_bytes("colours", values, columns[names[0]].dtype.str[1:])
            return colors, names, notes
    return None, (), ()


def _viewpoint(header: PcdHeader, points: FloatArray) -> tuple[Pose | None, tuple[str, ...]]:
    """Where the sensor stood in the points' frame, and notes on it.

    Only the place is believed: programs differ in which way the sensor looks.
    """
    if not header.viewpoint:
        return None, ()
    place, turn = np.array(header.viewpoint[:3]), header.viewpoint[3:]
    return viewpoint_told(points, place, turn == (1.0, 0.0, 0.0, 0.0), "VIEWPOINT")


FORMAT = ScanFormat(
    suffixes=(".pcd",),
    read=read_pcd,
    begins=(b"# .PCD",),
    keeps=(Keeps.GRID, Keeps.SENSOR, Keeps.NORMALS, Keeps.COLORS),
)
