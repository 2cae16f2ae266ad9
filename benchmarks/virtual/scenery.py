"""What is scanned together with the object: a table, a turntable, hands."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import trimesh

from benchmarks.virtual.bodies import Body, Rng, middle, shifted
from benchmarks.virtual.shots import Shot, Views, take
from scanweld.evaluation.primitives import cylinder
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.turntable import joined
from scanweld.evaluation.views import View
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import principal_diameter

ROOM = 0.15
"""The sensor's image is wider than the object by this share on each side."""
TABLE_DIAMETERS = 3.5
DISC_DIAMETERS = 0.55
"""Radius of the turntable."""
OVER = rotation_exp(np.radians(100.0) * np.array([0.94, 0.34, 0.0]))
"""How the object is turned over by hand."""
ARM_DIAMETERS = np.geomspace(0.02, 0.14, 9)
"""Radii of arms to choose from."""
NUM_HELD, HAND = 2, 0.1
"""Views with an arm, evenly among all, and the share of what the sensor sees there that it is."""
FIST = 1.6
"""Its radius, in radii of the arm."""
TOWARDS = -0.2
"""Slope of the arm along the line of sight: it comes from the sensor's side."""
UP = np.array([0.0, 0.0, 1.0])


def on_table(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """The object stands on a table that fills the rest of the image."""
    return take_beside(body, [_table(body, UP)] * len(views), views, noise, seed)


def on_turntable(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """The object stands on a disc that turns with it."""
    size = principal_diameter(body.mesh.vertices)
    low = body.mesh.vertices[:, 2].min()
    place = np.array([*middle(body.mesh)[:2], low - 0.01 * size])
    disc = shifted(cylinder(DISC_DIAMETERS * size, 0.02 * size), place)
    return take_beside(body, [disc] * len(views), views, noise, seed)


def turned_over(body: Body, rng: Rng, *, half: Views) -> list[View]:
    """Views of the object as it stands, and then as it lies, in the frame of the object."""
    lying = TriangleMesh(vertices=body.mesh.vertices @ OVER.T, faces=body.mesh.faces)
    back = Pose(rotation=OVER.T, translation=np.zeros(3))
    after = half(Body(lying), rng)
    return half(body, rng) + [
        replace(view, world_from_sensor=back @ view.world_from_sensor) for view in after
    ]


def on_table_turned_over(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """The object stands on the table in the first half of the views, and lies in the second."""
    tables = [_table(body, UP), _table(body, OVER.T @ UP)]
    under = [tables[2 * k // len(views)] for k in range(len(views))]
    return take_beside(body, under, views, noise, seed)


def held_by_hand(
    body: Body, views: list[View], noise: NoiseModel, seed: int, num_held: int = NUM_HELD
) -> list[Shot]:
    """In some views an arm reaches into the image and holds the object, elsewhere each time."""
    rng = np.random.default_rng([seed, 4])
    held = {k * len(views) // num_held for k in range(num_held)}
    arms = [_arm(body, view, rng) if k in held else None for k, view in enumerate(views)]
    shots = take_beside(body, arms, views, noise, seed)
    return [s.named(f"{k} held") if k in held else s for k, s in enumerate(shots)]


def wider(view: View) -> View:
    """The same view in a wider image."""
    c, more = view.camera, int(ROOM * view.camera.width)
    size = {"width": c.width + 2 * more, "height": c.height + 2 * more}
    return replace(view, camera=replace(c, **size, cx=c.cx + more, cy=c.cy + more))


def take_beside(
    body: Body,
    sceneries: Sequence[TriangleMesh | None],
    views: list[View],
    noise: NoiseModel,
    seed: int,
    frame: Callable[[View], View] = wider,
) -> list[Shot]:
    """Scans of the object and, for each view, what is beside it, in wider images or as said."""
    size, shots = principal_diameter(body.mesh.vertices), []
    for k, (scenery, view) in enumerate(zip(sceneries, views, strict=True)):
        mesh = body.mesh if scenery is None else joined(body.mesh, scenery)
        # The scanner's noise is a share of all that is scanned, ours one of the object.
        smaller = size / principal_diameter(mesh.vertices)
        less = replace(noise, depth_diameters=noise.depth_diameters * smaller)
        shots.append(take(mesh, frame(view), less, seed, k))
    return shots


def pixels_of(body: Body, beside: TriangleMesh, view: View) -> tuple[BoolArray, BoolArray]:
    """Pixels (H, W) in which a view sees the body, and those in which it sees what is beside it."""
    both, count = joined(body.mesh, beside), len(body.mesh.faces)
    vertices = view.world_from_sensor.inverse().apply(both.vertices)
    face_of = render_depth(vertices, both.faces, view.camera)[1]
    return (face_of >= 0) & (face_of < count), face_of >= count


def _share_beside(body: Body, scenery: TriangleMesh, view: View) -> float:
    """Share of what a view sees that is not the object."""
    own, other = pixels_of(body, scenery, view)
    return float(other.sum() / (own | other).sum())


def _table(body: Body, up: FloatArray) -> TriangleMesh:
    """A large square across ``up`` (3,), under the lowest point of the object."""
    vertices = body.mesh.vertices
    half = 0.5 * TABLE_DIAMETERS * principal_diameter(vertices)
    centre = vertices.mean(axis=0)
    centre = centre + (float((vertices @ up).min()) - float(centre @ up)) * up
    across = np.cross(up, [0.0, 1.0, 0.0] if abs(up[0]) > 0.5 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    along = np.cross(up, across)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    square = np.array([centre + half * (a * across + b * along) for a, b in corners])
    return TriangleMesh(vertices=square, faces=np.array([[0, 1, 2], [0, 2, 3]]))


def _arm(body: Body, view: View, rng: Rng) -> TriangleMesh:
    """A fist at a place of the object near its outline, and an arm out of the image."""
    size = principal_diameter(body.mesh.vertices)
    vertices = view.world_from_sensor.inverse().apply(body.mesh.vertices)
    depth, face_of = render_depth(vertices, body.mesh.faces, view.camera)
    seen = view.camera.unproject_image(depth)[face_of >= 0]
    outwards = seen[:, :2] - seen[:, :2].mean(axis=0)
    outer = np.argsort(np.linalg.norm(outwards, axis=1))[-len(seen) // 3 :]
    spot = outer[rng.integers(len(outer))]
    aside = float(np.linalg.norm(outwards[spot]))
    direction = np.array([*outwards[spot] / aside, TOWARDS]) / np.hypot(1.0, TOWARDS)
    start, along = view.world_from_sensor.apply(seen[spot]), view.world_from_sensor.turn(direction)
    arms = [_arm_along(start, along, radius * size, 1.2 * size) for radius in ARM_DIAMETERS]
    off = [abs(_share_beside(body, arm, wider(view)) - HAND) for arm in arms]
    return arms[int(np.argmin(off))]


def _arm_along(start: FloatArray, along: FloatArray, radius: float, length: float) -> TriangleMesh:
    """An arm from a place (3,) in a direction (3,), with a fist at its beginning."""
    arm = trimesh.creation.cylinder(radius=radius, height=length)
    fist = trimesh.creation.icosphere(subdivisions=3, radius=FIST * radius)
    upright = joined(
        TriangleMesh(vertices=arm.vertices + 0.5 * length * UP, faces=arm.faces),
        TriangleMesh(vertices=fist.vertices, faces=fist.faces),
    )
    turn = np.asarray(trimesh.geometry.align_vectors([0, 0, 1], along))[:3, :3]
    return TriangleMesh(vertices=start + upright.vertices @ turn.T, faces=upright.faces)
