"""Small simulated videos with exact truth."""

import json
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.virtual.handheld import (
    KINECT as WIDE_KINECT,
)
from benchmarks.virtual.handheld import (
    DepthSensor,
    around,
    exact_depth,
    looking,
    measured,
    pinhole,
    room,
    table_with,
    together,
)
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.video.keyframes import keyframes
from scanweld.video.noise import depth_noise
from scanweld.video.records import Keyframe, Log, VideoFrame
from tests.scenes import small_creature

CAMERA = pinhole(160)
KINECT = replace(WIDE_KINECT, eaten=1.0, lost=0.05)
"""A fourth as wide: along edges less is lost."""
MIDDLE = np.array([0.0, 0.0, 0.85])


@lru_cache
def scene() -> TriangleMesh:
    """A room with a creature on a table, in metres."""
    return together([room(np.random.default_rng(0)), table_with(small_creature(), 0.3)])


@dataclass(frozen=True, kw_only=True)
class Video:
    """Frames, and where the camera stood for each of them."""

    frames: list[VideoFrame]
    world_from_frame: dict[str, Pose]
    mesh: TriangleMesh
    camera: Camera

    def exact(self, name: str) -> FloatArray:
        """True depth (H, W) of a frame."""
        return exact_depth(self.mesh, self.world_from_frame[name], self.camera)


def video(
    poses: list[Pose], sensor: DepthSensor = KINECT, mesh: TriangleMesh | None = None
) -> Video:
    """Frames called frame-000, frame-001, ... as a sensor sees them from poses of the camera."""
    mesh = mesh or scene()
    frames = [
        VideoFrame(
            name=f"frame-{k:03d}",
            depth=measured(exact_depth(mesh, pose, CAMERA), sensor, np.random.default_rng(k)),
        )
        for k, pose in enumerate(poses)
    ]
    named = {frame.name: pose for frame, pose in zip(frames, poses, strict=True)}
    return Video(frames=frames, world_from_frame=named, mesh=mesh, camera=CAMERA)


def way_around(count: int, turn_deg: float, begin_deg: float = 0.0) -> list[Pose]:
    """A hand-held camera's way around the table."""
    turns = begin_deg + np.linspace(0.0, turn_deg, count)
    return around(MIDDLE, 1.0, turns, np.random.default_rng(1))


def along_wall(count: int, step: float) -> list[Pose]:
    """A camera that sees nothing but a wall, and moves along it."""
    places = [np.array([0.9, step * k, 1.2]) for k in range(count)]
    return [looking(place, place + np.array([1.0, 0.05, 0.0])) for place in places]


def tracked(frames: list[VideoFrame]) -> tuple[list[Keyframe], Log]:
    """Keyframes of frames, and what became of these."""
    log = Log()
    noise = depth_noise([frame.depth for frame in frames[:3]])
    return list(keyframes(frames, CAMERA, noise, log)), log


def written(made: Video, folder: Path) -> Path:
    """The folder, with the frames as depth images in tenths of millimetres, and their camera."""
    (folder / "depth").mkdir(parents=True)
    for frame in made.frames:
        values = np.nan_to_num(frame.depth * 10_000).round().astype(np.uint16)
        Image.fromarray(values).save(folder / "depth" / f"{frame.name}.png")
    keys = ("fx", "fy", "cx", "cy", "width", "height")
    told = {key: getattr(made.camera, key) for key in keys} | {"depth_scale": 10_000}
    (folder / "intrinsics.json").write_text(json.dumps(told))
    return folder / "depth"
