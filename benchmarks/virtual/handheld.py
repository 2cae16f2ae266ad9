"""A depth camera held in the hand: its way around an object or through a room, and its frames.

All lengths are in metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from benchmarks.virtual.bodies import Rng, shifted
from scanweld.evaluation.primitives import box, cylinder, sphere
from scanweld.evaluation.turntable import joined
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.rasterize import render_depth

UP = np.array([0.0, 0.0, 1.0])
CELL = 0.12
"""Edge of the squares that walls are made of: those beside the camera are left out of its image."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthSensor:
    """What a depth camera does to depths.

    Attributes:
        noise: Standard deviation of single depths: constant, and by the square of the depth.
        quantum: Step of the depths, likewise.
        wave: Error that is alike over some pixels and the same in all frames, share of the depth.
        lost: Share of the pixels without return, in patches.
        eaten: Pixels beside depth jumps without return, at most.
    """

    noise: tuple[float, float] = (0.0, 0.0)
    quantum: tuple[float, float] = (0.0, 0.0)
    wave: float = 0.0
    lost: float = 0.0
    eaten: float = 0.0


EXACT = DepthSensor()
KINECT = DepthSensor(noise=(0.0, 1.5e-3), quantum=(0.0, 2.9e-3), lost=0.08, eaten=3.0)
"""Noise and steps as measured on a Kinect of the first kind."""
D435 = DepthSensor(noise=(2e-4, 1.2e-3), quantum=(1e-3, 0.0), wave=3e-3, lost=0.05, eaten=3.0)


def pinhole(width: int, fov_deg: float = 57.0) -> Camera:
    """A camera of a depth sensor's usual lens, a quarter wider than high."""
    focal = 0.5 * width / np.tan(np.radians(0.5 * fov_deg))
    height = 3 * width // 4
    return Camera(
        model=CameraModel.PINHOLE,
        width=width,
        height=height,
        fx=focal,
        fy=focal,
        cx=0.5 * (width - 1),
        cy=0.5 * (height - 1),
    )


def looking(place: FloatArray, at: FloatArray, roll: float = 0.0) -> Pose:
    """world_from_camera at a place (3,) that looks at another (3,), upright but for a roll."""
    ahead = (at - place) / np.linalg.norm(at - place)
    right = np.cross(ahead, UP) / np.linalg.norm(np.cross(ahead, UP))
    upright = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    return Pose(rotation=upright @ rotation_exp(np.array([0, 0, roll])), translation=place)


def around(
    middle: FloatArray, distance: float, turns_deg: FloatArray, rng: Rng, *, height: float = 0.6
) -> list[Pose]:
    """world_from_camera of a hand that goes around a point (3,), up and down, and shakes.

    Args:
        middle: What it looks at.
        distance: From it, which changes by a tenth.
        turns_deg: (N,) where around it each frame is taken.
        rng: Of its ups and downs, and of its shaking.
        height: Above the middle, as a share of the distance; it changes by a third.
    """
    count = len(turns_deg)
    sway = _sway(count, 6, max(count / 6, 12.0), rng)
    poses = []
    for turn, (far, up, *off, roll) in zip(np.radians(turns_deg), sway, strict=True):
        away = distance * (1 + 0.1 * far)
        rise = np.arctan(height * (1 + 0.33 * up))
        way = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
        poses.append(
            looking(middle + away * way, middle + 0.04 * distance * np.array(off), 0.1 * roll)
        )
    return poses


def through(places: FloatArray, targets: FloatArray, count: int, rng: Rng) -> list[Pose]:
    """world_from_camera of a hand that goes by places (K, 3) and looks at targets (K, 3)."""
    share = np.linspace(0, len(places) - 1, count)
    between = [
        np.stack([np.interp(share, np.arange(len(stops)), axis) for axis in stops.T], axis=1)
        for stops in (places, targets)
    ]
    width = count / (2 * len(places))
    smooth = [ndimage.gaussian_filter1d(way, width, axis=0, mode="nearest") for way in between]
    sway = 0.02 * _sway(count, 7, 15.0, rng)
    return [
        looking(place + off[:3], target + off[3:6], off[6])
        for place, target, off in zip(*smooth, sway, strict=True)
    ]


def _sway(count: int, width: int, frames: float, rng: Rng) -> FloatArray:
    """Smooth motions (count, width) about 0 that change over so many frames."""
    steps = rng.normal(size=(count + int(8 * frames), width))
    smooth = ndimage.gaussian_filter1d(steps, frames, axis=0)[int(4 * frames) :][:count]
    return smooth / max(float(smooth.std()), 1e-12)


def room(rng: Rng, size: tuple[float, float, float] = (4.0, 3.5, 2.5)) -> TriangleMesh:
    """Walls, floor and ceiling, and things along the walls; the floor's middle is the origin."""
    x, y, z = size
    sides = [
        _wall((x, y), UP, np.zeros(3)),
        _wall((x, y), -UP, z * UP),
        _wall((y, z), np.array([1.0, 0, 0]), np.array([-x / 2, 0, z / 2])),
        _wall((y, z), np.array([-1.0, 0, 0]), np.array([x / 2, 0, z / 2])),
        _wall((x, z), np.array([0, 1.0, 0]), np.array([0, -y / 2, z / 2])),
        _wall((x, z), np.array([0, -1.0, 0]), np.array([0, y / 2, z / 2])),
    ]
    for k in range(14):
        turn = 2 * np.pi * k / 14 + rng.uniform(-0.1, 0.1)
        a, b, c = rng.uniform([0.2, 0.2, 0.3], [0.5, 0.5, 1.8])
        thing = (box(a, b, c), cylinder(a / 2, c), sphere(a / 1.5))[k % 3]
        spin = rotation_exp(rng.uniform(0, np.pi) * UP)
        place = np.array([(x / 2 - 0.3) * np.cos(turn), (y / 2 - 0.3) * np.sin(turn), c / 2])
        sides.append(shifted(replace(thing, vertices=thing.vertices @ spin.T), place))
    return joined(*sides)


def table_with(body: TriangleMesh, size: float, height: float = 0.75) -> TriangleMesh:
    """A table at the origin with an object on it, whose largest extent is given."""
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    middle = np.append(0.5 * (low + high)[:2], low[2])
    placed = (body.vertices - middle) * (size / (high - low).max()) + height * UP
    top = _wall((1.2, 0.8), UP, height * UP)
    return joined(TriangleMesh(vertices=placed, faces=body.faces), top)


def together(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Several meshes as one."""
    return joined(*meshes)


def exact_depth(scene: TriangleMesh, world_from_camera: Pose, camera: Camera) -> FloatArray:
    """Depth (H, W) of a scene, NaN where there is nothing."""
    points = world_from_camera.inverse().apply(scene.vertices)
    return render_depth(points, scene.faces, camera)[0]


def measured(depth: FloatArray, sensor: DepthSensor, rng: Rng, seed: int = 0) -> FloatArray:
    """Depth (H, W) as a sensor gives it.

    Args:
        depth: As it is.
        sensor: What it does.
        rng: Of what differs from frame to frame.
        seed: Of what is the same in all frames.
    """
    seen, square = np.isfinite(depth), depth * depth
    sigma = np.hypot(sensor.noise[0], sensor.noise[1] * square)
    wave = sensor.wave * _patchy(depth.shape, 12.0, np.random.default_rng(seed))
    noisy = depth * (1 + wave) + sigma * rng.normal(size=depth.shape)
    step = sensor.quantum[0] + sensor.quantum[1] * square
    if any(sensor.quantum):
        noisy = step * np.round(noisy / step)
    lost = ~seen
    if sensor.lost:
        lost |= _patchy(depth.shape, 1.5, rng) > np.sqrt(2) * _quantile(sensor.lost)
    if sensor.eaten:
        bend = np.abs(ndimage.laplace(np.where(seen, depth, 0.0)))
        away = np.asarray(ndimage.distance_transform_edt(~(bend > 0.03 * np.where(seen, depth, 1))))
        lost |= away < sensor.eaten * (0.5 + 0.25 * _patchy(depth.shape, 6.0, rng))
    return np.where(lost, np.nan, noisy)


def _patchy(shape: tuple[int, ...], pixels: float, rng: Rng) -> FloatArray:
    """A field (H, W) of standard deviation 1 that changes over so many pixels."""
    field = ndimage.gaussian_filter(rng.normal(size=shape), pixels)
    return field / field.std()


def _quantile(share: float) -> float:
    """How many standard deviations a normal value exceeds in a share of the cases, over sqrt 2."""
    from scipy.special import erfcinv

    return float(erfcinv(2 * share))


def _wall(size: tuple[float, float], inwards: FloatArray, middle: FloatArray) -> TriangleMesh:
    """A rectangle about a point (3,), in squares that face along a vector (3,)."""
    across = np.array([0.0, 1.0, 0.0]) if abs(inwards[0]) > 0.5 else np.array([1.0, 0.0, 0.0])
    along = np.cross(inwards, across)
    if abs(inwards[2]) > 0.5:
        across, along = np.array([1.0, 0.0, 0.0]), np.array([0.0, np.sign(inwards[2]), 0.0])
    rows, columns = (max(2, round(length / CELL)) for length in size)
    s, t = np.meshgrid(
        np.linspace(-0.5, 0.5, rows + 1), np.linspace(-0.5, 0.5, columns + 1), indexing="ij"
    )
    vertices = middle + size[0] * s[..., None] * across + size[1] * t[..., None] * along
    k = np.arange(s.size).reshape(s.shape)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[1:, :-1], k[:-1, 1:], k[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    return TriangleMesh(vertices=vertices.reshape(-1, 3), faces=faces)
