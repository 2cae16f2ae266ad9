"""Objects that are scanned: figures, made parts, plain solids, and the symmetries these have."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import trimesh

from benchmarks.virtual.brackets import bracket
from benchmarks.virtual.profiles import gear_radius, keyed, knobbed, vase_radius
from scanweld.evaluation.creature import creature
from scanweld.evaluation.primitives import box, cylinder, lathe, plate, sphere
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp

CREATURE_VOXELS = 120
FIRST_CREATURE = 1000
"""Seeds of these creatures start here: nothing else of the project uses them."""
STRETCH = 0.2
"""Creatures are stretched or squashed by up to this share along each axis."""
MIRROR_Y = 2.0
"""Plane at which a figure is mirrored: beside its trunk's middle."""
TURN_STEP_DEG = 1.0
"""Step at which the turns of a surface of revolution are sampled."""

Rng = np.random.Generator


@dataclass(frozen=True, kw_only=True, slots=True)
class Body:
    """An object, standing along z.

    Attributes:
        mesh: Faces counter-clockwise seen from outside.
        symmetry: Motions, besides none, that leave the object as it is. Where there are any, the
            pose of a scan is not determined by what it shows.
        unmarked: The same object without the mark that alone tells it from a symmetric one; None
            where there is no such mark.
    """

    mesh: TriangleMesh
    symmetry: tuple[Pose, ...] = ()
    unmarked: TriangleMesh | None = None


@lru_cache(maxsize=16)
def make_body(name: str, seed: int) -> Body:
    """One of ``BODIES`` by its name, another one for every seed."""
    return BODIES[name](seed)


def thing(seed: int) -> Body:
    """An object without symmetry: a figure or a made part by turns."""
    return part(seed) if seed % 2 else figure(seed)


def other_thing(seed: int) -> Body:
    """An object of the other sort than ``thing`` of the same seed."""
    return figure(seed) if seed % 2 else part(seed)


def figure(seed: int) -> Body:
    """A four-legged figure with much self-occlusion, of any proportions."""
    mesh = creature(FIRST_CREATURE + seed, voxels=CREATURE_VOXELS)
    factors = 1.0 + np.random.default_rng([seed, 5]).uniform(-STRETCH, STRETCH, size=3)
    return Body(mesh=TriangleMesh(vertices=mesh.vertices * factors, faces=mesh.faces))


def part(seed: int) -> Body:
    """A made part: flat faces, tubes, rings, bores."""
    return Body(mesh=bracket(seed))


def mirrored_figure(seed: int) -> Body:
    """A figure whose right side is the mirror image of its left: no motion maps it on itself."""
    mesh = figure(seed).mesh
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        mesh.vertices, mesh.faces, np.array([0.0, 1.0, 0.0]), np.array([0.0, MIRROR_Y, 0.0])
    )
    other = vertices * [1.0, -1.0, 1.0] + [0.0, 2 * MIRROR_Y, 0.0]
    left = TriangleMesh(vertices=vertices, faces=faces)
    return Body(mesh=joined(left, TriangleMesh(vertices=other, faces=faces[:, ::-1])))


def joined(one: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """Two meshes as one, the first's faces first, without colours."""
    return TriangleMesh(
        vertices=np.concatenate([one.vertices, other.vertices]),
        faces=np.concatenate([one.faces, other.faces + len(one.vertices)]),
    )


def turns(count: int, *, flips: bool = False) -> tuple[Pose, ...]:
    """All turns about z by 360 / count degrees; with flips, the half turns about x besides."""
    about_z = [rotation_exp(np.array([0.0, 0.0, 2 * np.pi * k / count])) for k in range(count)]
    flip = rotation_exp(np.array([np.pi, 0.0, 0.0]))
    rotations = about_z + [turn @ flip for turn in about_z] * flips
    return tuple(Pose(rotation=rotation, translation=np.zeros(3)) for rotation in rotations)[1:]


def any_turn(count: int = 2000) -> tuple[Pose, ...]:
    """Turns spread over SO(3)."""
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = rng.uniform(0, np.pi, size=(count, 1))
    return tuple(Pose(rotation=rotation_exp(w), translation=np.zeros(3)) for w in axes * angles)


def _solid(
    make: Callable[[Rng], TriangleMesh], symmetry: tuple[Pose, ...]
) -> Callable[[int], Body]:
    """A solid whose proportions differ by seed, moved so that its middle is the origin."""

    def body(seed: int) -> Body:
        mesh = make(np.random.default_rng([seed, 6]))
        return Body(mesh=_shifted(mesh, _middle(mesh)), symmetry=symmetry)

    return body


def _marked(
    marked: Callable[[Rng], TriangleMesh], unmarked: Callable[[Rng], TriangleMesh]
) -> Callable[[int], Body]:
    """A solid with a mark, and the same without it."""

    def body(seed: int) -> Body:
        meshes = [make(np.random.default_rng([seed, 6])) for make in (marked, unmarked)]
        middle = _middle(meshes[1])
        with_mark, without = (_shifted(mesh, middle) for mesh in meshes)
        return Body(mesh=with_mark, unmarked=without)

    return body


def _middle(mesh: TriangleMesh) -> FloatArray:
    return 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))


def _shifted(mesh: TriangleMesh, middle: FloatArray) -> TriangleMesh:
    return TriangleMesh(vertices=mesh.vertices - middle, faces=mesh.faces)


def _vase(rng: Rng) -> TriangleMesh:
    return lathe(vase_radius(rng))


def _gear(rng: Rng) -> TriangleMesh:
    return lathe(gear_radius(rng), 25.0)


_ROUND = round(360 / TURN_STEP_DEG)

BODIES: dict[str, Callable[[int], Body]] = {
    "thing": thing,
    "other thing": other_thing,
    "mirror figure": mirrored_figure,
    "sphere": _solid(lambda rng: sphere(), any_turn()),
    "cylinder": _solid(lambda rng: cylinder(rng.uniform(22, 40)), turns(_ROUND, flips=True)),
    "cone": _solid(
        lambda rng: lathe(lambda turn, level: 40.0 - 39.9 * level, rng.uniform(70, 130)),
        turns(_ROUND),
    ),
    "box": _solid(lambda rng: box(*rng.uniform([50, 72, 95], [65, 88, 115])), turns(2, flips=True)),
    "plate": _solid(lambda rng: plate(100.0, rng.uniform(60, 85)), turns(2, flips=True)),
    "vase": _solid(_vase, turns(_ROUND)),
    "gear": _solid(_gear, turns(12, flips=True)),
    "marked vase": _marked(lambda rng: lathe(knobbed(vase_radius(rng))), _vase),
    "marked gear": _marked(lambda rng: lathe(keyed(gear_radius(rng)), 25.0), _gear),
}
