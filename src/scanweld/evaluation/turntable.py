"""Whole frames of a depth camera that stands still, before it an object that is turned on a table.

What the camera does to depth is what is measured on real ones: noise that grows with the square of
the depth, steps, errors that are alike over centimetres, lost returns at edges and in shadows.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from scanweld.evaluation.primitives import box, cylinder
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import RangeScan
from scanweld.io.depth.frame import scan_of_depth

CAMERA = Camera(
    model=CameraModel.PINHOLE, width=320, height=240, fx=300, fy=300, cx=159.5, cy=119.5
)
TURNS_DEG = (0.0, 38.0, 95.0, 131.0, 187.0, 222.0, 275.0, 318.0)
DISTANCE, ELEVATION_DEG = 0.5, 30.0
SIZE = 0.16
"""Largest extent of the objects, in metres, as all lengths here."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthSensor:
    """What a depth camera does: like a D435 by default, but for waves that are five times as high.

    Attributes:
        local: Noise from pixel to pixel at 0.4 m; it grows with the square of the depth.
        quantum: Step of the depth.
        wave: Error that is alike over some 8 cm, as a share of the depth, another in each frame.
        eaten: Pixels along jumps without return, at most.
        baseline: Of a stereo pair: what only one of its cameras sees has no return.
        lost: Share of the pixels without return.
    """

    local: float = 4e-4
    quantum: float = 1e-3
    wave: float = 0.01
    eaten: float = 2.0
    baseline: float = 0.03
    lost: float = 0.03


EXACT = DepthSensor(local=0.0, quantum=0.0, wave=0.0, eaten=0.0, baseline=0.0, lost=0.0)
D435 = DepthSensor(wave=0.002)
"""Waves by which pairs of frames are off as those of a real D435 are: by 1.5 to 3 degrees."""


def joined(*meshes: TriangleMesh) -> TriangleMesh:
    """Several meshes as one, without colours."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return TriangleMesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)]),
    )


def moved(mesh: TriangleMesh, shift: tuple[float, float, float]) -> TriangleMesh:
    """A mesh moved by a vector."""
    return replace(mesh, vertices=mesh.vertices + np.array(shift))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Shots:
    """Frames and their truth.

    Attributes:
        scans: Whole frames, called 000, 001 and so on.
        masks: Which pixels (H, W) of each show the object.
        object_from_sensor: Where the camera stood as seen from the object, for each.
    """

    scans: tuple[RangeScan, ...]
    masks: tuple[BoolArray, ...]
    object_from_sensor: tuple[Pose, ...]


def turntable(
    mesh: TriangleMesh,
    turns_deg: tuple[float, ...] = TURNS_DEG,
    *,
    sensor: DepthSensor | None = None,
    camera: Camera = CAMERA,
    room: TriangleMesh | None = None,
    camera_turns_deg: float = 0.0,
    size: float = SIZE,
) -> Shots:
    """Render an object on a table, before a wall, at several turns of the object.

    Args:
        mesh: The object, of any size, z upwards.
        turns_deg: Of the object about the vertical.
        sensor: What it does to depth.
        camera: Its intrinsics.
        room: What stands still; the table, a wall and a box if not given.
        camera_turns_deg: How far the camera goes around from one frame to the next.
        size: Largest extent of the object.
    """
    sensor, room = sensor or DepthSensor(), room or standing_room()
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = np.append((low + high)[:2] / 2, low[2])
    body = (mesh.vertices - middle) * (size / (high - low).max())
    scans, masks, poses = [], [], []
    for k, turn in enumerate(turns_deg):
        around = rotation_exp(np.radians([0.0, 0.0, turn]))
        world_from_sensor = _camera_pose(camera_turns_deg * k)
        scene = joined(TriangleMesh(vertices=body @ around.T, faces=mesh.faces), room)
        points = world_from_sensor.inverse().apply(scene.vertices)
        depth, face_of = render_depth(points, scene.faces, camera)
        is_object = (face_of >= 0) & (face_of < len(mesh.faces))
        measured = disturbed(depth, is_object, camera, sensor, np.random.default_rng(k + 7))
        scans.append(scan_of_depth(f"{k:03d}", measured, camera))
        masks.append(is_object & np.isfinite(measured))
        object_from_world = Pose(rotation=around.T, translation=np.zeros(3))
        poses.append(object_from_world @ world_from_sensor)
    return Shots(scans=tuple(scans), masks=tuple(masks), object_from_sensor=tuple(poses))


def standing_room(disc: float = 0.0) -> TriangleMesh:
    """A table, a wall behind it, a box on it, and a disc under the object if it has a height."""
    table = moved(box(1.0, 1.1, 0.02), (-0.22, 0.0, -0.01 - disc))
    wall = moved(box(0.02, 3.0, 2.0), (-0.75, 0.0, 0.0))
    clutter = moved(box(0.08, 0.06, 0.1), (-0.2, 0.17, 0.05 - disc))
    flat = cylinder(0.1, disc) if disc else box(0.01, 0.01, 0.01)
    return joined(table, wall, clutter, moved(flat, (0.0, 0.0, -max(disc, 0.01) / 2 - 1e-4)))


def _camera_pose(azimuth_deg: float) -> Pose:
    """world_from_sensor: looks at a point above the table's middle, slightly from above."""
    a, e = np.radians([azimuth_deg, ELEVATION_DEG])
    back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    rotation = np.stack([right, np.cross(-back, right), -back], axis=1)
    return Pose(rotation=rotation, translation=np.array([0, 0, 0.05]) + DISTANCE * back)


def disturbed(
    depth: FloatArray,
    is_object: BoolArray,
    camera: Camera,
    sensor: DepthSensor,
    rng: np.random.Generator,
) -> FloatArray:
    """Depth (H, W) as a sensor gives it, NaN without return."""
    seen = np.isfinite(depth)
    points = camera.unproject_image(np.where(seen, depth, 1.0))
    ways = rng.normal(size=(12, 3))
    ways *= 2 * np.pi / 0.08 / rng.uniform(1, 2, (12, 1)) / np.linalg.norm(ways, axis=1)[:, None]
    waves = np.sin(points @ ways.T + rng.uniform(0, 2 * np.pi, 12)).sum(axis=-1) / np.sqrt(6)
    noise = sensor.local * (depth / 0.4) ** 2 * rng.normal(size=depth.shape)
    measured = depth * (1 + sensor.wave * waves) + noise
    if sensor.quantum:
        measured = sensor.quantum * np.round(measured / sensor.quantum)
    near = ndimage.minimum_filter(np.where(seen, depth, np.inf), 3)
    is_jump = seen & (depth > near * 1.03)
    width = sensor.eaten * _smooth(depth.shape, 8.0, rng)
    lost = np.asarray(ndimage.distance_transform_edt(~is_jump)) < width
    lost |= rng.random(depth.shape) < sensor.lost * _smooth(depth.shape, 3.0, rng) * 2
    if sensor.eaten:  # a dark part of the object
        lost |= is_object & (_smooth(depth.shape, 8.0, rng) > 0.97)
    columns = np.arange(depth.shape[1]) - camera.fx * sensor.baseline / depth
    columns = np.where(seen, columns, np.inf)
    lost |= columns > np.minimum.accumulate(columns[:, ::-1], axis=1)[:, ::-1]
    return np.where(seen & ~lost, measured, np.nan)


def _smooth(shape: tuple[int, ...], width: float, rng: np.random.Generator) -> FloatArray:
    """Shares from 0 to 1 that change over so many pixels."""
    field = ndimage.gaussian_filter(rng.normal(size=shape), width)
    return np.argsort(np.argsort(field, axis=None)).reshape(shape) / field.size
