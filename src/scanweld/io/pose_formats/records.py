"""What all formats of poses share: posed scans to write, and what was read from a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import ParamSpec

import numpy as np

from scanweld.errors import InputError, ReadError, WriteError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.io.local_origin import SHIFT_KEY, shift_text, shifted, told_shift
from scanweld.io.matrices import pose_from_numbers

Entry = tuple[str | None, Pose | ReadError]
Arguments = ParamSpec("Arguments")


class Frame(StrEnum):
    """What a format's poses take to the world."""

    SCAN = "scan"
    SENSOR = "sensor"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PosedScan:
    """A placed scan, as the writers of poses take it.

    Attributes:
        name: Of the scan.
        world_from_scan: Its pose, scan frame.
        file: Path of its file, as seen from where the poses go; None where no format asks for it.
        camera: Of its sensor; likewise None.
        scan_from_sensor: Where the sensor stood; likewise None.
        shift: The local origin (3,) of a world that lies far off; None where it does not.
    """

    name: str
    world_from_scan: Pose
    file: str | None = None
    camera: Camera | None = None
    scan_from_sensor: Pose | None = None
    shift: FloatArray | None = None

    def known_file(self) -> str:
        """The path of the scan's file.

        Raises:
            InputError: If it is unknown.
        """
        if self.file is None:
            raise InputError(f"{self.name}: it is unknown where its file is; name the scans")
        return self.file

    def pinhole(self, title: str) -> Camera:
        """The scan's camera, which must be a pinhole.

        Args:
            title: Of the format that asks.

        Raises:
            InputError: If it is none, or unknown.
        """
        return require_pinhole(self.name, self.camera, title)

    def world_from_sensor(self) -> Pose:
        """The pose of the scan's sensor: x right, y down, z away; about the local origin, if any.

        Raises:
            InputError: If it is unknown where the sensor stood.
        """
        if self.scan_from_sensor is None:
            raise InputError(f"{self.name}: it is unknown where its sensor stood")
        pose = self.world_from_scan @ self.scan_from_sensor
        return pose if self.shift is None else shifted(pose, -self.shift)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PoseEntries:
    """What a file of poses says.

    Attributes:
        title: Of its format.
        frame: Whether its poses are world_from_scan or world_from_sensor.
        entries: What the file calls each scan, and its pose, or what is wrong with that; None where
            the format has no names, so that the scans come in natural order.
        are_paths: Whether scans are called by paths of files, rather than by name.
    """

    title: str
    frame: Frame
    entries: tuple[Entry, ...]
    are_paths: bool = True


def require_pinhole(name: str, camera: Camera | None, title: str) -> Camera:
    """The camera of a scan of which a format speaks as a pinhole.

    Raises:
        InputError: If it is no pinhole, or unknown.
    """
    if camera is None or camera.model is not CameraModel.PINHOLE:
        kind = "of unknown kind" if camera is None else camera.model.name.lower()
        raise InputError(
            f"{name}: its sensor is {kind}, and {title} speaks of pinholes only; use poses of scan "
            "frames (conf, mlp, aln, open3d or cloudcompare)"
        )
    return camera


def refuse_characters(
    scans: Sequence[PosedScan], texts: Sequence[str], bad: str, title: str
) -> None:
    """Refuse names that a format cannot hold, before anything is written.

    Args:
        scans: The scans,
        texts: and what is to be written for each.
        bad: Characters that may not be in it; control characters never may.
        title: Of the format.

    Raises:
        WriteError: At the first that holds one.
    """
    for scan, text in zip(scans, texts, strict=True):
        found = next((c for c in text if c in bad or (not c.isprintable() and c != " ")), None)
        if found is not None:
            what = "a space" if found == " " else repr(found)
            raise WriteError(
                f"{printed(scan.name)}: {title} cannot hold {what} in {text!r}; rename the scan's "
                "file or choose another format"
            )


def shift_lines(scans: Sequence[PosedScan]) -> list[str]:
    """The comment that tells the local origin of the sensors' poses, if they have one."""
    shifts = [scan.shift for scan in scans[:1] if scan.shift is not None]
    return [f"# {shift_text(shift)}" for shift in shifts]


def read_shift(path: Path, text: str) -> FloatArray:
    """The local origin (3,) that such a comment tells; zero without one.

    Raises:
        ReadError: If it is no three numbers.
    """
    try:
        shift = told_shift(text.encode())
    except ValueError as error:
        raise ReadError(
            f"{path}: its {SHIFT_KEY} is not three numbers ({error}); correct or remove it"
        ) from error
    return np.zeros(3) if shift is None else shift


def printed(name: str) -> str:
    """The name on one line."""
    return name if name.isprintable() else repr(name)


def attempt(
    read: Callable[Arguments, Pose], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Pose | ReadError:
    """The pose of one scan, or why it cannot be read, which leaves those of the others."""
    try:
        return read(*args, **kwargs)
    except ReadError as error:
        return error


def parse_pose(path: Path, where: str, numbers: Sequence[float]) -> Pose:
    """The pose of the 16 numbers of a matrix, row after row.

    Raises:
        ReadError: If they are not a rigid motion.
    """
    try:
        return pose_from_numbers(numbers)
    except (ValueError, OverflowError) as error:
        raise ReadError(f"{path}: {where}: {error}; correct the file or write it anew") from error


def parse_words(path: Path, where: str, words: Sequence[str]) -> Pose:
    """The pose of the 16 numbers of a matrix in words, row after row.

    Raises:
        ReadError: If they are no numbers, or not a rigid motion.
    """
    return parse_pose(path, where, parse_numbers(path, where, words))


def parse_numbers(path: Path, where: str, words: Sequence[str]) -> list[float]:
    """Words as numbers.

    Raises:
        ReadError: If one is none.
    """
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise ReadError(f"{path}: {where}: {error}; correct the file or write it anew") from error


def are_numbers(words: Sequence[str]) -> bool:
    """Whether all words can be read as numbers."""
    try:
        [float(word) for word in words]
    except ValueError:
        return False
    return True


def number(value: float) -> str:
    """The shortest text that is read back to the last bit; no minus zero."""
    return repr(float(value) + 0.0)


def matrix_rows(pose: Pose) -> list[str]:
    """The four rows of the 4x4 matrix as text."""
    return [" ".join(number(x) for x in row) for row in pose.matrix()]
