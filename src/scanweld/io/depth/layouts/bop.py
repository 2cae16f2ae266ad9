"""BOP, a scene's folder.

``scene_camera.json`` has for each image ``cam_K``, ``depth_scale`` (to millimetres) and perhaps
``cam_R_w2c`` and ``cam_t_w2c``, ``scene_gt.json`` the poses of its objects, in millimetres.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.depth.images import by_name
from scanweld.io.depth.intrinsics import intrinsics_of_entry
from scanweld.io.depth.layouts.records import (
    Layout,
    Shot,
    images_in,
    missing_notes,
    pose_or_none,
)
from scanweld.io.depth.pixels import SUFFIXES
from scanweld.io.poses import load_json, read_text

_CAMERAS, _OBJECTS = "scene_camera.json", "scene_gt.json"
_COLORS = ("rgb", "gray")


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "depth").is_dir() and (folder / _CAMERAS).is_file()


def read(folder: Path) -> list[Shot]:
    """The depth images with their cameras; the masks too, where each image has but one object."""
    cameras, objects = _entries(folder / _CAMERAS), _entries(folder / _OBJECTS)
    images = images_in(folder / "depth", *SUFFIXES)
    masks = {image: sorted((folder / "mask_visib").glob(f"{image.stem}_*")) for image in images}
    is_single = all(len(found) == 1 for found in masks.values())
    has_several = any(len(found) > 1 for found in masks.values())
    told = "mask_visib has masks of several objects; --masks 'mask_visib/*_000000.png' cuts to one"
    colors = by_name(images, folder, _COLORS)
    numbers = (str(int(image.stem)) for image in images if image.stem.isdigit())
    missing = missing_notes(_CAMERAS, cameras, numbers)
    shots = []
    for image in images:
        entry = cameras.get(str(int(image.stem))) if image.stem.isdigit() else None
        if entry is None:
            raise ReadError(f"{image}: {_CAMERAS} has no camera of it; add one or leave it out")
        intrinsics = intrinsics_of_entry(folder / _CAMERAS, entry)
        own = objects.get(str(int(image.stem)), ()) if is_single else ()
        shots.append(
            Shot(
                depth=image,
                color=colors.get(image),
                mask=masks[image][0] if is_single else None,
                intrinsics=intrinsics,
                per_meter=intrinsics.depth_scale,
                world_from_camera=_pose(own[0], "m2c") if len(own) == 1 else _pose(entry, "w2c"),
                notes=(told,) * has_several + missing,
            )
        )
    return shots


def _entries(path: Path) -> Mapping[str, Any]:
    """What a file says of each image, by its number."""
    if not path.is_file():
        return {}
    found = load_json(path, read_text(path))
    return {str(int(key)): value for key, value in found.items() if key.isdigit()}


def _pose(entry: Mapping[str, Any], key: str) -> Pose | None:
    """The pose of the camera in metres, from the motion that a file has to the camera."""
    turn, shift = entry.get(f"cam_R_{key}"), entry.get(f"cam_t_{key}")
    if not isinstance(turn, Sequence) or not isinstance(shift, Sequence):
        return None
    try:
        rotation = np.array(turn, dtype=float).reshape(3, 3)
        rows = np.column_stack([rotation, np.array(shift, dtype=float).reshape(3) / 1000.0])
    except (ValueError, TypeError):
        return None
    camera_from_world = pose_or_none(rows.ravel().tolist())
    return None if camera_from_world is None else camera_from_world.inverse()


LAYOUT = Layout(
    name="BOP",
    files="`depth/` and `scene_camera.json`",
    cameras="that file, for each image",
    scale="that file, for each image",
    poses="`scene_gt.json` of one object, else `scene_camera.json`",
    colors="`rgb/` or `gray/`",
    recognise=recognise,
    read=read,
    color_folders=_COLORS,
)
