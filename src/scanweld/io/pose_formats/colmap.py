"""COLMAP's text model: ``images.txt``, ``cameras.txt`` and an empty ``points3D.txt``.

As in COLMAP's documentation (doc/format.rst): an image has two lines, ``IMAGE_ID QW QX QY QZ TX TY
TZ CAMERA_ID NAME`` and its keypoints (none here); the pose takes the world to the camera (x right,
y down, z away), the quaternion is Hamilton's. A pixel's centre lies at (0.5, 0.5)
(doc/database.rst), half a pixel from scanweld's. Words end at a space, so names hold none. Far
from the origin the world is about a local one, which a comment of ``images.txt`` tells.
"""

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

TITLE = "COLMAP"
PIXEL_CENTRE = 0.5
"""Where the centre of the first pixel lies; scanweld has it at zero."""
IMAGE_SUFFIX = ".png"
"""No images are written: the names are those that pictures of the sensors would have."""


def recognise(text: str) -> bool:
    """Whether the text looks like this format."""
    words = next((line.split() for line in text.splitlines() if _is_data(line)), [])
    return len(words) >= 10 and are_numbers(words[:9]) and words[0].isdecimal()


def read(path: Path, text: str) -> PoseEntries:
    """The poses of all images of an ``images.txt``.

    Raises:
        ReadError: If a line is broken.
    """
    origin = read_shift(path, text)
    entries: list[Entry] = []
    lines = enumerate(text.splitlines(), start=1)
    for count, line in lines:
        if not _is_data(line):
            continue
        words = line.split(maxsplit=9)
        if len(words) < 10:
            raise ReadError(f"{path}: line {count}: not an image with its pose; export it anew")
        entries.append((words[9].strip(), attempt(_pose, path, count, words[1:8], origin)))
        next(lines, None)  # the keypoints, a line that may be empty
    return PoseEntries(title=TITLE, frame=Frame.SENSOR, entries=tuple(entries))


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The files' texts by their names.

    Raises:
        InputError: If a sensor is no pinhole.
        WriteError: If a name holds a space.
    """
    refuse_characters(scans, [scan.name for scan in scans], " ", TITLE)
    images = [
        *shift_lines(scans),
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME",
        "# POINTS2D[] as X Y POINT3D_ID: none",
    ]
    cameras = ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"]
    for k, scan in enumerate(scans, start=1):
        camera = scan.pinhole(TITLE)
        pose = scan.world_from_sensor().inverse()
        x, y, z, w = quaternion(pose.rotation)
        told = " ".join(number(value) for value in (w, x, y, z, *pose.translation))
        images += [f"{k} {told} {k} {scan.name}{IMAGE_SUFFIX}", ""]
        centre = (camera.cx + PIXEL_CENTRE, camera.cy + PIXEL_CENTRE)
        told = " ".join(number(value) for value in (camera.fx, camera.fy, *centre))
        cameras.append(f"{k} PINHOLE {camera.width} {camera.height} {told}")
    return {
        "colmap/images.txt": "\n".join(images) + "\n",
        "colmap/cameras.txt": "\n".join(cameras) + "\n",
        "colmap/points3D.txt": "# POINT3D_ID X Y Z R G B ERROR TRACK[]: none\n",
    }


def _pose(path: Path, line: int, words: Sequence[str], origin: FloatArray) -> Pose:
    qw, qx, qy, qz, *shift = parse_numbers(path, f"line {line}", words)
    camera_from_world = pose_from_quaternion(path, f"line {line}", (qx, qy, qz, qw), shift)
    return shifted(camera_from_world.inverse(), origin)


def _is_data(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")
