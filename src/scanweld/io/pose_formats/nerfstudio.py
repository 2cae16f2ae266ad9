"""nerfstudio's ``transforms.json``: cameras in OpenGL axes (x right, y *up*, z *back*).

As in nerfstudio's data conventions: ``transform_matrix`` takes the camera to the world, intrinsics
may stand in each frame. Its rays go through pixel + 0.5 (``Cameras.get_image_coords``), half a
pixel from scanweld's. No images are written: the paths are those that pictures would have.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.io.local_origin import shifted
from scanweld.io.matrices import from_opengl
from scanweld.io.pose_formats.colmap import IMAGE_SUFFIX, PIXEL_CENTRE
from scanweld.io.pose_formats.records import (
    Entry,
    Frame,
    PosedScan,
    PoseEntries,
    attempt,
    parse_pose,
)
from scanweld.io.poses import load_json

TITLE = "nerfstudio"
_FOLDER = "images/"
_SHIFT = "shift"
"""Our key of the local origin that the world is about where it lies far off."""


def recognise_json(content: dict[str, Any]) -> bool:
    """Whether the JSON looks like this format."""
    return isinstance(content.get("frames"), list)


def read(path: Path, text: str) -> PoseEntries:
    """The poses of all frames.

    Raises:
        ReadError: If a frame has no name, or its matrix is not a rigid motion.
    """
    content = load_json(path, text)
    frames, shift = content.get("frames"), content.get(_SHIFT, [0.0, 0.0, 0.0])
    if not isinstance(frames, list):
        raise ReadError(f"{path}: has no list of frames; write it anew")
    if not isinstance(shift, list) or not _are_three_numbers(shift):
        raise ReadError(f"{path}: its {_SHIFT} is not three numbers; correct or remove it")
    origin = np.array(shift, dtype=np.float64)
    entries = tuple(_entry(path, k, frame, origin) for k, frame in enumerate(frames))
    return PoseEntries(title=TITLE, frame=Frame.SENSOR, entries=entries)


def write(scans: Sequence[PosedScan]) -> dict[str, str]:
    """The file's text by its name.

    Raises:
        InputError: If a sensor is no pinhole.
    """
    frames = [_frame(scan) for scan in scans]
    content = {"camera_model": "OPENCV", "frames": frames}
    if scans and scans[0].shift is not None:
        content[_SHIFT] = scans[0].shift.tolist()
    return {"transforms.json": json.dumps(content, indent=1) + "\n"}


def _frame(scan: PosedScan) -> dict[str, Any]:
    camera = scan.pinhole(TITLE)
    world_from_opengl = from_opengl(scan.world_from_sensor())
    return {
        "file_path": f"{_FOLDER}{scan.name}{IMAGE_SUFFIX}",
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx + PIXEL_CENTRE,
        "cy": camera.cy + PIXEL_CENTRE,
        "w": camera.width,
        "h": camera.height,
        "transform_matrix": (world_from_opengl.matrix() + 0.0).tolist(),
    }


def _are_three_numbers(values: Sequence[Any]) -> bool:
    largest = float(np.finfo(np.float64).max)
    return len(values) == 3 and all(type(x) in (int, float) and abs(x) < largest for x in values)


def _entry(path: Path, k: int, frame: Any, origin: FloatArray) -> Entry:
    name = frame.get("file_path") if isinstance(frame, dict) else None
    rows = frame.get("transform_matrix") if isinstance(frame, dict) else None
    if not isinstance(name, str) or not isinstance(rows, list):
        raise ReadError(f"{path}: frame {k}: lacks file_path or transform_matrix; write it anew")
    pose = attempt(_pose, path, name, rows, origin)
    return name.removeprefix("./").removeprefix(_FOLDER), pose


def _pose(path: Path, name: str, rows: Sequence[Any], origin: FloatArray) -> Pose:
    flat = [x for row in rows for x in (row if isinstance(row, list) else [row])]
    if not all(type(x) in (int, float) for x in flat):
        raise ReadError(f"{path}: {name}: the matrix holds what is no number; write it anew")
    return shifted(from_opengl(parse_pose(path, name, flat)), origin)
