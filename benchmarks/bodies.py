"""Objects of the stress benchmark: figures, plain solids, and the symmetries these have."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh

from scanweld.evaluation.creature import creature
from scanweld.evaluation.primitives import box, cylinder, lathe, plate, sphere
from scanweld.evaluation.views import Axis
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.io import read_mesh
from sets import data_folder

CREATURE_VOXELS = 120
MIRROR_Y = 2.0
"""Plane at which a figure is mirrored: beside its trunk's middle."""
TURN_STEP_DEG = 1.0
"""Step at which the turns of a surface of revolution are sampled."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Body:
    """An object.

    Attributes:
        mesh: Faces counter-clockwise seen from outside.
        up: The axis that rings of views go around.
        symmetry: Motions, besides none, that leave the object as it is. Where there are any, the
            pose of a scan is not determined by what it shows.
    """

    mesh: TriangleMesh
    up: Axis = "z"
    symmetry: tuple[Pose, ...] = ()


@lru_cache(maxsize=4)
def make_body(name: str, seed: int, data: Path | None = None) -> Body:
    """One of ``BODIES`` by its name; the figures differ by seed."""
    return BODIES[name](seed, data)


def figure(seed: int, data: Path | None) -> Body:
    """The project's own figure: no symmetry, much self-occlusion."""
    return Body(mesh=creature(seed, voxels=CREATURE_VOXELS))


def stored(name: str) -> Callable[[int, Path | None], Body]:
    """A mesh of the data folder."""

    def load(seed: int, data: Path | None) -> Body:
        return Body(mesh=read_mesh(data_folder(data) / "meshes" / f"{name}.ply"), up="y")

    return load


def mirrored_figure(seed: int, data: Path | None) -> Body:
    """A figure whose right side is the mirror image of its left: no motion maps it on itself."""
    mesh = figure(seed, data).mesh
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        mesh.vertices, mesh.faces, np.array([0.0, 1.0, 0.0]), np.array([0.0, MIRROR_Y, 0.0])
    )
    other = vertices * [1.0, -1.0, 1.0] + [0.0, 2 * MIRROR_Y, 0.0]
    mirrored = joined(TriangleMesh(vertices=vertices, faces=faces), other, faces[:, ::-1])
    return Body(mesh=mirrored)


def on_disc(body: Body, radius_diameters: float, thickness: float = 2.0) -> Body:
    """The object standing on a turntable, a disc across z."""
    low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
    disc = cylinder(radius_diameters * float(np.linalg.norm(high - low)), thickness)
    place = np.array([*0.5 * (low + high)[:2], low[2] - 0.5 * thickness])
    return Body(mesh=joined(body.mesh, disc.vertices + place, disc.faces))


def joined(mesh: TriangleMesh, vertices: FloatArray, faces: IntArray) -> TriangleMesh:
    """A mesh and another body's vertices and faces as one, without colours."""
    return TriangleMesh(
        vertices=np.concatenate([mesh.vertices, vertices]),
        faces=np.concatenate([mesh.faces, faces + len(mesh.vertices)]),
    )


def vase_radius(turn: FloatArray, level: FloatArray) -> FloatArray:
    """A belly, a neck and a lip."""
    return 22.0 + 12.0 * np.sin(2.6 * np.pi * level + 0.3) - 4.0 * level + 0.0 * turn


def marked_vase_radius(turn: FloatArray, level: FloatArray) -> FloatArray:
    """The vase with a knob about 6 units wide and 4 high on its belly."""
    belly = 34.0
    away2 = (belly * np.angle(np.exp(1j * (turn - 1.0)))) ** 2 + (100.0 * (level - 0.3)) ** 2
    return vase_radius(turn, level) + 4.0 * np.exp(-away2 / (2 * 3.0**2))


def gear_radius(turn: FloatArray, level: FloatArray) -> FloatArray:
    """Twelve teeth."""
    return 44.0 + 6.0 * np.tanh(4.0 * np.sin(12.0 * turn)) + 0.0 * level


def keyed_gear_radius(turn: FloatArray, level: FloatArray) -> FloatArray:
    """Twelve teeth, of which one is worn to half its height over half of its width."""
    worn = np.abs(np.angle(np.exp(1j * (turn - np.pi / 24)))) < np.pi / 14
    return gear_radius(turn, level) - np.where(worn & (level > 0.5), 6.0, 0.0)


def turns(count: int, *, flips: bool = False) -> tuple[Pose, ...]:
    """All turns about z by 360 / count degrees; with flips, the half turns about x besides."""
    about_z = [rotation_exp(np.array([0.0, 0.0, 2 * np.pi * k / count])) for k in range(count)]
    flip = rotation_exp(np.array([np.pi, 0.0, 0.0]))
    rotations = about_z + [turn @ flip for turn in about_z] * flips
    return tuple(Pose(rotation=rotation, translation=np.zeros(3)) for rotation in rotations)[1:]


def _at_origin(motions: tuple[Pose, ...], centre: FloatArray) -> tuple[Pose, ...]:
    """Motions about the origin, as motions about a centre (3,)."""
    return tuple(
        Pose(rotation=m.rotation, translation=centre - m.rotation @ centre) for m in motions
    )


def _plain(
    mesh: Callable[[], TriangleMesh], symmetry: tuple[Pose, ...], centre_z: float = 0.0
) -> Callable[[int, Path | None], Body]:
    """A solid that is the same for all seeds."""
    about = _at_origin(symmetry, np.array([0.0, 0.0, centre_z]))
    return lambda seed, data: Body(mesh=mesh(), symmetry=about)


def _any_turn(count: int = 2000) -> tuple[Pose, ...]:
    """Turns spread over SO(3)."""
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = rng.uniform(0, np.pi, size=(count, 1))
    return tuple(Pose(rotation=rotation_exp(w), translation=np.zeros(3)) for w in axes * angles)


_ROUND = round(360 / TURN_STEP_DEG)

BODIES: dict[str, Callable[[int, Path | None], Body]] = {
    "creature": figure,
    "armadillo": stored("armadillo"),
    "bunny": stored("bunny"),
    "mirror figure": mirrored_figure,
    "creature on disc": lambda seed, data: on_disc(figure(seed, data), 0.55),
    "sphere": _plain(sphere, _any_turn()),
    "cylinder": _plain(cylinder, turns(_ROUND, flips=True)),
    "cone": _plain(lambda: lathe(lambda turn, level: 40.0 - 39.9 * level), turns(_ROUND)),
    "box": _plain(box, turns(2, flips=True)),
    "plate": _plain(plate, turns(2, flips=True)),
    "vase": _plain(lambda: lathe(vase_radius), turns(_ROUND)),
    "marked vase": _plain(lambda: lathe(marked_vase_radius), ()),
    "gear": _plain(lambda: lathe(gear_radius, 25.0), turns(12, flips=True), 12.5),
    "keyed gear": _plain(lambda: lathe(keyed_gear_radius, 25.0), ()),
}
