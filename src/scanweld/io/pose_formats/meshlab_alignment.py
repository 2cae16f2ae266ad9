"""MeshLab alignment, ``.aln``: a count, then for each scan its file, a ``#`` and a matrix.

As in ``wrap/io_trimesh/alnParser.h`` of the VCG library: x_world = M x_scan, row after row; a
file's name has a line of its own, relative to the alignment, of fewer than 1024 bytes.
"""

from collections.abc import Sequence
from pathlib import Path

from scanweld.errors import ReadError, WriteError
from scanweld.io.pose_formats.records import (
    Entry,
    Frame,
    PosedScan,
    PoseEntries,
    attempt,
    matrix_rows,
    parse_words,
    refuse_characters,
)

_MOST_DIGITS = 9
"""Of the number of scans."""
TITLE = "MeshLab .aln"
_MAX_NAME_BYTES = 1000


def recognise(text: str) -> bool:
    """Whether the text looks like this format."""
    lines = text.splitlines()
    return len(lines) > 2 and lines[0].strip().isdecimal() and lines[2].startswith("#")


def read(path: Path, text: str) -> PoseEntries:
    """The poses of all meshes.

    Raises:
        ReadError: If the file is cut short, or a matrix is not a rigid motion.
    """
    lines = text.splitlines()
    first = lines[0].strip() if lines else ""
    count = int(first) if first.isdecimal() and len(first) <= _MOST_DIGITS else 0
    if not count or len(lines) < 1 + 6 * count:
        raise ReadError(
            f"{path}: does not hold the number of scans and 6 lines for each; save it anew"
        )
    entries: list[Entry] = []
    for begin in range(1, 1 + 6 * count, 6):
        label, comment, *rows = lines[begin : begin + 6]
        if not comment.startswith("#"):
            raise ReadError(f"{path}: line {begin + 2}: does not begin with '#'; save it anew")
        words = " ".join(rows).split()
        entries.append((label, attempt(parse_words, path, label, words)))
    return PoseEntries(title=TITLE, frame=Frame.SCAN, entries=tuple(entries))


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The file's text by its name.

    Raises:
        WriteError: If a path does not fit into a line.
    """
    files = [scan.known_file() for scan in scans]
    refuse_characters(scans, files, "", TITLE)
    lines = [str(len(scans))]
    for scan, file in zip(scans, files, strict=True):
        if len(file.encode()) > _MAX_NAME_BYTES:
            raise WriteError(f"{scan.name}: the path of its file is too long for {TITLE}")
        lines += [file, "#", *matrix_rows(scan.world_from_scan)]
    return {"poses.aln": "\n".join([*lines, "0"]) + "\n"}
