"""TUM trajectory: ``timestamp tx ty tz qx qy qz qw``, world from camera (x right, y down, z away).

As in the file formats of the TUM RGB-D benchmark: the position and the orientation of the optical
centre with respect to the world; lines that begin with ``#`` are comments. There are no names: the
k-th scan in natural order has the time k, and a comment tells its name. Far from the origin poses
are about a local one, which a comment tells, too.
"""

import re
from collections.abc import Sequence
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.io.local_origin import shifted
from scanweld.io.pose_formats.quaternions import pose_from_quaternion, quaternion
from scanweld.io.pose_formats.records import (
    Entry,
    Frame,
    PosedScan,
    PoseEntries,
    are_numbers,
    attempt,
    number,
    parse_numbers,
    read_shift,
    refuse_characters,
    shift_lines,
)

TITLE = "TUM"
_NAME = re.compile(r"# ([0-9]+) = (.+)")
"""How our comments tell the name of the scan at a time."""


def recognise(text: str) -> bool:
    """Whether the text looks like this format."""
    rows = [line.split() for _, line in _rows(text)]
    return bool(rows) and all(len(row) == 8 and are_numbers(row) for row in rows)


def read(path: Path, text: str) -> PoseEntries:
    """The poses, with names where comments tell all of them.

    Raises:
        ReadError: If a line is broken.
    """
    told = [_NAME.fullmatch(line) for line in text.splitlines()]
    names: dict[str, str] = {match[1]: match[2] for match in told if match}
    shift = read_shift(path, text)
    entries: list[Entry] = []
    for count, line in _rows(text):
        words = line.split()
        if len(words) != 8:
            raise ReadError(f"{path}: line {count}: {len(words)} numbers instead of 8; correct it")
        entries.append((names.get(words[0]), attempt(_pose, path, count, words, shift)))
    if any(name is None for name, _ in entries):
        entries = [(None, pose) for _, pose in entries]
    return PoseEntries(title=TITLE, frame=Frame.SENSOR, entries=tuple(entries), are_paths=False)


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The file's text by its name.

    Raises:
        InputError: If a sensor is no pinhole.
        WriteError: If a name does not fit into a line.
    """
    refuse_characters(scans, [scan.name for scan in scans], "", TITLE)
    lines = [*shift_lines(scans), "# timestamp tx ty tz qx qy qz qw"]
    for k, scan in enumerate(scans):
        scan.pinhole(TITLE)
        pose = scan.world_from_sensor()
        numbers = (*pose.translation, *quaternion(pose.rotation))
        lines += [f"# {k} = {scan.name}", f"{k} {' '.join(number(x) for x in numbers)}"]
    return {"poses.tum.txt": "\n".join(lines) + "\n"}


def _pose(path: Path, line: int, words: Sequence[str], shift: FloatArray) -> Pose:
    _, x, y, z, *xyzw = parse_numbers(path, f"line {line}", words)
    return shifted(pose_from_quaternion(path, f"line {line}", xyzw, (x, y, z)), shift)


def _rows(text: str) -> list[tuple[int, str]]:
    """Numbers and text of the lines that hold more than a comment."""
    lines = enumerate(text.splitlines(), start=1)
    return [(k, line) for k, line in lines if line.strip() and not line.lstrip().startswith("#")]
