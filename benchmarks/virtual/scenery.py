"""What is scanned together with the object: a table, a turntable, hands."""

from dataclasses import replace

import numpy as np
import trimesh

from benchmarks.virtual.bodies import Body, joined
from benchmarks.virtual.shots import Rng, Shot, Taking, Views, take
from scanweld.evaluation.primitives import cylinder
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import View
from scanweld.geometry.arrays import FloatArray
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
FIST = 1.6
"""Its radius, in radii of the arm."""
TOWARDS = -0.2
"""Slope of the arm along the line of sight: it comes from the sensor's side."""

_UP = np.array([0.0, 0.0, 1.0])


def on_table(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """The object stands on a table that fills the rest of the image."""
    table = _table(body, _UP)
    return [_take_with(body, table, view, noise, seed, k) for k, view in enumerate(views)]


def on_turntable(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """The object stands on a disc that turns with it."""
    size = principal_diameter(body.mesh.vertices)
    low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
    disc = cylinder(DISC_DIAMETERS * size, 0.02 * size)
    place = np.array([*0.5 * (low + high)[:2], low[2] - 0.01 * size])
    disc = TriangleMesh(vertices=disc.vertices + place, faces=disc.faces)
    return [_take_with(body, disc, view, noise, seed, k) for k, view in enumerate(views)]


def turned_over(half: Views) -> Views:
    """Views of the object as it stands, and then as it lies, in the frame of the object."""

    def views(body: Body, rng: Rng) -> list[View]:
        lying = TriangleMesh(vertices=body.mesh.vertices @ OVER.T, faces=body.mesh.faces)
        back = Pose(rotation=OVER.T, translation=np.zeros(3))
        after = half(Body(mesh=lying), rng)
        return half(body, rng) + [
            replace(view, world_from_sensor=back @ view.world_from_sensor) for view in after
        ]

    return views


def on_table_turned_over(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
    """The object stands on the table in the first half of the views, and lies in the second."""
    tables = [_table(body, _UP), _table(body, OVER.T @ _UP)]
    return [
        _take_with(body, tables[2 * k // len(views)], view, noise, seed, k)
        for k, view in enumerate(views)
    ]


def held_by_hand(count: int, share: float) -> Taking:
    """In some views an arm reaches into the image and holds the object, elsewhere each time.

    Args:
        count: Views with an arm, evenly among all.
        share: Of what the sensor sees there that is the arm.
    """

    def shots(body: Body, views: list[View], noise: NoiseModel, seed: int) -> list[Shot]:
        rng = np.random.default_rng([seed, 4])
        held = {k * len(views) // count for k in range(count)}
        taken = []
        for k, view in enumerate(views):
            arm = _arm(body, view, share, rng) if k in held else None
            shot = _take_with(body, arm, view, noise, seed, k)
            named = replace(shot.scan, name=f"{k} held") if arm else shot.scan
            taken.append(replace(shot, scan=named))
        return taken

    return shots


def share_beside(body: Body, scenery: TriangleMesh, view: View) -> float:
    """Share of what a view sees that is not the object."""
    both = joined(body.mesh, scenery)
    vertices = view.world_from_sensor.inverse().apply(both.vertices)
    _, face_of = render_depth(vertices, both.faces, view.camera)
    return float((face_of >= len(body.mesh.faces)).sum() / (face_of >= 0).sum())


def _take_with(
    body: Body, scenery: TriangleMesh | None, view: View, noise: NoiseModel, seed: int, number: int
) -> Shot:
    """A scan of the object and what is beside it, in a wider image."""
    mesh = body.mesh if scenery is None else joined(body.mesh, scenery)
    # The scanner's noise is a share of all that is scanned, ours one of the object.
    smaller = principal_diameter(body.mesh.vertices) / principal_diameter(mesh.vertices)
    noise = replace(noise, depth_diameters=noise.depth_diameters * smaller)
    return take(mesh, _wider(view), noise, seed, number)


def _wider(view: View) -> View:
    camera = view.camera
    more = int(ROOM * camera.width)
    camera = replace(
        camera,
        width=camera.width + 2 * more,
        height=camera.height + 2 * more,
        cx=camera.cx + more,
        cy=camera.cy + more,
    )
    return replace(view, camera=camera)


def _table(body: Body, up: FloatArray) -> TriangleMesh:
    """A large square across ``up`` (3,), under the lowest point of the object."""
    vertices = body.mesh.vertices
    half = 0.5 * TABLE_DIAMETERS * principal_diameter(vertices)
    middle = vertices.mean(axis=0)
    middle = middle + (float((vertices @ up).min()) - float(middle @ up)) * up
    across = np.cross(up, [0.0, 1.0, 0.0] if abs(up[0]) > 0.5 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    along = np.cross(up, across)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    square = np.array([middle + half * (a * across + b * along) for a, b in corners])
    return TriangleMesh(vertices=square, faces=np.array([[0, 1, 2], [0, 2, 3]]))


def _arm(body: Body, view: View, share: float, rng: Rng) -> TriangleMesh:
    """A fist at a place of the object near its outline, and an arm out of the image."""
    size = principal_diameter(body.mesh.vertices)
    sensor_from_world = view.world_from_sensor.inverse()
    depth, face_of = render_depth(
        sensor_from_world.apply(body.mesh.vertices), body.mesh.faces, view.camera
    )
    seen = view.camera.unproject_image(depth)[face_of >= 0]
    outwards = seen[:, :2] - seen[:, :2].mean(axis=0)
    outer = np.argsort(np.linalg.norm(outwards, axis=1))[-len(seen) // 3 :]
    spot = outer[rng.integers(len(outer))]
    aside = float(np.linalg.norm(outwards[spot]))
    direction = np.array([*outwards[spot] / aside, TOWARDS])
    direction /= np.hypot(1.0, TOWARDS)
    start, along = view.world_from_sensor.apply(seen[spot]), view.world_from_sensor.turn(direction)
    arms = [_arm_along(start, along, radius * size, 1.2 * size) for radius in ARM_DIAMETERS]
    off = [abs(share_beside(body, arm, _wider(view)) - share) for arm in arms]
    return arms[int(np.argmin(off))]


def _arm_along(start: FloatArray, along: FloatArray, radius: float, length: float) -> TriangleMesh:
    """An arm from a place (3,) in a direction (3,), with a fist at its beginning."""
    arm = trimesh.creation.cylinder(radius=radius, height=length)
    fist = trimesh.creation.icosphere(subdivisions=3, radius=FIST * radius)
    shift = np.array([0.0, 0.0, 0.5 * length])
    upright = joined(
        TriangleMesh(vertices=arm.vertices + shift, faces=arm.faces),
        TriangleMesh(vertices=fist.vertices, faces=fist.faces),
    )
    turn = np.asarray(trimesh.geometry.align_vectors([0, 0, 1], along))[:3, :3]
    return TriangleMesh(vertices=start + upright.vertices @ turn.T, faces=upright.faces)
