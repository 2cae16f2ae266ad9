"""Plain objects that slide or turn upon themselves: what must not be put together wrongly."""

from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, compact


def sphere(radius: float = 50.0) -> TriangleMesh:
    """A ball about the origin: an icosahedron whose faces are split into four, five times."""
    golden = 0.5 * (1 + np.sqrt(5))
    corners = np.array([(a, b, 0.0) for a in (-1.0, 1.0) for b in (-golden, golden)])
    ball = _convex(_unit(np.concatenate([np.roll(corners, shift, axis=1) for shift in range(3)])))
    vertices, faces = ball.vertices, ball.faces
    for _ in range(5):
        vertices, faces = _split_in_four(vertices, faces)
    return TriangleMesh(vertices=radius * vertices, faces=faces)


def box(x: float = 60.0, y: float = 80.0, z: float = 100.0) -> TriangleMesh:
    """A cuboid about the origin, with the given edges."""
    return _convex(0.5 * np.array(list(product((-x, x), (-y, y), (-z, z)))))


def cylinder(radius: float = 30.0, height: float = 100.0) -> TriangleMesh:
    """A closed cylinder about the origin, along z."""
    turn = 2 * np.pi * np.arange(256) / 256
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    ends = [np.column_stack([x, y, np.full(len(turn), z)]) for z in (-height / 2, height / 2)]
    return _convex(np.concatenate(ends))


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


def _split_in_four(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Triangles on the unit sphere split at the middles of their edges, which move onto it."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = len(vertices) + number.reshape(-1, 3).T
    a, b, c = faces.T
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    middles = _unit(vertices[unique].mean(axis=1))
    split = np.concatenate([np.stack(part, axis=1) for part in parts])
    return np.concatenate([vertices, middles]), split


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _convex(points: FloatArray) -> TriangleMesh:
    """The convex hull of points (N, 3) around the origin, all of them on it."""
    faces = ConvexHull(points).simplices.astype(np.int64)
    outward = np.linalg.det(points[faces]) > 0
    return TriangleMesh(vertices=points, faces=np.where(outward[:, None], faces, faces[:, ::-1]))
