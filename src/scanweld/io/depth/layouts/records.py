"""What a layout says of itself, and what it knows of each depth image."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError, some_of
from scanweld.geometry.pose import Pose
from scanweld.io.depth.colors import is_same_view
from scanweld.io.depth.intrinsics import Intrinsics
from scanweld.io.depth.pixels import read_pixels
from scanweld.io.matrices import pose_from_numbers
from scanweld.io.names import natural_key
from scanweld.io.poses import read_text


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """A depth image and what lies beside it.

    Attributes:
        depth: The image.
        color: Colour image of the same view.
        mask: Image of the pixels that are the object.
        intrinsics: Of the depth image, where the layout has them for each.
        per_meter: Depth values in a metre, likewise.
        world_from_camera: Where the camera stood (x right, y down, z away), in metres.
        notes: What else is to be said of it.
    """

    depth: Path
    color: Path | None = None
    mask: Path | None = None
    intrinsics: Intrinsics | None = None
    per_meter: float | None = None
    world_from_camera: Pose | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Layout:
    """A layout of captures. Its module's docstring begins with what it is.

    Attributes:
        name: In a word.
        files: By which files it is recognised.
        cameras: Where the intrinsics are, in words.
        scale: The scale, in words.
        poses: Where poses are, in words.
        colors: Whether colour images are of the depth images' view, in words.
        recognise: Whether a folder has it; looks at names of files, and opens small ones at most.
        read: The depth images of a folder, in natural order. Raises ``ReadError``.
        per_meter: Depth values in a metre, if all captures have the same.
        usual: Intrinsics to be taken if no file has any.
        is_scaled: Whether colour images may show the same view in another size.
        color_folders: Folders of colour images that are of the depth images by their names.
        scans: Names of files in such a folder that are made of the capture, and no scans.
    """

    name: str
    files: str
    cameras: str
    scale: str
    poses: str
    colors: str
    recognise: Callable[[Path], bool]
    read: Callable[[Path], Sequence[Shot]]
    per_meter: float | None = None
    usual: Intrinsics | None = None
    is_scaled: bool = False
    color_folders: tuple[str, ...] = ()
    scans: tuple[str, ...] = ()


def images_in(folder: Path, *suffixes: str) -> list[Path]:
    """The images of a folder with some suffixes, in natural order; none if there is no folder."""
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if path.suffix.lower() in suffixes]
    return sorted(
        (path for path in found if not path.name.startswith(".")),
        key=lambda path: natural_key(path.name),
    )


def missing_notes(where: str, listed: Iterable[str], there: Iterable[str]) -> tuple[str, ...]:
    """What is to be said of images that a layout lists and that are not there; nothing if all are.

    Args:
        where: What lists them.
        listed: What it calls them.
        there: The same of the images that were found.
    """
    missing = sorted(set(listed).difference(there), key=natural_key)
    return (f"{where} lists images that are not there: {some_of(missing)}",) * bool(missing)


def numbers_in(path: Path) -> list[float]:
    """All numbers of a text.

    Raises:
        ReadError: If it cannot be read, or holds something else.
    """
    try:
        return [float(word) for word in re.split(r"[\s,]+", read_text(path).strip())]
    except ValueError as error:
        raise ReadError(f"{path}: {error}; correct the file or take it away") from error


def pose_or_none(numbers: Sequence[float]) -> Pose | None:
    """The pose of a matrix of 12 or 16 numbers, row after row; None if it is no rigid motion."""
    whole = [*numbers, 0.0, 0.0, 0.0, 1.0] if len(numbers) == 12 else list(numbers)
    try:
        return pose_from_numbers(whole) if np.isfinite(whole).all() else None
    except ValueError:
        return None


def fitted(intrinsics: Intrinsics, image: Path) -> Intrinsics:
    """Intrinsics of a colour image for a depth image that shows the same view in another size.

    Raises:
        ReadError: If their shapes differ.
    """
    height, width = read_pixels(image).shape
    if intrinsics.width is None or intrinsics.height is None:
        return intrinsics
    x, y = width / intrinsics.width, height / intrinsics.height
    if not is_same_view((height, width), (intrinsics.height, intrinsics.width)):
        raise ReadError(
            f"{image}: has {width} x {height} pixels, its camera {intrinsics.width} x "
            f"{intrinsics.height}: they do not show the same view; give --intrinsics"
        )
    return Intrinsics(
        fx=x * intrinsics.fx,
        fy=y * intrinsics.fy,
        cx=x * (intrinsics.cx + 0.5) - 0.5,
        cy=y * (intrinsics.cy + 0.5) - 0.5,
        width=width,
        height=height,
    )
