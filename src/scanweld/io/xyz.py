"""Points as text, one a line: XYZ, PTS, ASC, TXT, CSV."""

import logging
import re
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.io.raw import RawScan, to_bytes
from scanweld.io.text import is_number, parse_numbers, words_per_line

logger = logging.getLogger(__name__)

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_SEPARATORS = bytes.maketrans(b",;", b"  ")
_COMMENT = re.compile(rb"(^|\s)(#|//).*$", re.DOTALL)
"""Not inside a word: some libraries print NaN as 1.#QNAN."""
_MIXED = re.compile(rb",[^\r\n]*;|;[^\r\n]*,")
_FILLED_LINE = re.compile(rb"[^\r\n]*[^\s][^\r\n]*")
_WIDTHS = (3, 4, 6, 7)


def read_xyz(path: Path, data: bytes) -> RawScan:
    """Points with x, y, z; x, y, z and a normal or a colour; or with an intensity behind z.

    Numbers are separated by white space, commas or semicolons. Comments begin with ``#`` or
    ``//``; one line of column names and one of the number of points may come first. Three
    further columns are normals if all of them are unit vectors, else colours.

    Raises:
        ReadError: If a line, the number of columns or the number of points is wrong.
    """
    text = data.removeprefix(_BYTE_ORDER_MARK)
    if b"#" in text or b"//" in text:
        text = b"\n".join(_COMMENT.sub(b"", line) for line in text.splitlines())
    if b"," in text and b";" in text and _MIXED.search(text):
        raise ReadError(
            f"{path}: commas and semicolons in one line; write decimals with a point and separate "
            "the numbers by either"
        )
    text = _without_column_names(path, text.translate(_SEPARATORS))
    text, promised = _take_count(text)
    table = _table(path, text)
    if promised is not None and promised != len(table):
        raise ReadError(
            f"{path}: holds {len(table)} points but says {promised} (truncated, or a wrong count); "
            "copy it again or export it anew"
        )
    return _raw_scan(path, table)


def _without_column_names(path: Path, text: bytes) -> bytes:
    """The text, the first line that holds anything blanked if it is made of names such as x y z."""
    first = _FILLED_LINE.search(text)
    if first is None or any(is_number(word) for word in first[0].split()):
        return text
    names = first[0].decode(errors="replace").strip()
    logger.info("%s: column names %r skipped", path, names)
    return text[: first.start()] + text[first.end() :]


def _take_count(text: bytes) -> tuple[bytes, int | None]:
    """The text and the number of points where it stands first, alone in its line; blanks that."""
    first = _FILLED_LINE.search(text)
    if first is None or not first[0].strip().isdigit() or not text[first.end() :].strip():
        return text, None
    return text[: first.start()] + text[first.end() :], int(first[0])


def _table(path: Path, text: bytes) -> FloatArray:
    """All numbers (N, columns)."""
    sizes = words_per_line(text)
    filled = np.flatnonzero(sizes)
    if not len(filled):
        raise ReadError(f"{path}: holds no points; leave it out")
    # Before the widths: prose is better described by its first word than by their number.
    numbers = parse_numbers(path, text)
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
