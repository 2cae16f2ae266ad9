"""A virtual object that belongs to the project: a four-legged figure from an implicit surface.

Bones with a radius at either end are blended into one smooth solid, wrinkled by a displacement,
and turned into a closed mesh by marching cubes. It has what makes scans hard to put together: limbs
that hide each other, folds, thin parts, no symmetry, and no two sides alike.
"""

from dataclasses import dataclass

import numpy as np
from skimage.measure import marching_cubes

from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, compact, pieces

Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Limb:
    """A chain of joints (x forward, y left, z up) with their radii, as lengths of the trunk.

    Attributes:
        joints: At least two points; the same point twice is a ball.
        radii: One a joint, linear in between.
        blend: Width of the fillet towards what stands already.
    """

    joints: tuple[Point, ...]
    radii: tuple[float, ...]
    blend: float = 0.05


_LIMBS = (
    # Trunk, neck, head with snout, jaw and brow.
    Limb(
        joints=((-0.36, 0.0, 0.42), (-0.06, 0.05, 0.5), (0.25, 0.0, 0.47)),
        radii=(0.165, 0.145, 0.185),
        blend=0.08,
    ),
    Limb(
        joints=((0.27, 0.0, 0.52), (0.42, 0.05, 0.68), (0.49, 0.14, 0.83)),
        radii=(0.13, 0.085, 0.1),
        blend=0.07,
    ),
    Limb(joints=((0.5, 0.16, 0.84), (0.53, 0.19, 0.85)), radii=(0.115, 0.105), blend=0.03),
    Limb(joints=((0.55, 0.22, 0.84), (0.67, 0.37, 0.78)), radii=(0.075, 0.05), blend=0.04),
    Limb(joints=((0.53, 0.19, 0.76), (0.64, 0.33, 0.67)), radii=(0.05, 0.028), blend=0.025),
    Limb(joints=((0.625, 0.36, 0.805), (0.66, 0.345, 0.815)), radii=(0.026, 0.024), blend=0.02),
    Limb(joints=((0.5, 0.27, 0.905), (0.62, 0.18, 0.9)), radii=(0.03, 0.034), blend=0.02),
    # Horns, one broken off, and ears.
    Limb(
        joints=((0.46, 0.2, 0.93), (0.38, 0.25, 1.05), (0.28, 0.22, 1.11), (0.24, 0.14, 1.1)),
        radii=(0.045, 0.036, 0.027, 0.014),
        blend=0.03,
    ),
    Limb(
        joints=((0.53, 0.08, 0.93), (0.5, -0.01, 1.03), (0.44, -0.04, 1.06)),
        radii=(0.045, 0.036, 0.034),
        blend=0.03,
    ),
    Limb(joints=((0.43, 0.22, 0.83), (0.31, 0.34, 0.8)), radii=(0.036, 0.02), blend=0.03),
    Limb(joints=((0.57, 0.07, 0.82), (0.62, -0.09, 0.88)), radii=(0.034, 0.022), blend=0.03),
    # Fore legs: one stands, one is raised.
    Limb(
        joints=((0.25, 0.12, 0.43), (0.2, 0.21, 0.24), (0.3, 0.2, 0.05), (0.37, 0.22, 0.035)),
        radii=(0.1, 0.06, 0.046, 0.04),
    ),
    Limb(
        joints=((0.27, -0.12, 0.43), (0.44, -0.23, 0.37), (0.52, -0.17, 0.19), (0.59, -0.15, 0.2)),
        radii=(0.1, 0.062, 0.044, 0.04),
    ),
    # Hind legs.
    Limb(
        joints=(
            (-0.34, 0.11, 0.38),
            (-0.19, 0.23, 0.25),
            (-0.36, 0.24, 0.13),
            (-0.26, 0.25, 0.035),
        ),
        radii=(0.13, 0.085, 0.048, 0.042),
    ),
    Limb(
        joints=(
            (-0.36, -0.11, 0.38),
            (-0.33, -0.23, 0.22),
            (-0.53, -0.21, 0.13),
            (-0.47, -0.23, 0.035),
        ),
        radii=(0.13, 0.08, 0.048, 0.042),
    ),
    # Toes.
    Limb(joints=((0.37, 0.24, 0.035), (0.44, 0.26, 0.03)), radii=(0.03, 0.02), blend=0.015),
    Limb(joints=((0.37, 0.2, 0.035), (0.45, 0.2, 0.03)), radii=(0.03, 0.02), blend=0.015),
    Limb(joints=((0.59, -0.13, 0.19), (0.64, -0.1, 0.15)), radii=(0.03, 0.02), blend=0.015),
    Limb(joints=((0.59, -0.17, 0.19), (0.65, -0.18, 0.16)), radii=(0.03, 0.02), blend=0.015),
    Limb(joints=((-0.26, 0.28, 0.035), (-0.18, 0.3, 0.03)), radii=(0.032, 0.02), blend=0.015),
    Limb(joints=((-0.26, 0.23, 0.035), (-0.18, 0.22, 0.03)), radii=(0.032, 0.02), blend=0.015),
    Limb(joints=((-0.47, -0.2, 0.035), (-0.39, -0.19, 0.03)), radii=(0.032, 0.02), blend=0.015),
    Limb(joints=((-0.47, -0.26, 0.035), (-0.39, -0.28, 0.03)), radii=(0.032, 0.02), blend=0.015),
    # Tail, curled to the left, with a knob.
    Limb(
        joints=(
            (-0.46, 0.0, 0.45),
            (-0.66, -0.03, 0.42),
            (-0.83, 0.09, 0.35),
            (-0.86, 0.27, 0.3),
            (-0.73, 0.4, 0.33),
            (-0.58, 0.38, 0.42),
        ),
        radii=(0.1, 0.075, 0.06, 0.05, 0.04, 0.03),
    ),
    Limb(joints=((-0.57, 0.37, 0.43), (-0.51, 0.35, 0.46)), radii=(0.055, 0.035), blend=0.02),
    # Plates along the back, and a folded wing on the left side only.
    Limb(joints=((0.2, 0.0, 0.63), (0.16, 0.0, 0.76)), radii=(0.045, 0.016), blend=0.02),
    Limb(joints=((0.06, 0.02, 0.63), (0.0, 0.03, 0.79)), radii=(0.05, 0.016), blend=0.02),
    Limb(joints=((-0.09, 0.05, 0.62), (-0.16, 0.07, 0.75)), radii=(0.05, 0.016), blend=0.02),
    Limb(joints=((-0.23, 0.04, 0.59), (-0.31, 0.05, 0.69)), radii=(0.045, 0.016), blend=0.02),
    Limb(joints=((-0.38, 0.0, 0.57), (-0.46, 0.01, 0.64)), radii=(0.04, 0.014), blend=0.02),
    Limb(
        joints=((0.16, 0.15, 0.55), (0.12, 0.27, 0.68), (-0.15, 0.31, 0.62)),
        radii=(0.045, 0.035, 0.02),
        blend=0.03,
    ),
    Limb(joints=((0.12, 0.25, 0.65), (-0.2, 0.29, 0.52)), radii=(0.035, 0.018), blend=0.03),
    Limb(joints=((0.12, 0.22, 0.6), (-0.17, 0.26, 0.43)), radii=(0.035, 0.018), blend=0.03),
)

_TRUNK_LENGTH = 100.0
"""Length of the figure's trunk, in the unit of the mesh (say millimetres)."""


def creature(seed: int = 0, *, voxels: int = 200) -> TriangleMesh:
    """The figure as a closed mesh with colours, about 170 units long.

    Args:
        seed: 0 for the figure as designed; others move every joint and radius at random.
        voxels: Across the longest side; 200 give about 90,000 faces, 70 about 10,000.
    """
    limbs = _LIMBS if seed == 0 else _varied(_LIMBS, seed)
    joints = np.array([joint for limb in limbs for joint in limb.joints])
    low, high = joints.min(axis=0) - 0.25, joints.max(axis=0) + 0.25
    step = float((high - low).max()) / voxels
    axes = [np.arange(low[k], high[k] + step, step) for k in range(3)]
    field = np.full([len(axis) for axis in axes], 1.0)
    for limb in limbs:
        _add_limb(field, axes, limb)
    field += _wrinkles(axes)
    # A node exactly on the surface would give faces without area.
    field[np.abs(field) < 1e-3 * step] = 1e-3 * step
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(step, step, step))
    vertices, faces = _largest_body(vertices.astype(np.float64) + low, faces)
    return TriangleMesh(
        vertices=vertices * _TRUNK_LENGTH, faces=_outward(vertices, faces), colors=_coat(vertices)
    )


def _varied(limbs: tuple[Limb, ...], seed: int) -> tuple[Limb, ...]:
    """Other proportions and another stance; parts that meet move together."""
    joint_spread, radius_spread = 0.1, 0.12
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(3, 3))
    phases = rng.uniform(0, 2 * np.pi, size=3)

    def moved(joint: Point) -> Point:
        shift = joint_spread * np.sin(4.0 * (waves @ np.array(joint)) + phases)
        x, y, z = np.array(joint) + shift
        return float(x), float(y), float(z)

    def scaled(radii: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(float(r * np.exp(radius_spread * rng.normal())) for r in radii)

    return tuple(
        Limb(joints=tuple(map(moved, limb.joints)), radii=scaled(limb.radii), blend=limb.blend)
        for limb in limbs
    )


def _add_limb(field: FloatArray, axes: list[FloatArray], limb: Limb) -> None:
    """Blend the bones of a limb into the field, in place, within their reach only."""
    for k in range(len(limb.joints) - 1):
        a, b = np.array(limb.joints[k]), np.array(limb.joints[k + 1])
        ra, rb = limb.radii[k], limb.radii[k + 1]
        reach = max(ra, rb) + 0.1
        low, high = np.minimum(a, b) - reach, np.maximum(a, b) + reach
        box = tuple(
            slice(*np.searchsorted(axis, (low[n], high[n])))  # one slice an axis
            for n, axis in enumerate(axes)
        )
        x, y, z = np.meshgrid(*(axis[s] for axis, s in zip(axes, box, strict=True)), indexing="ij")
        bone = _bone_distance(np.stack([x, y, z], axis=-1), a, b, ra, rb)
        field[box] = _smooth_min(field[box], bone, limb.blend)


def _bone_distance(
    points: FloatArray, a: FloatArray, b: FloatArray, ra: float, rb: float
) -> FloatArray:
    """Distance (...) of points (..., 3) from a segment whose radius goes from ra to rb."""
    along = b - a
    length2 = float(along @ along)
    t = np.clip((points - a) @ along / length2, 0.0, 1.0)
    return np.linalg.norm(points - a - t[..., None] * along, axis=-1) - (ra + t * (rb - ra))


def _smooth_min(a: FloatArray, b: FloatArray, width: float) -> FloatArray:
    """The minimum, rounded where a and b differ by less than a width."""
    near = np.maximum(width - np.abs(a - b), 0.0)
    return np.minimum(a, b) - 0.25 * near**2 / width


def _wrinkles(axes: list[FloatArray]) -> FloatArray:
    """Folds around trunk, neck and tail, uneven in depth and spacing."""
    x, y, z = np.meshgrid(*axes, indexing="ij", sparse=True)
    folds = np.sin(38.0 * x + 9.0 * np.sin(7.0 * z + 3.0 * y))
    depth = 0.5 + 0.5 * np.sin(5.0 * x + 2.0) * np.sin(6.0 * y - 4.0 * z)
    lumps = np.sin(17.0 * x + 1.0) * np.sin(19.0 * y + 2.0) * np.sin(16.0 * z)
    return 0.006 * depth * folds + 0.006 * lumps


def _coat(vertices: FloatArray) -> ByteArray:
    """Stripes and patches, so that colours can be followed through the whole run."""
    x, y, z = vertices.T
    stripes = 0.5 + 0.5 * np.sin(22.0 * x + 6.0 * np.sin(9.0 * y) + 8.0 * z)
    light = 0.75 + 0.25 * np.sin(5.0 * z + 4.0 * y)
    shade = np.stack([0.9 - 0.35 * stripes, 0.72 - 0.4 * stripes, 0.45 - 0.2 * stripes], axis=1)
    return np.rint(255 * np.clip(shade * light[:, None], 0, 1)).astype(np.uint8)


def _largest_body(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The body with the most vertices: on a coarse grid thin tips come off."""
    body = pieces(faces, len(vertices))
    largest = np.argmax(np.bincount(body))
    vertices, faces, _ = compact(vertices, faces[body[faces[:, 0]] == largest])
    return vertices, faces


def _outward(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Faces counter-clockwise from outside: the volume that they enclose is positive."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("nk,nk->", a, np.cross(b, c))
    return faces if volume > 0 else faces[:, ::-1]
