"""Polycam, raw data.

Below ``keyframes/``: ``depth/*.png`` in millimetres and ``cameras/*.json`` (or
``corrected_cameras``) with fx fy cx cy of the colour image and rows t_00 to t_23 of a camera with
y up.
"""

from pathlib import Path

from scanweld.errors import ReadError
from scanweld.io.depth.images import by_name
from scanweld.io.depth.intrinsics import intrinsics_of_entry
from scanweld.io.depth.layouts.records import (
    Layout,
    Shot,
    fitted,
    images_in,
    missing_notes,
    pose_or_none,
)
from scanweld.io.matrices import from_opengl
from scanweld.io.poses import load_json, read_text

_CAMERAS = {"corrected_cameras": "corrected_images", "cameras": "images"}
"""Folders of cameras and of the colour images that are theirs."""
_ROWS = (
    *("t_00", "t_01", "t_02", "t_03"),
    *("t_10", "t_11", "t_12", "t_13"),
    *("t_20", "t_21", "t_22", "t_23"),
)


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    inside = folder / "keyframes"
    return (inside / "depth").is_dir() and any((inside / name).is_dir() for name in _CAMERAS)


def read(folder: Path) -> list[Shot]:
    """The depth images with their cameras and poses."""
    inside = folder / "keyframes"
    cameras = next(name for name in _CAMERAS if (inside / name).is_dir())
    images = images_in(inside / "depth", ".png")
    colors = by_name(images, inside, (_CAMERAS[cameras],))
    listed = (path.stem for path in (inside / cameras).glob("*.json"))
    missing = missing_notes(cameras, listed, (image.stem for image in images))
    shots = []
    for image in images:
        path = inside / cameras / f"{image.stem}.json"
        if not path.is_file():
            raise ReadError(f"{image}: {cameras} has no {path.name}; leave the image out")
        entry = load_json(path, read_text(path))
        numbers = [entry.get(key) for key in _ROWS]
        sound = [number for number in numbers if isinstance(number, int | float)]
        pose = pose_or_none([float(number) for number in sound]) if len(sound) == 12 else None
        shots.append(
            Shot(
                depth=image,
                color=colors.get(image),
                intrinsics=fitted(intrinsics_of_entry(path, entry), image),
                world_from_camera=None if pose is None else from_opengl(pose),
                notes=missing,
            )
        )
    return shots


LAYOUT = Layout(
    name="Polycam",
    files="`keyframes/depth/` and `keyframes/cameras/`",
    cameras="`cameras/*.json`, for the depths' size",
    scale="1000",
    poses="`cameras/*.json`",
    colors="`images/`, in any size",
    recognise=recognise,
    read=read,
    color_folders=("keyframes/corrected_images", "keyframes/images"),
    per_meter=1000.0,
    is_scaled=True,
    scans=("raw.glb", "mesh.glb", "mesh.obj"),
)
