"""Objects that are scanned: figures, made parts, plain solids, and the symmetries these have."""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import trimesh

from benchmarks.virtual.brackets import bracket
from scanweld.evaluation.creature import creature
from scanweld.evaluation.primitives import box, cylinder, lathe, plate, sphere
from scanweld.evaluation.turntable import joined
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh

FIRST_CREATURE = 1000
"""Seeds of these creatures start here: nothing else of the project uses them."""
TOOTH_HEIGHT = 6.0
"""Half of a gear tooth's, in hundredths of twice the gear's radius."""

Rng = np.random.Generator
Profile = Callable[[FloatArray, FloatArray], FloatArray]
"""Radius by turn (radians) and level (0 at the bottom, 1 at the top)."""


class Body(NamedTuple):
    """An object, standing along z."""

    mesh: TriangleMesh  # Faces counter-clockwise seen from outside
    # Whether a motion leaves the object as it is: then no scan determines its own pose
    is_symmetric: bool = False
    # Without the mark that alone tells it from a symmetric one; None where there is no such mark
    unmarked: TriangleMesh | None = None


@lru_cache(maxsize=16)
def make_body(name: str, seed: int) -> Body:
    """One of ``BODIES`` by its name, another one for every seed."""
    return BODIES[name](seed)


def shifted(mesh: TriangleMesh, shift: FloatArray) -> TriangleMesh:
    """A mesh moved by a vector (3,)."""
    return TriangleMesh(vertices=mesh.vertices + shift, faces=mesh.faces)


def middle(mesh: TriangleMesh) -> FloatArray:
    """Centre (3,) of the box around a mesh."""
    return 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))


def toothed(size: float, height: float, count: int, sharpness: float) -> Profile:
    """A disc with teeth, or a star with arms."""
    return lambda turn, level: (
        size + height * np.tanh(sharpness * np.cos(count * turn)) + 0.0 * level
    )


def _figure(seed: int) -> Body:
    """Four-legged, with much self-occlusion, of any proportions."""
    mesh = creature(FIRST_CREATURE + seed, voxels=120)
    factors = 1.0 + np.random.default_rng([seed, 5]).uniform(-0.2, 0.2, size=3)
    return Body(TriangleMesh(vertices=mesh.vertices * factors, faces=mesh.faces))


def _mirrored_figure(seed: int) -> Body:
    """A figure whose right side is the mirror image of its left: no motion maps it on itself."""
    mesh, plane_y = _figure(seed).mesh, 2.0
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        mesh.vertices, mesh.faces, np.array([0.0, 1.0, 0.0]), np.array([0.0, plane_y, 0.0])
    )
    other = vertices * [1.0, -1.0, 1.0] + [0.0, 2 * plane_y, 0.0]
    left = TriangleMesh(vertices=vertices, faces=faces)
    return Body(joined(left, TriangleMesh(vertices=other, faces=faces[:, ::-1])))


def _vase(rng: Rng) -> Profile:
    """A belly, a neck and a lip, wider or slimmer."""
    width, waves = rng.uniform(19.0, 25.0), rng.uniform(2.4, 2.8)
    return lambda turn, level: (
        width + 12.0 * np.sin(waves * np.pi * level + 0.3) - 4.0 * level + 0.0 * turn
    )


def _knobbed_vase(rng: Rng) -> Profile:
    """The same with one knob on the belly, 7 wide and 4 high where the vase's height is 100."""
    plain = _vase(rng)
    belly = float(plain(np.zeros(1), np.full(1, 0.3))[0])

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        around = belly * np.angle(np.exp(1j * (turn - 1.0)))
        away2 = around**2 + (100.0 * (level - 0.3)) ** 2
        return plain(turn, level) + 4.0 * np.exp(-away2 / (2 * (7.0 / 2.4) ** 2))

    return radius


def _gear(rng: Rng) -> Profile:
    return toothed(rng.uniform(38.0, 50.0), TOOTH_HEIGHT, 12, 4.0)


def _worn_gear(rng: Rng) -> Profile:
    """The same with one tooth that is worn to half its height over its upper half."""
    plain = _gear(rng)

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        worn = np.abs(np.angle(np.exp(1j * turn))) < np.pi / 14
        return plain(turn, level) - np.where(worn & (level > 0.5), TOOTH_HEIGHT, 0.0)

    return radius


def _solid(make: Callable[[Rng], TriangleMesh]) -> Callable[[int], Body]:
    """A symmetric solid about its middle whose proportions differ by seed."""

    def body(seed: int) -> Body:
        mesh = make(np.random.default_rng([seed, 6]))
        return Body(shifted(mesh, -middle(mesh)), is_symmetric=True)

    return body


def _marked(
    plain: Callable[[Rng], Profile], marked: Callable[[Rng], Profile], height: float
) -> Callable[[int], Body]:
    """A solid of revolution with a mark, and the same without it."""

    def body(seed: int) -> Body:
        profiles = (make(np.random.default_rng([seed, 6])) for make in (plain, marked))
        without, mesh = (lathe(profile, height) for profile in profiles)
        centre = middle(without)
        return Body(shifted(mesh, -centre), unmarked=shifted(without, -centre))

    return body


BODIES: dict[str, Callable[[int], Body]] = {
    # Without symmetry: figures and made parts by turns, and the other sort of the two.
    "thing": lambda seed: Body(bracket(seed)) if seed % 2 else _figure(seed),
    "other thing": lambda seed: _figure(seed) if seed % 2 else Body(bracket(seed)),
    "mirror figure": _mirrored_figure,
    "sphere": _solid(lambda rng: sphere()),
    "cylinder": _solid(lambda rng: cylinder(rng.uniform(22, 40))),
    "cone": _solid(
        lambda rng: lathe(lambda turn, level: 40.0 - 39.9 * level, rng.uniform(70, 130))
    ),
    "box": _solid(lambda rng: box(*rng.uniform([50, 72, 95], [65, 88, 115]))),
    "plate": _solid(lambda rng: plate(100.0, rng.uniform(60, 85))),
    "vase": _solid(lambda rng: lathe(_vase(rng))),
    "gear": _solid(lambda rng: lathe(_gear(rng), 25.0)),
    "marked vase": _marked(_vase, _knobbed_vase, 100.0),
    "marked gear": _marked(_gear, _worn_gear, 25.0),
}
