"""Record3D, exported as EXR and RGB (needs scanweld[exr]), or with depths as NPY or TIFF.

``metadata.json`` has ``K`` (column after column, of the colour image), ``w``, ``h``, and poses
(qx qy qz qw x y z) of a camera with y up.
"""

import json
from pathlib import Path
from typing import Any

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.depth.images import by_name
from scanweld.io.depth.intrinsics import intrinsics_of_entry
from scanweld.io.depth.layouts.records import Layout, Shot, fitted, images_in
from scanweld.io.depth.pixels import SUFFIXES
from scanweld.io.matrices import from_opengl
from scanweld.io.pose_formats.quaternions import pose_from_quaternion

_FILES = ("metadata.json", "metadata")
_COLORS = ("rgb", "color", "rgbd")


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    path = _metadata(folder)
    has_images = (folder / "depth").is_dir() or (folder / "rgbd").is_dir()
    return has_images and path is not None and {"K", "poses"} <= _entry(path).keys()


def read(folder: Path) -> list[Shot]:
    """The depth images with their poses."""
    path = _metadata(folder)
    assert path is not None
    images = images_in(folder / "depth", *SUFFIXES)
    if not images:
        raise ReadError(
            f"{folder}: its depths are packed in Record3D's own way (LZFSE), which scanweld does "
            "not read; export EXR + RGB from the app"
        )
    entry = _entry(path)
    poses = entry["poses"] if isinstance(entry["poses"], list) else []
    fits, notes = len(poses) == len(images), ()
    if not fits:
        notes = (f"{path.name} has {len(poses)} poses for {len(images)} images: they are not used",)
    intrinsics = fitted(intrinsics_of_entry(path, entry), images[0])
    colors = by_name(images, folder, _COLORS)
    return [
        Shot(
            depth=image,
            color=colors.get(image),
            intrinsics=intrinsics,
            world_from_camera=_pose(path, poses[k]) if fits else None,
            notes=notes,
        )
        for k, image in enumerate(images)
    ]


def _metadata(folder: Path) -> Path | None:
    return next((folder / name for name in _FILES if (folder / name).is_file()), None)


def _entry(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _pose(path: Path, numbers: Any) -> Pose | None:
    try:
        *xyzw, x, y, z = map(float, numbers)
        return from_opengl(pose_from_quaternion(path, "poses", xyzw, (x, y, z)))
    except (ReadError, ValueError, TypeError):
        return None


LAYOUT = Layout(
    name="Record3D",
    files="`depth/` and `metadata.json`",
    cameras="that file, for the depths' size",
    scale="by the values",
    poses="that file",
    colors="`rgb/`, in any size",
    recognise=recognise,
    read=read,
    color_folders=_COLORS,
    is_scaled=True,
)
