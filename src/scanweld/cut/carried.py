"""What a camera that was carried around it looked at, by where it stood for each frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.cut.frames import Frames
from scanweld.cut.pieces import piece_around, pieces_of
from scanweld.cut.smoothing import Noise, noise_of, uneven
from scanweld.cut.standing import Standing
from scanweld.cut.table import Plane, above, supporting_planes
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.pose import Pose

MIN_AXES = 3
"""Frames whose optical axes must meet, at least."""
WIDE_DEG = 20.0
"""Least angle between two of the axes: what looks one way meets anywhere."""
MAX_MISS = 0.15
"""Of the meeting point by an axis, as a share of the camera's distance from it: hands shake."""
MOST_AXES = 0.8
"""Share of the axes that must pass by the point so closely."""
AROUND = 0.4
"""Radius about the meeting point within which the object lies, as a share of that distance: what
is larger fills the image of the usual camera, from side to side."""
MAX_POINTS = 5_000
"""Points about the meeting point that the table is looked for under, at most."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Stood:
    """Where a camera stood for its frames, about.

    Attributes:
        poses: component_from_scan, by the scans' names.
        components: Names of those that are of one frame.
    """

    poses: Mapping[str, Pose]
    components: Sequence[Sequence[str]]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Meeting:
    """What all optical axes pass by.

    Attributes:
        places: (3,) of it in the frame of each scan, by name; of those without a pose too, on the
            optical axis.
        distance: Median of the cameras from it.
    """

    places: Mapping[str, FloatArray]
    distance: float


def meeting_of(frames: Frames, stood: Stood) -> Meeting | str:
    """Where the optical axes of frames meet, or why they do not.

    Args:
        frames: Of a camera that moved.
        stood: Where, for some of them.
    """
    names = [scan.name for scan in frames.scans]
    seen = {
        scan.name: stood.poses[scan.name] @ (scan.scan_from_sensor or Pose.identity())
        for scan in frames.scans
        if scan.name in stood.poses
    }
    places, widest = dict[str, FloatArray](), 0.0
    for component in stood.components:
        of = {name: seen[name] for name in component if name in seen}
        if len(of) < MIN_AXES:
            continue
        ahead = np.array([pose.rotation[:, 2] for pose in of.values()])
        widest = max(widest, float(np.degrees(np.arccos(np.clip((ahead @ ahead.T).min(), -1, 1)))))
        point = _nearest_to_lines(np.array([pose.translation for pose in of.values()]), ahead)
        places |= {name: pose.inverse().apply(point) for name, pose in of.items()}
    if 2 * len(places) <= len(names):
        return "the camera moved, and where it stood is not known of most of the frames"
    if widest < WIDE_DEG:
        return "the camera moved, but looked one way: what it looked at is not known"
    own = np.array(list(places.values()))
    missed = np.hypot(own[:, 0], own[:, 1]) > MAX_MISS * own[:, 2]  # so is what is behind it
    if missed.mean() > 1 - MOST_AXES:
        return "the camera moved, and did not look at one place: all that it saw is kept"
    distance = float(np.median(own[:, 2]))
    ahead = np.array([0.0, 0.0, distance])
    return Meeting(places={name: places.get(name, ahead) for name in names}, distance=distance)


def _nearest_to_lines(origins: FloatArray, directions: FloatArray) -> FloatArray:
    """The point (3,) nearest to lines through origins (N, 3) along unit directions (N, 3)."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    normal, right = across.sum(axis=0), (across @ origins[:, :, None]).sum(axis=0)[:, 0]
    return np.linalg.lstsq(normal, right, rcond=None)[0].astype(np.float64)


def looked_at(frames: Frames, meeting: Meeting) -> list[IntArray] | str:
    """Flat indices of the pixels of the object in each frame; or why they cannot be told.

    Each frame is cut by itself: its own table, bent as it bends it, goes; of the pieces that are
    left, the one about the meeting point stays.
    """
    objects, tables, about = [], 0, []
    away, far = zip(*(uneven(frames.depth(k)) for k in range(len(frames.scans))), strict=True)
    noise = noise_of(np.concatenate(away), np.concatenate(far))
    for k, scan in enumerate(frames.scans):
        depth, place = frames.depth(k), meeting.places[scan.name]
        radius = AROUND * meeting.distance
        still = _still(depth, noise)
        planes = _tables(still, place, radius, frames)
        tables += bool(planes)
        off = np.zeros(depth.shape, dtype=bool)
        is_above = above(depth, off, planes, still, frames.camera)
        numbers = pieces_of(depth, is_above, noise, frames.camera)
        numbers = np.where(is_above, numbers, -1)
        objects.append(piece_around(place, radius, depth, numbers, frames.camera))
        if len(objects[-1]):
            about.append(_is_about(place, objects[-1], frames.camera))
    if 2 * tables <= len(objects):
        return "the camera moved, and no table is seen under what it looked at"
    if np.mean(about or [False]) < MOST_AXES:
        return "the camera moved, and no one thing stands where it looked"
    return objects


def _is_about(place: FloatArray, pixels: IntArray, camera: Camera) -> bool:
    """Whether the pixels of a piece lie on all sides of a place (3,)."""
    (at,), _ = camera.project(place[None])
    seen = np.stack([pixels % camera.width, pixels // camera.width], axis=1)
    return bool((seen.min(axis=0) <= at).all() and (at <= seen.max(axis=0)).all())


def _still(depth: FloatArray, noise: Noise) -> Standing:
    """One frame as what stands still."""
    return Standing(usual=depth, far=depth, is_settled=np.isfinite(depth), noise=noise)


def _tables(still: Standing, place: FloatArray, radius: float, frames: Frames) -> list[Plane]:
    points = frames.camera.unproject_image(still.usual)[still.is_settled]
    near = points[np.linalg.norm(points - place, axis=1) <= radius]
    if not len(near):
        return []
    return supporting_planes(still, near[:: max(1, len(near) // MAX_POINTS)], frames.camera)
