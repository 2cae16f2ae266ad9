"""Plain objects that slide or turn upon themselves: what must not be put together wrongly."""

from collections.abc import Callable

import numpy as np
import trimesh

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh, compact


def sphere(radius: float = 50.0) -> TriangleMesh:
    """A ball about the origin."""
    return _converted(trimesh.creation.icosphere(subdivisions=5, radius=radius))


def box(x: float = 60.0, y: float = 80.0, z: float = 100.0) -> TriangleMesh:
    """A cuboid about the origin, with the given edges."""
    return _converted(trimesh.creation.box(extents=(x, y, z)))


def cylinder(radius: float = 30.0, height: float = 100.0) -> TriangleMesh:
    """A closed cylinder about the origin, along z."""
    return _converted(trimesh.creation.cylinder(radius=radius, height=height, sections=256))


def plate(x: float = 100.0, y: float = 80.0, thickness: float = 4.0) -> TriangleMesh:
    """A thin, flat cuboid about the origin."""
    return box(x, y, thickness)


def lathe(
    profile: Callable[[FloatArray, FloatArray], FloatArray], height: float = 100.0
) -> TriangleMesh:
    """A closed solid about the z axis: its radius by turn (radians) and level (0 to 1)."""
    num_turns, num_levels = 360, 161
    turn = 2 * np.pi * np.arange(num_turns) / num_turns
    level = np.linspace(0.0, 1.0, num_levels)
    radius = profile(*np.meshgrid(turn, level))
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    side = np.concatenate(
        [radius[..., None] * ring, np.broadcast_to(level[:, None, None], (*radius.shape, 1))], 2
    )
    side[..., 2] *= height
    vertices = np.concatenate([side.reshape(-1, 3), [[0, 0, 0], [0, 0, height]]])
    k = np.arange(num_levels * num_turns).reshape(num_levels, num_turns)
    a, b = k[:-1], np.roll(k[:-1], -1, axis=1)
    c, d = k[1:], np.roll(k[1:], -1, axis=1)
    bottom, top = len(vertices) - 2, len(vertices) - 1
    faces = [np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, d), (a, d, c))]
    first, last = k[0], k[-1]
    faces.append(np.stack([np.full_like(first, bottom), np.roll(first, -1), first], axis=-1))
    faces.append(np.stack([np.full_like(last, top), last, np.roll(last, -1)], axis=-1))
    vertices, used, _ = compact(vertices, np.concatenate(faces))
    return TriangleMesh(vertices=vertices, faces=used)


def _converted(mesh: trimesh.Trimesh) -> TriangleMesh:
    return TriangleMesh(vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))
