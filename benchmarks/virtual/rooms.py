"""What does not move with the object: a room that stands still around it, a lid that is opened."""

from dataclasses import replace

import numpy as np

from benchmarks.virtual.bodies import Body, Rng, middle, shifted
from benchmarks.virtual.scenery import UP, pixels_of, take_beside
from benchmarks.virtual.shots import JITTER_DEG, Shot
from scanweld.evaluation.primitives import box, cylinder
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.turntable import joined
from scanweld.evaluation.views import View, camera_axes, view_along
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.scan import principal_diameter

WIDTH, HEIGHT, FOCAL = 320, 240, 230.0
"""Pixels of a standing depth camera of common lens."""
AIM, OFF_AXIS = 0.08, 0.1
"""The object is off the middle of the image by a share of its width, and off the axis about which
it turns by a share of its diameter, at most."""
TABLE, WALL, WALL_SIZE, WALL_TURN_DEG = (1.5, 2.5), (1.6, 3.5), 8.0, 25.0
"""In diameters, half a table's width, how far behind the object the wall is, and half its width;
how far the wall is turned from across the line of sight, at most."""
NUM_FOLDS, FOLD, FOLD_LENGTH = 6, (0.1, 0.8), (0.8, 3.0)
"""Waves that are averaged to the folds of what hangs on the wall, their height and length."""
CLUTTER, CLUTTER_AWAY, CLUTTER_SIZE, CLUTTER_ASIDE_DEG = (3, 8), (1.0, 1.8), (0.1, 0.4), 120.0
"""Things on the table: how many, how far from the object and how wide in its diameters, and how
far aside of straight behind it."""
CELLS = 80
"""Squares along each side of a plane: those beside the camera are left out of its image."""
LID, LID_SHARE, OPEN_DEG = 0.04, 0.7, (40.0, 100.0)
"""Thickness of a lid in diameters, its share of the object's width and depth, how far it opens."""


def turned_before_sensor(
    body: Body,
    rng: Rng,
    *,
    count: int,
    pixels: tuple[float, float] = (70.0, 110.0),
    elevation_deg: tuple[float, float] = (20.0, 45.0),
) -> list[View]:
    """One standing camera's view of an object that is turned in steps, in the object's frame."""
    across, elevation = rng.uniform(*pixels), rng.uniform(*elevation_deg)
    size = principal_diameter(body.mesh.vertices)
    axes, far = camera_axes(0.0, elevation, 0.0), FOCAL / across
    view = view_along(body.mesh, axes, pixels=across, distance_diameters=far)
    cx, cy = (0.5 * np.array([WIDTH, HEIGHT]) + WIDTH * rng.uniform(-AIM, AIM, size=2)).tolist()
    camera = replace(view.camera, width=WIDTH, height=HEIGHT, cx=cx, cy=cy)
    centre = middle(body.mesh) + size * np.append(rng.uniform(-OFF_AXIS, OFF_AXIS, size=2), 0.0)
    views = []
    for turn_deg in 360.0 / count * np.arange(count) + rng.uniform(-JITTER_DEG, JITTER_DEG, count):
        turn = rotation_exp(np.array([0.0, 0.0, np.radians(turn_deg)]))
        about = Pose(rotation=turn, translation=centre - turn @ centre)
        views.append(View(camera=camera, world_from_sensor=about @ view.world_from_sensor))
    return views


def in_standing_room(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """Whole frames: the object on a table before a wall, which stand still as the sensor does."""
    first = views[0].world_from_sensor
    room = _room(body, first, np.random.default_rng([seed, 8]))
    moved = [view.world_from_sensor @ first.inverse() for view in views]
    rooms = [TriangleMesh(vertices=m.apply(room.vertices), faces=room.faces) for m in moved]
    shots = take_beside(body, rooms, views, noise, seed, frame=lambda view: view)
    masks = [pixels_of(body, *beside)[0] for beside in zip(rooms, views, strict=True)]
    return [replace(shot, mask=mask) for shot, mask in zip(shots, masks, strict=True)]


def with_lid_opened(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """A lid lies on the object in the first half of the views, and stands open in the second."""
    rng = np.random.default_rng([seed, 9])
    angles = np.radians([0.0, rng.uniform(*OPEN_DEG)])
    lids = [_lid(body, angle) for angle in angles]
    on_top = [lids[2 * k // len(views)] for k in range(len(views))]
    return take_beside(body, on_top, views, noise, seed)


def _room(body: Body, world_from_sensor: Pose, rng: Rng) -> TriangleMesh:
    """Table, wall and things on the table, as they stand while the first frame is taken."""
    size, centre = principal_diameter(body.mesh.vertices), middle(body.mesh)
    ground = np.array([*centre[:2], body.mesh.vertices[:, 2].min()])
    ahead = world_from_sensor.rotation[:, 2] * [1.0, 1.0, 0.0]
    ahead = ahead / np.linalg.norm(ahead)
    parts = [shifted(_plane(size * rng.uniform(*TABLE)), ground)]
    turn = np.radians(rng.uniform(-WALL_TURN_DEG, WALL_TURN_DEG))
    wall = _plane(WALL_SIZE * size)
    folds = _folds(wall.vertices[:, :2] / size, rng)
    flat = np.column_stack([size * folds, wall.vertices[:, :2]])
    upright = flat @ _towards(ahead, turn)
    behind = ground + size * rng.uniform(*WALL) * ahead
    parts.append(TriangleMesh(vertices=upright + behind, faces=wall.faces))
    for _ in range(int(rng.integers(*CLUTTER, endpoint=True))):
        aside = np.radians(rng.uniform(-CLUTTER_ASIDE_DEG, CLUTTER_ASIDE_DEG))
        way = np.array([1.0, 0.0, 0.0]) @ _towards(ahead, aside)
        place = ground + size * rng.uniform(*CLUTTER_AWAY) * way
        parts.append(shifted(_thing(size, rng), place))
    return joined(*parts)


def _folds(places: FloatArray, rng: Rng) -> FloatArray:
    """How far (N,) a curtain stands out at places (N, 2), all in diameters of the object."""
    turns, lengths = (
        rng.uniform(0, np.pi, size=NUM_FOLDS),
        rng.uniform(*FOLD_LENGTH, size=NUM_FOLDS),
    )
    across = 2 * np.pi / lengths * np.array([np.cos(turns), np.sin(turns)])
    waves = np.sin(places @ across + rng.uniform(0, 2 * np.pi, size=NUM_FOLDS))
    return rng.uniform(*FOLD) * waves.mean(axis=1)


def _thing(size: float, rng: Rng) -> TriangleMesh:
    """A box or a tin of any size that stands on the ground."""
    x, y, z = size * rng.uniform(*CLUTTER_SIZE, size=3) * [1.0, 1.0, 2.0]
    mesh = box(x, y, z) if rng.random() < 0.5 else cylinder(0.5 * x, z)
    turned = mesh.vertices @ _towards(np.array([1.0, 0.0, 0.0]), rng.uniform(0, 2 * np.pi))
    return TriangleMesh(vertices=turned + 0.5 * z * UP, faces=mesh.faces)


def _lid(body: Body, angle: float) -> TriangleMesh:
    """A plate on top of the object that is turned about one of its edges, radians."""
    low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
    width, depth, _ = LID_SHARE * (high - low)
    thickness = LID * principal_diameter(body.mesh.vertices)
    plate = box(width, depth, thickness)
    about_hinge = plate.vertices + 0.5 * np.array([width, depth, thickness])
    turned = about_hinge @ rotation_exp(np.array([angle, 0.0, 0.0])).T
    hinge = np.append(0.5 * (low + high)[:2] - 0.5 * np.array([width, depth]), high[2])
    return TriangleMesh(vertices=turned + hinge, faces=plate.faces)


def _plane(half: float) -> TriangleMesh:
    """A square across z about the origin, in cells."""
    along = np.linspace(-half, half, CELLS + 1)
    x, y = np.meshgrid(along, along)
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    k = np.arange((CELLS + 1) ** 2).reshape(CELLS + 1, CELLS + 1)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[:-1, 1:], k[1:, :-1], k[1:, 1:]))
    faces = np.concatenate([np.stack(f, axis=1) for f in ((a, b, d), (a, d, c))])
    return TriangleMesh(vertices=vertices, faces=faces)


def _towards(ahead: FloatArray, turn: float) -> FloatArray:
    """Rotation about z, for rows, of x to a horizontal direction (3,), turned by radians more."""
    angle = np.arctan2(ahead[1], ahead[0]) + turn
    return rotation_exp(np.array([0.0, 0.0, angle])).T
