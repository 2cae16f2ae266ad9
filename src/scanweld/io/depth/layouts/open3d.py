"""Open3D's data sets, RealSense recorders, and others like them.

``trajectory.log`` has five lines an image: its number thrice, and the matrix world from camera.
"""

from pathlib import Path

from scanweld.io.depth.images import by_name
from scanweld.io.depth.layouts import bop, record3d, tum
from scanweld.io.depth.layouts.records import (
    Layout,
    Shot,
    images_in,
    numbers_in,
    pose_or_none,
)
from scanweld.io.depth.pixels import COLOR_SUFFIXES, SUFFIXES

_CAMERAS = ("camera_intrinsic.json", "intrinsic.json", "intrinsics.json")
_POSES = ("trajectory.log", "scene/trajectory.log")
_COLORS = ("color", "image", "rgb")


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    has_camera = any((folder / name).is_file() for name in _CAMERAS)
    # Others have a folder depth too, and may have been given a camera.
    is_another = any(other.recognise(folder) for other in (bop, record3d, tum))
    return (folder / "depth").is_dir() and has_camera and not is_another


def read(folder: Path) -> list[Shot]:
    """The depth images, their colours by name, and their poses in natural order."""
    images = images_in(folder / "depth", *SUFFIXES)
    colors = by_name(images, folder, _COLORS) or _by_order(images, folder)
    path = next((folder / name for name in _POSES if (folder / name).is_file()), None)
    numbers = [] if path is None else numbers_in(path)
    fits, notes = len(numbers) == 19 * len(images), ()
    if path is not None and not fits:
        notes = (f"{path.name} has not one pose for each depth image: it is not used",)
    return [
        Shot(
            depth=image,
            color=colors.get(image),
            world_from_camera=pose_or_none(numbers[19 * k + 3 : 19 * (k + 1)]) if fits else None,
            notes=notes,
        )
        for k, image in enumerate(images)
    ]


def _by_order(images: list[Path], folder: Path) -> dict[Path, Path]:
    """Colour images by their order, as Open3D takes them, if there are as many."""
    place = next((folder / name for name in _COLORS if (folder / name).is_dir()), folder)
    found = [] if place == folder else images_in(place, *COLOR_SUFFIXES)
    return dict(zip(images, found, strict=True)) if len(found) == len(images) else {}


LAYOUT = Layout(
    name="Open3D",
    files="`depth/` and `camera_intrinsic.json`, `intrinsic.json` or `intrinsics.json`",
    cameras="that file",
    scale="by the values",
    poses="`trajectory.log`",
    colors="`color/`, `image/` or `rgb/`, if of the same size",
    recognise=recognise,
    read=read,
    color_folders=_COLORS,
)
