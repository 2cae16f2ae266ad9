"""STL, ASCII or binary: faces, whose coinciding corners become one vertex."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.io.mesh_lines import broken_line, filled_lines
from scanweld.io.raw import RawScan
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.text import is_number

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
_STL_HEAD = 84


def read_stl(path: Path, data: bytes) -> RawScan:
    """Faces of an STL file, ASCII or binary, with coinciding corners merged into vertices.

    Faces that collapse by this are left out.

    Raises:
        ReadError: If it is neither kind of STL, or truncated.
    """
    num_facets = int.from_bytes(data[80:_STL_HEAD], "little")
    if len(data) == _STL_HEAD + _STL_FACET.itemsize * num_facets:
        facets = np.frombuffer(data, _STL_FACET, num_facets, _STL_HEAD)
        corners = facets["corners"].reshape(-1, 3).astype(np.float64)
    elif data.lstrip()[:5].lower() == b"solid" and b"endsolid" in data:
        corners = _ascii_corners(path, data)
    else:
        raise ReadError(f"{path}: not an STL file, or a truncated one; copy it again")
    if len(corners) % 3:
        raise ReadError(f"{path}: {len(corners)} corners do not make triangles; export it anew")
    points, index = _merged(corners)
    faces = index.reshape(-1, 3)
    a, b, c = faces.T
    return RawScan(points=points, faces=faces[(a != b) & (b != c) & (c != a)])


def _ascii_corners(path: Path, data: bytes) -> FloatArray:
    """The corners (3 F, 3) in the order of an ASCII STL."""
    corners: list[list[float]] = []
    for number, words in filled_lines(data):
        if words[0].lower() == b"vertex":
            if len(words) != 4 or not all(map(is_number, words[1:])):
                raise broken_line(path, number, words)
            corners.append([float(word) for word in words[1:]])
    return np.array(corners, dtype=np.float64).reshape(-1, 3)


def _merged(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Different points in the order of their first appearance, and each corner's index."""
    table = np.full(1 << (2 * len(corners) + 1).bit_length(), -1, dtype=np.int64)
    words = (corners + 0.0).view(np.uint64)
    first, index = _first_alike(corners, words, table)
    return corners[first], index


@njit(cache=True, nogil=True)
def _first_alike(
    points: FloatArray, words: NDArray[np.uint64], table: IntArray
) -> tuple[IntArray, IntArray]:  # pragma: no cover - compiled
    """Where each different point (D,) appears first, and which of them each point (N,) is.

    Args:
        points: (N, 3); NaN is like nothing.
        words: (N, 3) their bits, the same for like ones.
        table: (2^k,) with more than N entries, all -1.
    """
    first, index = np.empty(len(points), dtype=np.int64), np.empty(len(points), dtype=np.int64)
    count = 0
    for i in range(len(points)):
        x, y, z = points[i]
        place, found = 0, -1
        if x == x and y == y and z == z:
            bits = words[i, 0] * np.uint64(0x9E3779B97F4A7C15) ^ words[i, 1]
            bits = (bits ^ (bits >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9) ^ words[i, 2]
            bits = (bits ^ (bits >> np.uint64(32))) * np.uint64(0x94D049BB133111EB)
            place = np.int64((bits ^ (bits >> np.uint64(31))) & np.uint64(len(table) - 1))
            while table[place] >= 0:
                k = first[table[place]]
                if points[k, 0] == x and points[k, 1] == y and points[k, 2] == z:
                    found = table[place]
                    break
                place = (place + 1) & (len(table) - 1)
            if found < 0:
                table[place] = count
        if found < 0:
            found = count
            first[count] = i
            count += 1
        index[i] = found
    return first[:count], index


FORMAT = ScanFormat(suffixes=(".stl",), read=read_stl, keeps=(Keeps.FACES,), begins=(b"solid ",))
