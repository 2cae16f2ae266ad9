"""OFF of Geomview: vertices, their normals and colours, and faces."""

import re
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.io.mesh_lines import broken_line, fan_faces, filled_lines
from scanweld.io.raw import RawScan, noted_bytes
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.text import is_number, plain_number

_COUNT = re.compile(rb"[0-9]{1,15}")
_OFF_MAGIC = re.compile(rb"(C?)(N?)OFF\b", re.IGNORECASE)


def read_off(path: Path, data: bytes) -> RawScan:
    """Vertices, normals (NOFF), colours (COFF) and faces of an OFF file.

    Raises:
        ReadError: If it is no such file, a line is broken or the counts are wrong.
    """
    lines = filled_lines(data)
    _, magic = next(lines, (0, [b""]))
    kind = _OFF_MAGIC.fullmatch(magic[0])
    if kind is None:
        raise ReadError(f"{path}: not an OFF file (it does not begin with 'OFF'); leave it out")
    number, words = (0, magic[1:]) if len(magic) > 1 else next(lines, (0, []))
    if len(words) < 2 or not all(map(_COUNT.fullmatch, words)):
        raise broken_line(path, number, words)
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
    colors, notes = noted_bytes("colours", table[:, after : after + 3] if colored else None)
    return RawScan(
        points=table[:, :3],
        faces=_off_faces(path, rows[num_vertices:]),
        normals=table[:, 3:6] if kind[2] and table.shape[1] >= 6 else None,
        colors=colors,
        notes=notes,
    )


def _off_vertices(path: Path, rows: list[tuple[int, list[bytes]]]) -> FloatArray:
    """The vertex lines (V, k) with k >= 3."""
    if not rows:
        return np.zeros((0, 3))
    width = len(rows[0][1])
    for number, words in rows:
        if len(words) != width or width < 3:
            raise broken_line(path, number, words)
    try:
        return np.array([[plain_number(word) for word in words] for _, words in rows])
    except ValueError:
        number, words = next(row for row in rows if not all(map(is_number, row[1])))
        raise broken_line(path, number, words) from None


def _off_faces(path: Path, rows: list[tuple[int, list[bytes]]]) -> IntArray | None:
    counts: list[int] = []
    corners: list[int] = []
    for number, words in rows:
        size = int(words[0]) if _COUNT.fullmatch(words[0]) else len(words)
        indices = words[1 : 1 + size]  # behind them may stand a colour
        if len(indices) < size or not all(map(_COUNT.fullmatch, indices)):
            raise broken_line(path, number, words)
        counts.append(size)
        corners += map(int, indices)
    return fan_faces(counts, corners)


FORMAT = ScanFormat(
    suffixes=(".off",),
    read=read_off,
    keeps=(Keeps.FACES, Keeps.NORMALS, Keeps.COLORS),
    begins=(b"OFF", b"COFF", b"NOFF", b"CNOFF"),
)
