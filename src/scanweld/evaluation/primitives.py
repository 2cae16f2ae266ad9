"""Plain objects that slide or turn upon themselves: what must not be put together wrongly."""

import numpy as np
import trimesh

from scanweld.geometry.mesh import TriangleMesh


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


def _converted(mesh: trimesh.Trimesh) -> TriangleMesh:
    return TriangleMesh(vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))
