"""Points as text, one a line: XYZ, PTS, ASC, TXT, CSV."""

import logging
import re
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.io.raw import RawScan, to_bytes
from scanweld.io.text import is_number, parse_numbers

logger = logging.getLogger(__name__)

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_SEPARATORS = bytes.maketrans(b",;", b"  ")
_COMMENT = re.compile(rb"(^|\s)(#|//).*$", re.DOTALL)
"""Not inside a word: some libraries print NaN as 1.#QNAN."""
_WIDTHS = (3, 4, 6, 7)


def read_xyz(path: Path, data: bytes) -> RawScan:
    """Points with x, y, z; x, y, z and a normal or a colour; or with an intensity behind z.

    Numbers are separated by white space, commas or semicolons. Comments begin with ``#`` or
    ``//``; one line of column names and one of the number of points may come first. Three
    further columns are normals if all of them are unit vectors, else colours.

    Raises:
        ReadError: If a line, the number of columns or the number of points is wrong.
    """
    lines = data.removeprefix(_BYTE_ORDER_MARK).splitlines()
    lines = [_COMMENT.sub(b"", line) for line in lines]
    if any(b"," in line and b";" in line for line in lines):
        raise ReadError(
            f"{path}: commas and semicolons in one line; write decimals with a point and separate "
            "the numbers by either"
        )
    lines = [line.translate(_SEPARATORS) for line in lines]
    _drop_column_names(path, lines)
    sizes = np.array([len(line.split()) for line in lines], dtype=np.int64)
    promised = _take_count(path, lines, sizes)
    table = _table(path, lines, sizes)
    if promised is not None and promised != len(table):
        raise ReadError(
            f"{path}: holds {len(table)} points but says {promised} (truncated, or a wrong count); "
            "copy it again or export it anew"
        )
    return _raw_scan(path, table)


def _drop_column_names(path: Path, lines: list[bytes]) -> None:
    """Blank the first line that holds anything, if it is made of names such as x y z."""
    first = next((k for k, line in enumerate(lines) if line.strip()), None)
    if first is not None and not any(is_number(word) for word in lines[first].split()):
        names = lines[first].decode(errors="replace").strip()
        logger.info("%s: column names %r skipped", path, names)
        lines[first] = b""


def _take_count(path: Path, lines: list[bytes], sizes: IntArray) -> int | None:
    """The number of points where it stands first, alone in its line; blanks that line."""
    filled = np.flatnonzero(sizes)
    if len(filled) < 2 or sizes[filled[0]] != 1 or not lines[filled[0]].strip().isdigit():
        return None
    first = int(filled[0])
    count = int(lines[first])
    lines[first], sizes[first] = b"", 0
    return count


def _table(path: Path, lines: list[bytes], sizes: IntArray) -> FloatArray:
    """All numbers (N, columns)."""
    filled = np.flatnonzero(sizes)
    if not len(filled):
        raise ReadError(f"{path}: holds no points; leave it out")
    # Before the widths: prose is better described by its first word than by their number.
    numbers = parse_numbers(path, b"\n".join(lines))
    width = int(sizes[filled[0]])
    odd = filled[sizes[filled] != width]
    if len(odd):
        raise ReadError(
            f"{path}: line {odd[0] + 1}: {sizes[odd[0]]} numbers where the lines before have "
            f"{width}; correct it or export it anew"
        )
    if width not in _WIDTHS:
        raise ReadError(
            f"{path}: {width} columns; scanweld reads 3 (x y z), 4 (and intensity), 6 (x y z and "
            "normal or colour) or 7 (x y z intensity colour)"
        )
    return numbers.reshape(-1, width)


def _raw_scan(path: Path, table: FloatArray) -> RawScan:
    width = table.shape[1]
    last = table[:, -3:]
    has_normals = width == 6 and _are_unit_vectors(last)
    has_colors = width >= 6 and not has_normals
    colors = to_bytes(last) if has_colors else None
    if has_colors and colors is None:
        raise ReadError(
            f"{path}: its last three columns are neither unit normals nor colours (0 to 255, or 0 "
            "to 1); export x y z only"
        )
    return RawScan(
        points=table[:, :3],
        normals=last if has_normals else None,
        colors=colors,
        intensity=to_bytes(table[:, 3]) if width in (4, 7) else None,
    )


def _are_unit_vectors(vectors: FloatArray) -> bool:
    """Whether all vectors (N, 3) are of length 1, to two digits, or zero (unknown)."""
    lengths = np.linalg.norm(vectors, axis=1)
    known = np.isfinite(lengths) & (lengths > 0)
    return bool(known.any() and (np.abs(lengths[known] - 1) < 0.02).all())
