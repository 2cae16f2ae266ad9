"""Arrays of NumPy: (N, 3) points, or (H, W, 3), a grid, or with named fields; NPZ of these."""

import ast
import re
import zipfile
import zlib
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.io.raw import RawScan, full_grid, noted_bytes, side_by_side
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.text_columns import columns_by_name, scan_of_columns
from scanweld.io.text_head import column_names
from scanweld.io.unpack import read_bounded

_MAGIC = b"\x93NUMPY"
_TYPE = re.compile(r"[<>|=]?[fiu][1248]")
_LONGEST_HEADER = 10_000
_KEYS = {
    "points": ("points", "xyz", "positions", "vertices"),
    "normals": ("normals",),
    "colors": ("colors", "colours", "rgb"),
}


def read_numpy(path: Path, data: bytes) -> RawScan:
    """The points of a NPY or NPZ file.

    Raises:
        ReadError: If it is broken, holds objects, or its arrays have other shapes.
    """
    arrays = read_arrays(path, data)
    found = {
        key: arrays[name]
        for key, names in _KEYS.items()
        for name in reversed(names)
        if name in arrays
    }
    if "points" not in found and len(arrays) == 1:
        found = {"points": next(iter(arrays.values()))}
    if "points" not in found:
        raise ReadError(
            f"{path}: holds {', '.join(sorted(arrays)) or 'nothing'}, but no points; save them "
            "under that name"
        )
    used = [next((n for n in names if n in arrays), "") for names in _KEYS.values()]
    left_out = sorted(set(arrays).difference(used))
    told = (f"arrays left out: {', '.join(left_out)}",) if left_out and len(arrays) > 1 else ()
    return _raw_scan(path, found, told)


def read_arrays(path: Path, data: bytes) -> dict[str, NDArray]:
    """The arrays of a NPZ file by their names, or that of a NPY file under no name.

    Raises:
        ReadError: If it is broken, or holds objects.
    """
    return _unzipped(path, data) if data.startswith(b"PK") else {"": _array(path, data)}


def _raw_scan(path: Path, found: dict[str, NDArray], notes: tuple[str, ...]) -> RawScan:
    shape = found["points"].shape
    if found["points"].dtype.names is not None:
        return _of_fields(path, found["points"])
    if len(shape) not in (2, 3) or shape[-1] != 3:
        raise ReadError(
            f"{path}: its points have the shape {shape}; give (N, 3), or (rows, columns, 3)"
        )
    for key, array in found.items():
        if array.shape[:-1] != shape[:-1] or array.shape[-1] not in ((3, 4), (3,))[key != "colors"]:
            raise ReadError(
                f"{path}: its {key} have the shape {array.shape}, its points {shape}; make them fit"
            )
    normals = found.get("normals")
    colors, no_colors = _colors(found.get("colors"))
    return RawScan(
        points=_rows(found["points"]),
        grid=full_grid(*shape[:2]) if len(shape) == 3 else None,
        normals=None if normals is None else _rows(normals),
        colors=colors,
        notes=(*notes, *no_colors),
    )


def _of_fields(path: Path, array: NDArray) -> RawScan:
    """The points of an array (N,) or (rows, columns) of records, by the names of its fields."""
    names = tuple(array.dtype.names or ())
    known = column_names(" ".join(names))
    if len(known) != len(names) or array.ndim not in (1, 2) or not array.size:
        raise ReadError(
            f"{path}: holds records {array.shape} of {', '.join(names)[:80]}; save x, y and z of "
            "the points"
        )
    table = side_by_side([array[name].ravel() for name in names])
    raw = scan_of_columns(table, columns_by_name(path, known))
    is_grid = array.ndim == 2 and min(array.shape) > 1
    return replace(raw, grid=full_grid(*array.shape) if is_grid else None)


def _rows(array: NDArray) -> FloatArray:
    return np.ascontiguousarray(array.reshape(-1, array.shape[-1]), dtype=np.float64)


def _colors(array: NDArray | None) -> tuple[ByteArray | None, tuple[str, ...]]:
    if array is None:
        return None, ()
    rows = array.reshape(-1, array.shape[-1])[:, :3]
    return noted_bytes("colours", rows, array.dtype.str[1:])


def _unzipped(path: Path, data: bytes) -> dict[str, NDArray]:
    arrays = {}
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            for member in archive.namelist():
                with archive.open(member) as stream:
                    content = read_bounded(path, stream, len(data))
                arrays[member.removesuffix(".npy")] = _array(path, content)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError) as error:
        raise ReadError(f"{path}: cannot be unpacked ({error}); copy it again") from error
    except (ValueError, EOFError, OSError, KeyError) as error:  # what else broken archives raise
        raise ReadError(f"{path}: cannot be unpacked ({error}); copy it again") from error
    return arrays


def _array(path: Path, data: bytes) -> NDArray:
    """The array of a NPY file. Not by ``numpy.load``: it believes what the header says."""
    broken = ReadError(f"{path}: not an array of NumPy, or a truncated one; save it again")
    start = 10 if data[6:7] == b"\1" else 12
    size = int.from_bytes(data[8:start], "little")
    if not data.startswith(_MAGIC) or size > _LONGEST_HEADER:
        raise broken
    try:
        told = ast.literal_eval(data[start : start + size].decode("latin-1"))
        kind, shape, is_fortran = told["descr"], told["shape"], told["fortran_order"]
    except (ValueError, SyntaxError, RecursionError, MemoryError, TypeError, KeyError) as error:
        raise broken from error
    types = [kind] if isinstance(kind, str) else [code for _, code in _fields(kind)]
    if not types or not all(map(_TYPE.fullmatch, types)):
        raise ReadError(f"{path}: holds {kind!r}, not numbers; save the points as numbers")
    if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
        raise broken
    try:
        kind = np.dtype(kind)
    except (TypeError, ValueError) as error:
        raise broken from error
    count = 1
    for n in shape:
        count *= n
    if count * kind.itemsize != len(data) - start - size or len(shape) > 4:
        raise broken
    return np.frombuffer(data, kind, count, start + size).reshape(
        shape, order="F" if is_fortran else "C"
    )


def _fields(kind: object) -> list[tuple[str, str]]:
    """Names and types of the fields of records, none if it is something else."""
    fields = kind if isinstance(kind, list) else []
    are_plain = all(
        isinstance(field, tuple) and [type(part) for part in field] == [str, str]
        for field in fields
    )
    return fields if are_plain else []


FORMAT = ScanFormat(
    suffixes=(".npy", ".npz"),
    read=read_numpy,
    keeps=(Keeps.GRID, Keeps.NORMALS, Keeps.COLORS),
    only_named=(".npy", ".npz"),
    begins=(_MAGIC, b"PK"),
)
