"""APC vision toolbox.

``cam.info.txt`` has the intrinsics of two cameras and the matrices world from camera; depths are
aligned to colours, and their lowest three bits are their highest.
"""

import re
from pathlib import Path

from scanweld.io.depth.layouts.records import Layout, Shot, images_in, pose_or_none
from scanweld.io.poses import read_text

_POSE = re.compile(r"camera pose\) for (\S+)\s*\n\s*((?:[-+.\deE]+\s+){15}[-+.\deE]+)")


def recognise(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "cam.info.txt").is_file() and any(folder.glob("*.depth.png"))


def read(folder: Path) -> list[Shot]:
    """The depth images with their colours and poses."""
    poses = {
        name: pose_or_none([float(word) for word in numbers.split()])
        for name, numbers in _POSE.findall(read_text(folder / "cam.info.txt"))
    }
    shots = []
    for image in images_in(folder, ".png"):
        if image.name.endswith(".depth.png"):
            stem = image.name.removesuffix(".depth.png")
            color = folder / f"{stem}.color.png"
            color = color if color.is_file() else None
            shots.append(Shot(depth=image, color=color, world_from_camera=poses.get(stem)))
    return shots


LAYOUT = Layout(
    name="APC",
    files="`*.depth.png` and `cam.info.txt`",
    cameras="that file",
    scale="10,000, bits turned back",
    poses="that file",
    colors="`*.color.png`",
    recognise=recognise,
    read=read,
    per_meter=10_000.0,
)
