"""CloudCompare: a text file a scan with its 4x4 matrix, as "Apply transformation" loads it.

As CloudCompare's documentation of that tool has it: each row on a line, numbers separated by
spaces; the matrix moves the cloud, x_world = M x_scan. The file is called after the scan.
"""

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from scanweld.errors import ReadError, WriteError
from scanweld.io.names import natural_key
from scanweld.io.pose_formats.records import (
    Frame,
    PosedScan,
    PoseEntries,
    are_numbers,
    attempt,
    matrix_rows,
    parse_words,
    printed,
    refuse_characters,
)
from scanweld.io.poses import read_text

TITLE = "CloudCompare"
FOLDER = "cloudcompare"
_LONGEST = 255
"""Bytes that the name of a file may have in the usual file systems."""


def recognise(text: str) -> bool:
    """Whether the text is such a matrix."""
    rows = [line.split() for line in text.splitlines() if line.strip()]
    return len(rows) == 4 and all(len(row) == 4 and are_numbers(row) for row in rows)


def read(path: Path, text: str) -> PoseEntries:
    """Refuse a single matrix, which does not tell the poses of several scans.

    Raises:
        ReadError: Always.
    """
    raise ReadError(f"{path}: holds the matrix of one scan; name the folder that holds all")


def read_folder(folder: Path) -> PoseEntries:
    """The matrices of a folder and of those inside it; other files are passed over.

    Raises:
        ReadError: If there are none.
    """
    entries = []
    for path in sorted(folder.rglob("*.txt"), key=lambda path: natural_key(path.as_posix())):
        text = read_text(path)
        if recognise(text):
            pose = attempt(parse_words, path, "the matrix", text.split())
            entries.append((path.relative_to(folder).as_posix(), pose))
    if not entries:
        raise ReadError(f"{folder}: holds no {TITLE} matrices (NAME.txt with four rows)")
    return PoseEntries(title=TITLE, frame=Frame.SCAN, entries=tuple(entries))


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The files' texts by their names.

    Raises:
        WriteError: If a name cannot be that of a file.
    """
    refuse_characters(scans, [scan.name for scan in scans], "", TITLE)
    for scan in scans:
        path = PurePosixPath(scan.name)
        is_long = any(len(f"{part}.txt".encode()) > _LONGEST for part in path.parts)
        if path.is_absolute() or ".." in path.parts or path.name in ("", ".") or is_long:
            raise WriteError(f"{printed(scan.name)}: cannot be the name of a file; rename it")
    return {
        f"{FOLDER}/{scan.name}.txt": "\n".join(matrix_rows(scan.world_from_scan)) + "\n"
        for scan in scans
    }
