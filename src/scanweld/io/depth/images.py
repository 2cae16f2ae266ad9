"""Which files are the depth images that a user names, their intrinsics and their masks."""

import glob
import os
import re
from collections.abc import Sequence
from pathlib import Path

from scanweld.errors import InputError, ReadError
from scanweld.io.collect import collect
from scanweld.io.depth.pixels import IMAGE_SUFFIXES, SUFFIXES
from scanweld.io.names import natural_key

_INTRINSICS = (
    "camera_intrinsic.json",
    "intrinsics.json",
    "intrinsic.json",
    "camera-intrinsics.txt",
    "intrinsics.txt",
    "cameras.txt",
    "camera_info.yaml",
    "cam.info.txt",
)
"""What programs call the intrinsics beside the images or their folder; the first is Open3D's."""
_WORDS = re.compile(r"(?<![a-z])(frame|depth|mask|color|colour|rgb|image|img)(?![a-z])|[^a-z0-9]")
"""What the names of an image and its mask do not share."""


def found_intrinsics(folder: Path) -> Path | None:
    """The file with intrinsics beside the images of a folder, or beside the folder."""
    places = [near / name for near in (folder, folder.parent) for name in _INTRINSICS]
    return next((place for place in places if place.is_file()), None)


def are_depth_images(inputs: Sequence[Path | str]) -> bool:
    """Whether images are named, or a folder that holds them and intrinsics but no other scans."""
    paths = [Path(each) for each in inputs]
    if len(paths) == 1 and paths[0].is_dir():
        images = _depth_folder(paths[0])
        return bool(_among(images)) and bool(found_intrinsics(images)) and _no_scans(paths[0])
    return bool(paths) and all(path.suffix.lower() in IMAGE_SUFFIXES for path in paths)


def depth_images(inputs: Sequence[Path | str]) -> list[Path]:
    """The depth images that files, folders and glob patterns name, in natural order.

    Of a folder those in its folder ``depth``, and of all images only those called depth, if any.

    Raises:
        ReadError: If a file is missing, or no depth image.
        InputError: If there are none.
    """
    found: dict[Path, Path] = {}
    for each in inputs:
        path = Path(each)
        if path.is_dir():
            paths = _among(_depth_folder(path))
        elif not path.exists() and glob.has_magic(str(each)):
            paths = [Path(match) for match in sorted(glob.glob(str(each)))]
            paths = [path for path in paths if path.suffix.lower() in SUFFIXES]
        elif path.suffix.lower() not in SUFFIXES:
            raise ReadError(f"{path}: no depth image; scanweld reads {', '.join(SUFFIXES)}")
        elif not path.exists():
            raise ReadError(f"{path}: there is no such file; check the path")
        else:
            paths = [path]
        if not paths:
            raise InputError(f"{each}: holds no depth images ({', '.join(SUFFIXES)})")
        found.update({Path(os.path.abspath(path)): path for path in paths})
    return [found[path] for path in sorted(found, key=lambda path: natural_key(path.as_posix()))]


def _depth_folder(folder: Path) -> Path:
    """Where the depth images of a capture are: in its folder ``depth``, if it has one."""
    return folder / "depth" if (folder / "depth").is_dir() else folder


def _among(folder: Path) -> list[Path]:
    """The depth images of a folder: those called so, if any are, else all images."""
    images = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")
    )
    named = [path for path in images if re.search(r"(?<![a-z])depth(?![a-z])", path.stem.lower())]
    return named or images


def image_names(paths: Sequence[Path]) -> list[str]:
    """Names of scans, each its own: stems, or paths below the common folder."""
    stems = [path.stem.removesuffix(".depth") for path in paths]
    if len(set(stems)) == len(stems):
        return stems
    above = os.path.commonpath([os.path.abspath(path.parent) for path in paths])
    return [Path(os.path.relpath(path, above)).as_posix() for path in paths]


def masks_of(paths: Sequence[Path], folder: Path) -> dict[Path, Path]:
    """By each image the mask of the same name, but for words such as depth and mask.

    Raises:
        InputError: If there is none for an image, or several.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder; --masks takes one with a mask for each image")
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES:
            found.setdefault(_key(path), []).append(path)
    missing = [path.name for path in paths if len(found.get(_key(path), ())) != 1]
    if missing:
        raise InputError(
            f"{folder}: {len(missing)} of {len(paths)} depth images have not exactly one mask of "
            f"their name there, such as {missing[0]}; name the masks as the images"
        )
    return {path: found[_key(path)][0] for path in paths}


def _key(path: Path) -> str:
    return _WORDS.sub("", path.stem.lower())


def _no_scans(folder: Path) -> bool:
    try:
        collect([folder])
    except InputError:
        return True
    return False
