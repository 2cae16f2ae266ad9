"""Which files are the depth images that a user names, their intrinsics and their masks."""

import glob
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from scanweld.errors import InputError, ReadError
from scanweld.io.collect import collect
from scanweld.io.depth.pixels import COLOR_SUFFIXES, IMAGE_SUFFIXES, SUFFIXES, holds_depths
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
    """Whether images are named, or a folder that holds depths but no other scans."""
    paths = [Path(each) for each in inputs]
    if len(paths) == 1 and paths[0].is_dir():
        images = _depth_folder(paths[0])
        found = _among(images)
        are_meant = bool(found_intrinsics(images)) or (bool(found) and holds_depths(found[0]))
        return bool(found) and are_meant and not other_scans(paths[0])
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


def by_name(paths: Sequence[Path], folder: Path, names: Sequence[str]) -> dict[Path, Path]:
    """By each image the colour image of its name in the first folder that is there, if any."""
    place = next((folder / name for name in names if (folder / name).is_dir()), None)
    found = {} if place is None else _by_key(sorted(place.iterdir()), COLOR_SUFFIXES)
    return {p: found[_key(p)][0] for p in paths if len(found.get(_key(p), ())) == 1}


def num_colors(folder: Path, names: Sequence[str]) -> int:
    """Colour images in the first of some folders that is there."""
    place = next((folder / name for name in names if (folder / name).is_dir()), None)
    found = {} if place is None else _by_key(sorted(place.iterdir()), COLOR_SUFFIXES)
    return sum(map(len, found.values()))


def colors_of(paths: Sequence[Path], folder: Path) -> dict[Path, Path]:
    """By each image the colour image of the same name, but for words such as depth and color.

    Raises:
        InputError: If there is none for an image.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder; --color takes one of colour images, or none")
    found = by_name(paths, folder.parent, (folder.name,))
    check_colors(folder, paths, found)
    return found


def check_colors(where: Path, paths: Sequence[Path], found: Mapping[Path, Path]) -> None:
    """Refuse colour images that some depth images have and some not.

    Raises:
        InputError: If there is none for an image.
    """
    missing = [path.name for path in paths if path not in found]
    if missing:
        raise InputError(
            f"{where}: {len(missing)} of {len(paths)} depth images have no colour image of their "
            f"name, such as {missing[0]}; name them alike, or give --color none"
        )


def masks_of(paths: Sequence[Path], place: Path) -> dict[Path, Path]:
    """By each image the mask of the same name, but for words such as depth and mask.

    A mask 000003_000001 is of the image 000003, too: BOP counts the objects of an image.

    Args:
        paths: Of the images.
        place: A folder, or a glob pattern.

    Raises:
        InputError: If there is none for an image, or several.
    """
    if place.is_dir():
        masks = sorted(place.iterdir())
    elif glob.has_magic(str(place)):
        masks = [Path(match) for match in sorted(glob.glob(str(place)))]
    else:
        raise InputError(f"{place}: is no folder; --masks takes one with a mask for each image")
    found = _by_key(masks, SUFFIXES)
    of_objects = _by_key(masks, SUFFIXES, lambda path: path.stem.partition("_")[0].lower())
    found = {path: found.get(_key(path), of_objects.get(_key(path), [])) for path in paths}
    missing = [path.name for path in paths if len(found[path]) != 1]
    if missing:
        raise InputError(
            f"{place}: {len(missing)} of {len(paths)} depth images have not exactly one mask of "
            f"their name there, such as {missing[0]}; name the masks as the images, or give a "
            "pattern that chooses one for each"
        )
    return {path: found[path][0] for path in paths}


def _by_key(
    paths: Sequence[Path], suffixes: Sequence[str], key: Callable[[Path], str] | None = None
) -> dict[str, list[Path]]:
    found: dict[str, list[Path]] = {}
    for path in paths:
        if path.suffix.lower() in suffixes and not path.name.startswith("."):
            found.setdefault((key or _key)(path), []).append(path)
    return found


def _key(path: Path) -> str:
    return _WORDS.sub("", path.stem.lower())


def other_scans(folder: Path) -> list[str]:
    """Names of the files of a folder that are scans of other formats."""
    try:
        return [file.path.name for file in collect([folder])]
    except InputError:
        return []
