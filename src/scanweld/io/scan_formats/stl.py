"""STL, ASCII or binary: faces, whose coinciding corners become one vertex."""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.errors import ReadError
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.io.mesh_lines import broken_line, filled_lines
from scanweld.io.raw import RawScan
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.text import is_number

_ENDS = (b"endsolid", b"ENDSOLID")
_ZERO = np.float32(0)
"""Added to minus zero it gives zero, whose bits are others."""
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
"""Of a binary file, behind"""
HEAD = struct.Struct("<80sI")
"""any words, and the number of facets."""


def read_stl(path: Path, data: bytes) -> RawScan:
    """Faces of an STL file, ASCII or binary, with coinciding corners merged into vertices.

    Faces that collapse by this are left out.

    Raises:
        ReadError: If it is neither kind of STL, or truncated.
    """
    num_facets = HEAD.unpack_from(data)[1] if len(data) >= HEAD.size else 0
    size = HEAD.size + FACET.itemsize * num_facets
    if len(data) == size:
        facets = np.frombuffer(data, FACET, num_facets, HEAD.size)
        corners = (facets["corners"] + _ZERO).reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid" and any(word in data for word in _ENDS):
        corners = _ascii_corners(path, data) + _ZERO
    elif num_facets and 0 < len(data) - size < HEAD.size:
        raise ReadError(f"{path}: goes on behind its {num_facets} triangles; export it anew")
    else:
        raise ReadError(f"{path}: not an STL file, or a truncated one; copy it again")
    if len(corners) % 3:
        raise ReadError(f"{path}: {len(corners)} corners do not make triangles; export it anew")
    points, index = _merged(corners + 0.0)  # minus zero becomes zero, whose bits are others
    faces = index.reshape(-1, 3)
    a, b, c = faces.T
    is_whole = (a != b) & (b != c) & (c != a)
    return RawScan(points=points, faces=faces if is_whole.all() else faces[is_whole])


def _ascii_corners(path: Path, data: bytes) -> FloatArray:
    """The corners (3 F, 3) in the order of an ASCII STL."""
    corners: list[list[float]] = []
    for number, words in filled_lines(data):
        if words[0].lower() == b"vertex":
            if len(words) != 4 or not all(map(is_number, words[1:])):
                raise broken_line(path, number, words)
            corners.append([float(word) for word in words[1:]])
    return np.array(corners, dtype=np.float64).reshape(-1, 3)


def _merged(corners: NDArray[np.floating]) -> tuple[FloatArray, IntArray]:
    """Different points in the order of their first appearance, and each corner's index.

    Args:
        corners: (N, 3) in single or double precision, without minus zero.
    """
    table = np.full(1 << (4 * len(corners) // 3 + 1).bit_length(), -1, dtype=np.int32)
    words = corners.view(np.uint32)
    is_nan = np.asarray(np.isnan(corners[:, 0] + corners[:, 1] + corners[:, 2]))
    first, index = _first_alike(words, is_nan, table)
    return corners[first].astype(np.float64), index


@njit(cache=True, nogil=True)
def _first_alike(
    words: NDArray[np.uint32], is_nan: BoolArray, table: NDArray[np.int32]
) -> tuple[IntArray, IntArray]:  # pragma: no cover - compiled
    """Where each different point (D,) appears first, and which of them each point (N,) is.

    Args:
        words: (N, k) bits of the points, the same for like ones.
        is_nan: (N,) which points are like nothing.
        table: (2^k,) with more than N entries, all -1.
    """
    first, index = np.empty(len(words), dtype=np.int64), np.empty(len(words), dtype=np.int64)
    count, last = 0, np.int64(len(table) - 1)
    for i in range(len(words)):
        found = -1
        if not is_nan[i]:
            bits = np.uint64(0)
            for axis in range(words.shape[1]):
                bits = (bits ^ np.uint64(words[i, axis])) * np.uint64(0x9E3779B97F4A7C15)
                bits ^= bits >> np.uint64(29)
            place = np.int64(bits >> np.uint64(32)) & last
            while table[place] >= 0:
                k = table[place]
                axis = 0
                while axis < words.shape[1] and words[k, axis] == words[i, axis]:
                    axis += 1
                if axis == words.shape[1]:
                    found = index[k]
                    break
                place = (place + 1) & last
            if found < 0:
                table[place] = i
        if found < 0:
            found = count
            first[count] = i
            count += 1
        index[i] = found
    return first[:count].copy(), index


FORMAT = ScanFormat(suffixes=(".stl",), read=read_stl, keeps=(Keeps.FACES,), begins=(b"solid ",))
