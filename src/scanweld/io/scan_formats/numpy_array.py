"""Arrays of NumPy: (N, 3) points, or (H, W, 3), a grid; NPZ with points, normals and colors."""

import ast
import re
import zipfile
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.io.raw import RawScan, full_grid, to_bytes
from scanweld.io.scan_formats.records import Keeps, ScanFormat
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
    if not data.startswith(b"PK"):
        return _raw_scan(path, {"points": _array(path, data)}, ())
    arrays = _unzipped(path, data)
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
    left_out = sorted(set(arrays) - {name for names in _KEYS.values() for name in names})
    told = (f"arrays left out: {', '.join(left_out)}",) if left_out and len(arrays) > 1 else ()
    return _raw_scan(path, found, told)


def _raw_scan(path: Path, found: dict[str, NDArray], notes: tuple[str, ...]) -> RawScan:
    shape = found["points"].shape
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
    return RawScan(
        points=_rows(found["points"]),
        grid=full_grid(*shape[:2]) if len(shape) == 3 else None,
        normals=None if normals is None else _rows(normals),
        colors=_colors(found.get("colors")),
        notes=notes,
    )


def _rows(array: NDArray) -> FloatArray:
    return np.ascontiguousarray(array.reshape(-1, array.shape[-1]), dtype=np.float64)


def _colors(array: NDArray | None) -> ByteArray | None:
    if array is None:
        return None
    return to_bytes(array.reshape(-1, array.shape[-1])[:, :3], array.dtype.str[1:])


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
    if not isinstance(kind, str) or not _TYPE.fullmatch(kind):
        raise ReadError(f"{path}: holds {kind!r}, not numbers; save the points as numbers")
    if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
        raise broken
    try:
        kind = np.dtype(kind)
    except TypeError as error:
        raise broken from error
    count = 1
    for n in shape:
        count *= n
    if count * kind.itemsize != len(data) - start - size or len(shape) > 4:
        raise broken
    return np.frombuffer(data, kind, count, start + size).reshape(
        shape, order="F" if is_fortran else "C"
    )


FORMAT = ScanFormat(
    suffixes=(".npy", ".npz"),
    read=read_numpy,
    keeps=(Keeps.GRID, Keeps.NORMALS, Keeps.COLORS),
    only_named=(".npy", ".npz"),
)
