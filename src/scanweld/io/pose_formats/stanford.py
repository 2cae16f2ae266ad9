"""Stanford ``.conf``, as in the 3D Scanning Repository and its tools (ply, zipper, vrip).

One line a scan, ``bmesh FILE tx ty tz qx qy qz qw``, after one of the viewer's ``camera``. The
quaternion is that of the *inverse* rotation, x_world = R(q)^T x_scan + t: with R(q) the scans of
the repository's own ``bun.conf`` do not coincide. Words end at a space, so names hold none.
"""

from collections.abc import Sequence
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.pose_formats.quaternions import pose_from_quaternion, quaternion
from scanweld.io.pose_formats.records import (
    Frame,
    PosedScan,
    PoseEntries,
    attempt,
    number,
    parse_numbers,
    refuse_characters,
)

TITLE = "Stanford .conf"
_MESHES = ("bmesh", "mesh")


def recognise(text: str) -> bool:
    """Whether the text looks like this format."""
    return any(line.split(maxsplit=1)[:1] == ["bmesh"] for line in text.splitlines())


def read(path: Path, text: str) -> PoseEntries:
    """The poses of all meshes.

    Raises:
        ReadError: If a line is broken.
    """
    entries = []
    for count, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0] not in _MESHES:
            continue
        if len(words) != 9:
            raise ReadError(
                f"{path}: line {count}: {len(words)} words, not {words[0]}, a file without spaces "
                "and 7 numbers; correct it"
            )
        entries.append((words[1], attempt(_pose, path, count, words[2:])))
    return PoseEntries(title=TITLE, frame=Frame.SCAN, entries=tuple(entries))


def _pose(path: Path, line: int, words: Sequence[str]) -> Pose:
    x, y, z, qx, qy, qz, qw = parse_numbers(path, f"line {line}", words)
    return pose_from_quaternion(path, f"line {line}", (-qx, -qy, -qz, qw), (x, y, z))


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The file's text by its name.

    Raises:
        WriteError: If a path holds a space.
    """
    files = [scan.known_file() for scan in scans]
    refuse_characters(scans, files, " ", TITLE)
    lines = ["camera 0 0 0 0 0 0 1"]
    for scan, file in zip(scans, files, strict=True):
        inverse = quaternion(scan.world_from_scan.rotation.T)
        numbers = (*scan.world_from_scan.translation, *inverse)
        lines.append(f"bmesh {file} {' '.join(number(x) for x in numbers)}")
    return {"poses.conf": "\n".join(lines) + "\n"}
