"""OBJ, OFF and STL: meshes that stand for scans, or for objects to scan.

Vertices keep the order of the file, which general mesh libraries do not promise.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.io.raw import RawScan, fan_triangles, to_bytes
from scanweld.io.text import is_number

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
_STL_HEAD = 84
_OFF_MAGIC = re.compile(rb"(C?)(N?)OFF\b", re.IGNORECASE)


def read_obj(path: Path, data: bytes) -> RawScan:
    """Vertices, their colours (if written behind the coordinates) and faces of an OBJ file.

    Raises:
        ReadError: If a line is broken or there are no vertices.
    """
    vertices: list[list[float]] = []
    counts: list[int] = []
    corners: list[int] = []
    for number, words in _lines(data.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ")):
        try:
            if words[0] == b"v":
                vertices.append([float(word) for word in words[1:]])
            elif words[0] == b"f":
                corners += (_obj_index(word, len(vertices)) for word in words[1:])
                counts.append(len(words) - 1)
        except ValueError as error:
            raise _broken(path, number, words) from error
    sizes = sorted({len(vertex) for vertex in vertices})
    if not sizes:
        raise ReadError(f"{path}: holds no vertices; export the scan as a mesh or as points")
    if len(sizes) > 1 or sizes[0] not in (3, 4, 6, 7):
        raise ReadError(f"{path}: its vertices have {sizes} numbers, not all 3; export it anew")
    table = np.array(vertices)
    colors = to_bytes(table[:, -3:], "f8") if sizes[0] >= 6 else None
    return RawScan(points=table[:, :3], faces=_faces(counts, corners), colors=colors)


def read_off(path: Path, data: bytes) -> RawScan:
    """Vertices, normals (NOFF), colours (COFF) and faces of an OFF file.

    Raises:
        ReadError: If it is no such file, a line is broken or the counts are wrong.
    """
    lines = _lines(data)
    _, magic = next(lines, (0, [b""]))
    kind = _OFF_MAGIC.fullmatch(magic[0])
    if kind is None:
        raise ReadError(f"{path}: not an OFF file (it does not begin with 'OFF'); leave it out")
    number, words = (0, magic[1:]) if len(magic) > 1 else next(lines, (0, []))
    if len(words) < 2 or not all(word.isdigit() for word in words):
        raise _broken(path, number, words)
    rows = list(lines)
    num_vertices, num_faces = int(words[0]), int(words[1])
    if len(rows) != num_vertices + num_faces:
        raise ReadError(
            f"{path}: has {len(rows)} lines for {num_vertices} vertices and {num_faces} faces "
            "(truncated, or a wrong count); copy it again or export it anew"
        )
    table = _off_vertices(path, rows[:num_vertices])
    after = 6 if kind[2] else 3
    colored = bool(kind[1]) and table.shape[1] >= after + 3
    colors = table[:, after : after + 3]
    return RawScan(
        points=table[:, :3],
        faces=_off_faces(path, rows[num_vertices:]),
        normals=table[:, 3:6] if kind[2] and table.shape[1] >= 6 else None,
        colors=to_bytes(colors) if colored else None,
    )


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
    for number, words in _lines(data):
        if words[0].lower() == b"vertex":
            if len(words) != 4 or not all(map(is_number, words[1:])):
                raise _broken(path, number, words)
            corners.append([float(word) for word in words[1:]])
    return np.array(corners, dtype=np.float64).reshape(-1, 3)


def _lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Numbers and words of the lines that hold more than a comment."""
    for number, line in enumerate(data.splitlines(), start=1):
        words = line.partition(b"#")[0].split()
        if words:
            yield number, words


def _broken(path: Path, number: int, words: list[bytes]) -> ReadError:
    shown = b" ".join(words)[:40].decode("ascii", errors="replace")
    return ReadError(f"{path}: line {number}: {shown!r} is broken; correct it or export it anew")


def _faces(counts: list[int], corners: list[int]) -> IntArray | None:
    if not counts:
        return None
    return fan_triangles(np.array(counts, dtype=np.int64), np.array(corners, dtype=np.int64))


def _obj_index(word: bytes, num_vertices: int) -> int:
    """The vertex of a corner such as 7, 7/1, 7//3 or -1 (the last one so far), from 0."""
    index = int(word.partition(b"/")[0])
    if index == 0 or index < -num_vertices:
        raise ValueError("OBJ counts from 1, or back from -1")
    return index - 1 if index > 0 else num_vertices + index


def _off_vertices(path: Path, rows: list[tuple[int, list[bytes]]]) -> FloatArray:
    """The vertex lines (V, k) with k >= 3."""
    if not rows:
        return np.zeros((0, 3))
    width = len(rows[0][1])
    for number, words in rows:
        if len(words) != width or width < 3:
            raise _broken(path, number, words)
    try:
        return np.array([[float(word) for word in words] for _, words in rows])
    except ValueError:
        number, words = next(row for row in rows if not all(map(is_number, row[1])))
        raise _broken(path, number, words) from None


def _off_faces(path: Path, rows: list[tuple[int, list[bytes]]]) -> IntArray | None:
    counts: list[int] = []
    corners: list[int] = []
    for number, words in rows:
        size = int(words[0]) if words[0].isdigit() else len(words)
        indices = words[1 : 1 + size]  # behind them may stand a colour
        if len(indices) < size or not all(word.isdigit() for word in indices):
            raise _broken(path, number, words)
        counts.append(size)
        corners += map(int, indices)
    return _faces(counts, corners)


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
