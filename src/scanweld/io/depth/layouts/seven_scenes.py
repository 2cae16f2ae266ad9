"""7-Scenes and 3DMatch.

``frame-000000.depth.png`` beside ``frame-000000.pose.txt``, the matrix world from camera.
"""

from pathlib import Path

from scanweld.io.depth.intrinsics import Intrinsics
from scanweld.io.depth.layouts.records import (
    Layout,
    Shot,
    images_in,
    missing_notes,
    numbers_in,
    pose_or_none,
)

_DEPTH, _POSE = ".depth.png", ".pose.txt"


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return any(folder.glob(f"*{_DEPTH}")) and any(folder.glob(f"*{_POSE}"))


def read(folder: Path) -> list[Shot]:
    """The depth images with their poses."""
    images = [image for image in images_in(folder, ".png") if image.name.endswith(_DEPTH)]
    missing = missing_notes(
        "a .pose.txt",
        (path.name.removesuffix(_POSE) for path in folder.glob(f"*{_POSE}")),
        (image.name.removesuffix(_DEPTH) for image in images),
    )
    shots = []
    for image in images:
        stem = image.name.removesuffix(_DEPTH)
        path = folder / f"{stem}{_POSE}"
        pose = pose_or_none(numbers_in(path)) if path.is_file() else None
        has_color = (folder / f"{stem}.color.png").is_file()
        shots.append(
            Shot(
                depth=image,
                world_from_camera=pose,
                notes=("its colour image is another camera's view: left out",) * has_color
                + missing,
            )
        )
    return shots


LAYOUT = Layout(
    name="7-Scenes",
    files="`*.depth.png` and `*.pose.txt`",
    cameras="`camera-intrinsics.txt`, else 585 585 320 240",
    scale="by the values; 65535 is none",
    poses="`*.pose.txt`",
    colors="left out: another camera's view",
    recognise=recognise,
    read=read,
    usual=Intrinsics(fx=585.0, fy=585.0, cx=320.0, cy=240.0, width=640, height=480),
)
