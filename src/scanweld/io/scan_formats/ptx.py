"""PTX of Leica Cyclone: scans with grid and pose, one after the other.

Of each scan: columns, rows, the scanner's place and three axes, a 4x4 matrix that takes row vectors
to the common frame, then a line for each cell, column after column: x y z in the scanner's frame,
intensity, and perhaps a colour. Cells that say 0 0 0 saw nothing.
"""

from functools import partial
from pathlib import Path

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.pose import Pose
from scanweld.io.matrices import pose_from_numbers
from scanweld.io.raw import RawScan, noted_bytes
from scanweld.io.scan_formats.records import Keeps, Part, ScanFormat
from scanweld.io.text import parse_numbers, words_per_line

_HEAD_WIDTHS = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
_WIDTHS = (4, 7)


def read_ptx(path: Path, data: bytes) -> list[Part]:
    """The scans of a PTX file, of which only the heads are parsed at first.

    Raises:
        ReadError: If a head is broken, or the file ends too early.
    """
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    text = np.frombuffer(data, np.uint8)
    parts = []
    at, line = _skip_blank(text, 0, 1)
    while at < len(text):
        begin, _ = _after_lines(text, at, len(_HEAD_WIDTHS))
        head = _head(path, data[at:begin], line)
        columns, rows = (int(number) for number in head[:2])
        end, found = _after_lines(text, begin, columns * rows)
        if found < columns * rows:
            raise ReadError(
                f"{path}: scan {len(parts) + 1} has {found} of its {columns} x {rows} cells "
                "(truncated, or a wrong count); copy it again or export it anew"
            )
        body_line = line + len(_HEAD_WIDTHS)
        parts.append(Part(read=partial(_scan, path, data[begin:end], body_line, head)))
        at, line = _skip_blank(text, end, body_line + columns * rows)
    return parts


def _head(path: Path, text: bytes, line: int) -> FloatArray:
    """The 30 numbers before a scan's cells."""
    numbers = parse_numbers(path, text, line)
    widths = words_per_line(text.rstrip())
    if tuple(widths.tolist()) != _HEAD_WIDTHS:
        raise ReadError(
            f"{path}: line {line}: no scan of a PTX file begins here, with columns, rows, place, "
            "axes and matrix; export it anew"
        )
    size = numbers[:2]
    if not ((size >= 1) & (size < 2**31) & (size == np.rint(size))).all():
        raise ReadError(f"{path}: line {line}: columns and rows are not numbers; export it anew")
    return numbers


def _scan(path: Path, text: bytes, line: int, head: FloatArray) -> RawScan:
    columns, rows = (int(number) for number in head[:2])
    widths = words_per_line(text)[: columns * rows]
    width = int(widths[0])
    odd = np.flatnonzero(widths != width)
    if width not in _WIDTHS or len(odd):
        at = int(odd[0]) if len(odd) else 0
        raise ReadError(
            f"{path}: line {line + at}: {widths[at]} numbers; a cell has 4, or 7 with a colour; "
            "export it anew"
        )
    table = parse_numbers(path, text, line).reshape(-1, width)
    points = np.where((table[:, :3] == 0).all(axis=1)[:, None], np.nan, table[:, :3])
    pose, note = _pose(head[14:])
    colors, no_colors = _colors(table[:, 4:] if width == 7 else None)
    intensity, no_shades = noted_bytes("intensities", table[:, 3], "f8")
    return RawScan(
        points=points,
        grid=np.ascontiguousarray(np.arange(len(points)).reshape(columns, rows).T),
        colors=colors,
        intensity=intensity,
        world_from_scan=pose,
        notes=(*((note,) if note else ()), *no_colors, *no_shades),
    )


def _colors(values: FloatArray | None) -> tuple[ByteArray | None, tuple[str, ...]]:
    kind = "u1" if values is not None and values.max(initial=0) > 1 else ""
    return noted_bytes("colours", values, kind)


def _pose(numbers: FloatArray) -> tuple[Pose | None, str]:
    """The scan's pose, and what is said if it has none."""
    try:
        return pose_from_numbers(numbers.reshape(4, 4).T.ravel().tolist()), ""
    except ValueError:
        return None, "the file's matrix is no rigid motion, so it was left out"


@njit(cache=True, nogil=True)
def _skip_blank(
    text: ByteArray, at: int, line: int
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Where the next line that is not blank begins, and its number."""
    begin = at
    while at < len(text) and (text[at] == 32 or 9 <= text[at] <= 13):
        if text[at] == 10:
            line += 1
            begin = at + 1
        at += 1
    return (begin if at < len(text) else at), line


@njit(cache=True, nogil=True)
def _after_lines(
    text: ByteArray, at: int, count: int
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Where the text goes on after so many lines, and how many there were."""
    found = 0
    while found < count and at < len(text):
        while at < len(text) and text[at] != 10:
            at += 1
        at += 1
        found += 1
    return min(at, len(text)), found


FORMAT = ScanFormat(
    suffixes=(".ptx",),
    read=read_ptx,
    keeps=(Keeps.SCANS, Keeps.GRID, Keeps.POSE, Keeps.COLORS),
)
