"""TUM RGB-D benchmark.

Lists ``depth.txt``, ``rgb.txt`` (time, file) and ``groundtruth.txt`` (time tx ty tz qx qy qz qw)
are put together by time; what is farther than 0.02 s from an image is not of it.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.depth.intrinsics import Intrinsics
from scanweld.io.depth.layouts.records import Layout, Shot, images_in, missing_notes
from scanweld.io.depth.pixels import SUFFIXES
from scanweld.io.pose_formats.quaternions import pose_from_quaternion
from scanweld.io.pose_formats.records import are_numbers
from scanweld.io.poses import read_text

_APART = 0.02
"""Seconds; the frames of such a camera are 0.033 apart."""


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "depth").is_dir() and (folder / "depth.txt").is_file()


def read(folder: Path) -> list[Shot]:
    """The depth images that are there, with the colour and the pose nearest in time."""
    when = {Path(words[1]).name: float(words[0]) for words in _rows(folder / "depth.txt", 2)}
    colors = _Timed(_rows(folder / "rgb.txt", 2))
    poses = _Timed(_rows(folder / "groundtruth.txt", 8))
    images = images_in(folder / "depth", *SUFFIXES)
    missing = missing_notes("depth.txt", when, (image.name for image in images))
    shots = []
    for image in images:
        time = when.get(image.name)
        color = None if time is None else colors.nearest(time)
        pose = None if time is None else poses.nearest(time)
        shots.append(
            Shot(
                depth=image,
                color=None if color is None else folder / color[1],
                world_from_camera=None if pose is None else _pose(folder, pose),
                notes=("depth.txt does not list it: no colour, no pose",) * (time is None)
                + missing,
            )
        )
    return shots


class _Timed:
    """Lines of a list, to be found by their time."""

    def __init__(self, rows: Sequence[Sequence[str]]) -> None:
        self._rows = rows
        self._times = np.array([float(words[0]) for words in rows])

    def nearest(self, time: float) -> Sequence[str] | None:
        """The words of the line of a time, if there is one."""
        apart = np.abs(self._times - time)
        return self._rows[int(np.nanargmin(apart))] if (apart <= _APART).any() else None


def _rows(path: Path, count: int) -> list[list[str]]:
    """The words of each line of a list, the first of which is a time; none if there is no file."""
    rows = []
    for k, line in enumerate(read_text(path).splitlines() if path.is_file() else (), start=1):
        words = line.split("#")[0].replace("\\", "/").split()
        if not words:
            continue
        if len(words) != count or not are_numbers(words[:1]):
            raise ReadError(f"{path}: line {k}: not a time and {count - 1} more words; correct it")
        rows.append(words)
    return rows


def _pose(folder: Path, words: Sequence[str]) -> Pose | None:
    try:
        _, x, y, z, *xyzw = map(float, words)
        return pose_from_quaternion(folder / "groundtruth.txt", words[0], xyzw, (x, y, z))
    except (ReadError, ValueError):
        return None


LAYOUT = Layout(
    name="TUM",
    files="`depth/` and `depth.txt`",
    cameras="a file beside, else 525 525 319.5 239.5",
    scale="5000",
    poses="`groundtruth.txt`",
    colors="by `rgb.txt`",
    recognise=recognise,
    read=read,
    per_meter=5000.0,
    usual=Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480),
)
