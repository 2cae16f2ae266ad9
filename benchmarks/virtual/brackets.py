"""Made parts: plates, blocks, tubes and rings grown together at random, drilled and engraved."""

import numpy as np
from skimage.measure import marching_cubes

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh, compact, pieces
from scanweld.geometry.pose import random_rotation, rotation_exp

HALF_LENGTH = 50.0
"""Of the plate that everything stands on; the whole is about 150 units across."""
FILLET = 3.0
NUM_PARTS, NUM_BORES = 7, 3
GROOVE_WIDTH, GROOVE_DEPTH = 2.5, 2.0
Rng = np.random.Generator


def bracket(seed: int, *, voxels: int = 110) -> TriangleMesh:
    """A part without symmetry as a closed mesh, its plate across z, made anew for every seed."""
    rng = np.random.default_rng([seed, 77])
    half = HALF_LENGTH * np.array([1.0, rng.uniform(0.55, 0.75), rng.uniform(0.1, 0.16)])
    reach = HALF_LENGTH * 1.55
    step = 2 * reach / voxels
    axis = np.arange(-reach, reach + step, step)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    field = _block(points, half, 3.0)
    for k in range(NUM_PARTS):
        part = _part(points, k, half, rng)
        near = np.maximum(FILLET - np.abs(field - part), 0.0)
        field = np.minimum(field, part) - 0.25 * near**2 / FILLET
    for _ in range(NUM_BORES):
        field = np.maximum(field, -_bore(points, half, rng))
    field += GROOVE_DEPTH * _groove(points, rng)
    # A node exactly on the surface would give faces without area.
    field[np.abs(field) < 1e-3 * step] = 1e-3 * step
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(step, step, step))
    body = pieces(faces, len(vertices))
    is_largest = body[faces[:, 0]] == np.argmax(np.bincount(body))
    vertices, faces, _ = compact(vertices.astype(np.float64) - reach, faces[is_largest])
    return TriangleMesh(vertices=vertices, faces=faces)


def _part(points: FloatArray, number: int, half: FloatArray, rng: Rng) -> FloatArray:
    """A block, a tube or a ring by turns, standing on either side of the plate, tilted."""
    side = 1.0 if number % 3 else -1.0
    middle = np.array([*rng.uniform(-0.85, 0.85, size=2) * half[:2], 0.0])
    size = HALF_LENGTH * rng.uniform(0.16, 0.4)
    tilt = rotation_exp(rng.normal(scale=0.35, size=3))
    if number % 3 == 0:
        edges = size * rng.uniform(0.4, 1.1, size=3)
        middle[2] = side * size * 0.7
        return _block((points - middle) @ tilt, edges, 2.0)
    if number % 3 == 1:
        height = HALF_LENGTH * rng.uniform(0.3, 0.75)
        middle[2] = side * 0.6 * height
        return _tube((points - middle) @ tilt, 0.6 * size, height)
    thickness, middle[2] = size * rng.uniform(0.22, 0.4), side * size
    return _ring((points - middle) @ random_rotation(rng), size, thickness)


def _bore(points: FloatArray, half: FloatArray, rng: Rng) -> FloatArray:
    """A hole through the plate and what stands over it."""
    middle = np.array([*rng.uniform(-0.8, 0.8, size=2) * half[:2], 0.0])
    tilt = rotation_exp(rng.normal(scale=0.15, size=3))
    return _tube((points - middle) @ tilt, HALF_LENGTH * rng.uniform(0.06, 0.12), 3 * HALF_LENGTH)


def _groove(points: FloatArray, rng: Rng) -> FloatArray:
    """How deep (0 to 1) points lie in wavy lines, engraved on one half of the part."""
    x, y, z = np.moveaxis(points, -1, 0) / HALF_LENGTH
    a, b, c, d = rng.uniform(2.0, 5.0, size=4)
    line = np.sin(a * x + 1.5 * np.sin(b * y) + 0.7 * z) + 0.4 * np.sin(c * y + d * z)
    here = 1.0 / (1.0 + np.exp(-8.0 * (x + rng.uniform(-0.3, 0.3))))
    return here * np.exp(-((line * HALF_LENGTH / (a * GROOVE_WIDTH)) ** 2))


# Distances (...) of points (..., 3) in a part's own frame from its surface, negative inside.
def _block(points: FloatArray, half: FloatArray, rounding: float) -> FloatArray:
    beyond = np.abs(points) - (half - rounding)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    return outside + np.minimum(beyond.max(axis=-1), 0.0) - rounding


def _tube(points: FloatArray, radius: float, half_height: float) -> FloatArray:
    across = np.hypot(points[..., 0], points[..., 1]) - radius
    return np.maximum(across, np.abs(points[..., 2]) - half_height)


def _ring(points: FloatArray, radius: float, thickness: float) -> FloatArray:
    across = np.hypot(points[..., 0], points[..., 1]) - radius
    return np.hypot(across, points[..., 2]) - thickness
