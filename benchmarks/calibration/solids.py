"""Objects that the calibration makes for itself; no other benchmark scans any of them."""

from collections.abc import Callable, Mapping

import numpy as np
import trimesh
from scipy import ndimage
from scipy.spatial import ConvexHull

from benchmarks.virtual.bodies import Body, Profile, Rng, toothed
from scanweld.evaluation.primitives import lathe
from scanweld.evaluation.turntable import joined
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import random_rotation

SIZE = 100.0
_BALL = trimesh.creation.icosphere(subdivisions=5)


def blob(rng: Rng) -> Body:
    """A ball with broad and narrow bumps and dents, stretched."""
    return Body(_radial(1.0 + _bumps(rng, 14, 0.35), rng.uniform(0.5, 1.2, 3)))


def hulls(rng: Rng) -> Body:
    """Convex hulls of random points, and prisms on random polygons that stick out of them."""
    mesh = _hull(rng)
    for _ in range(int(rng.integers(2, 5))):
        other = _hull(rng) if rng.random() < 0.4 else _random_prism(rng)
        place = rng.normal(size=3) * 22.0
        vertices = 0.7 * other.vertices @ random_rotation(rng).T + place
        mesh = joined(mesh, TriangleMesh(vertices=vertices, faces=other.faces))
    return Body(mesh)


def twisted(rng: Rng) -> Body:
    """A lathe whose section is a wavy disc that twists on the way up, with bumps."""
    waves, depth, twist = int(rng.integers(2, 6)), rng.uniform(0.1, 0.35), rng.uniform(0.5, 3.0)
    profile, spots = _profile(rng), rng.uniform([0, 0.1, 4], [2 * np.pi, 0.9, 14], size=(9, 3))
    heights = rng.uniform(-9, 13, size=9)

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        r = profile(level) * (1.0 + depth * np.sin(waves * (turn + twist * level)))
        for (t, at, width), height in zip(spots, heights, strict=True):
            away2 = (30 * np.angle(np.exp(1j * (turn - t)))) ** 2 + (SIZE * (level - at)) ** 2
            r = r + height * np.exp(-away2 / (2 * width**2))
        return np.maximum(r, 3.0)

    return Body(lathe(radius))


def displaced(rng: Rng) -> Body:
    """A superquadric with bumps."""
    return Body(_radial(_superquadric(rng) * (1.0 + _bumps(rng, 10, 0.2))))


def relief(rng: Rng) -> Body:
    """A slab with a landscape on one side: a coin, a tablet."""
    n = 110
    y, x = np.mgrid[:n, :n] * (SIZE / (n - 1))
    rough = sum(
        amplitude * _unit(ndimage.gaussian_filter(rng.normal(size=(n, n)), sigma))
        for sigma, amplitude in ((12.0, 4.0), (5.0, 2.0))
    )
    sheets = [np.zeros((n, n)), 12.0 + np.clip(rough, -9.0, None)]
    vertices = np.concatenate([np.stack([x, y, z], axis=-1).reshape(-1, 3) for z in sheets])
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = k[:-1, :-1], k[:-1, 1:], k[1:, :-1], k[1:, 1:]
    rim = np.concatenate([k[0, :-1], k[:-1, -1], k[-1, :0:-1], k[:0:-1, 0]])
    after, top = np.roll(rim, -1), n * n
    corners = [
        *((a + top, b + top, d + top), (a + top, d + top, c + top)),
        *((a, d, b), (a, c, d)),
        *((rim, after, after + top), (rim, after + top, rim + top)),
    ]
    faces = [np.stack(f, axis=-1).reshape(-1, 3) for f in corners]
    return Body(TriangleMesh(vertices=vertices, faces=np.concatenate(faces)))


def vessel(rng: Rng) -> Body:
    """A surface of revolution."""
    profile = _profile(rng)
    mesh = lathe(lambda turn, level: np.maximum(profile(level), 3.0) + 0.0 * turn)
    return Body(mesh, is_symmetric=True)


def prism(rng: Rng) -> Body:
    """On a regular polygon, straight or tapered."""
    sides, taper = int(rng.integers(3, 8)), rng.uniform(0.0, 0.4)
    size, half = rng.uniform(25.0, 50.0), np.pi / sides

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        side = np.cos(half) / np.cos(np.mod(turn, 2 * half) - half)
        return size * side * (1.0 - taper * level)

    return Body(lathe(radius), is_symmetric=True)


def star(rng: Rng) -> Body:
    """With equal arms."""
    mesh = lathe(_star(rng), height=rng.uniform(20.0, 80.0))
    return Body(mesh, is_symmetric=True)


def marked_star(rng: Rng) -> Body:
    """With equal arms, one of which is different in one place: a third scan may tell."""
    plain, level_at = _star(rng), rng.uniform(0.3, 0.7)
    depth, wide = rng.uniform(4.0, 12.0), rng.uniform(0.1, 0.25)

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        away2 = (np.angle(np.exp(1j * turn)) / wide) ** 2 + ((level - level_at) / wide) ** 2
        return plain(turn, level) + depth * np.exp(-0.5 * away2)

    height = rng.uniform(40.0, 80.0)
    return Body(lathe(radius, height=height), unmarked=lathe(plain, height=height))


def superquadric(rng: Rng) -> Body:
    """Between a box, a ball and an octahedron: two half turns leave it as it is."""
    return Body(_radial(_superquadric(rng)), is_symmetric=True)


SOLIDS: Mapping[Callable[[Rng], Body], float] = {
    **{blob: 0.17, hulls: 0.17, twisted: 0.14, displaced: 0.14, relief: 0.07},
    **{vessel: 0.06, prism: 0.07, star: 0.06, marked_star: 0.06, superquadric: 0.06},
}
"""How often each is drawn."""


def _radial(radius: FloatArray, stretch: FloatArray | float = 1.0) -> TriangleMesh:
    """The unit sphere's vertices at other radii, stretched."""
    vertices = np.array(_BALL.vertices) * np.maximum(radius, 0.15)[:, None] * stretch
    vertices = 0.5 * SIZE * vertices / np.abs(vertices).max()
    return TriangleMesh(vertices=vertices, faces=np.array(_BALL.faces))


def _bumps(rng: Rng, count: int, height: float) -> FloatArray:
    """A sum of bumps and dents on the unit sphere, each about its own direction."""
    total = np.zeros(len(_BALL.vertices))
    for _ in range(count):
        towards = rng.normal(size=3)
        cosine = np.array(_BALL.vertices) @ (towards / np.linalg.norm(towards))
        total += rng.uniform(-height, height) * np.exp(rng.uniform(4, 40) * (cosine - 1.0))
    return total


def _superquadric(rng: Rng) -> FloatArray:
    power = rng.uniform(1.2, 8.0)
    axes = np.abs(_BALL.vertices) / np.sort(rng.uniform(0.5, 1.0, size=3))
    return (axes**power).sum(axis=1) ** (-1.0 / power)


def _hull(rng: Rng) -> TriangleMesh:
    points = rng.normal(size=(int(rng.integers(8, 20)), 3)) * rng.uniform(12.0, 26.0, size=3)
    hull = ConvexHull(points)
    faces, centre = hull.simplices.astype(np.int64), points.mean(axis=0)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("nk,nk->n", np.cross(b - a, c - a), a - centre) < 0
    faces[inward] = faces[inward][:, ::-1]
    return TriangleMesh(vertices=points, faces=faces)


def _random_prism(rng: Rng) -> TriangleMesh:
    corners = np.sort(rng.uniform(0, 2 * np.pi, size=int(rng.integers(4, 8))))
    far = rng.uniform(10.0, 30.0, size=len(corners))
    mesh = lathe(
        lambda turn, level: np.interp(turn, corners, far, period=2 * np.pi) + 0.0 * level,
        height=rng.uniform(15.0, 60.0),
    )
    return TriangleMesh(vertices=mesh.vertices - mesh.vertices.mean(axis=0), faces=mesh.faces)


def _profile(rng: Rng) -> Callable[[FloatArray], FloatArray]:
    """A smooth radius by level, 0 to 1."""
    steps = np.linspace(0.0, 1.0, 40)
    rough = _unit(ndimage.gaussian_filter1d(rng.normal(size=40), 4.0, mode="nearest"))
    return lambda level: np.interp(level, steps, 25.0 + 8.0 * rough)


def _star(rng: Rng) -> Profile:
    arms, depth, sharpness = int(rng.integers(3, 9)), rng.uniform(6.0, 16.0), rng.uniform(0.5, 4.0)
    return toothed(35.0, depth / float(np.tanh(sharpness)), arms, sharpness)


def _unit(values: FloatArray) -> FloatArray:
    return values / values.std()
