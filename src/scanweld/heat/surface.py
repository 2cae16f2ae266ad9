"""What heat spreads on: the artificial mesh of the paper, or the front alone, for comparison."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray, frozen
from scanweld.geometry.camera import Camera
from scanweld.heat.artificial_mesh import border_edges, close_front
from scanweld.heat.front import FrontMesh

SurfaceKind = Literal["closed", "open", "clamped"]
"""The front closed by walls and a back plane (paper 3.1); the front alone, no heat flowing over
its rims (Neumann); the same with rims that are kept cold (Dirichlet)."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HeatSurface:
    """A mesh and what holds at its rims.

    Attributes:
        vertices: (V, 3), sensor frame; the front's vertices come first.
        faces: (F, 3).
        num_front: How many vertices are the front's.
        cold: (R,) vertices at which there is no heat at any time; others let none out.
    """

    vertices: FloatArray
    faces: IntArray
    num_front: int
    cold: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, np.float64, (None, 3)))
        object.__setattr__(self, "faces", frozen(self.faces, np.int64, (None, 3)))
        object.__setattr__(self, "cold", frozen(self.cold, np.int64, (None,)))


def heat_surface(
    front: FrontMesh, camera: Camera, diameter: float, kind: SurfaceKind
) -> HeatSurface:
    """The surface of a kind over a front.

    Args:
        front: At least one face.
        camera: Of the front's range image; pinhole or orthographic.
        diameter: Of the scan, in the same unit.
        kind: Closed, open or clamped.
    """
    nowhere = np.zeros(0, dtype=np.int64)
    if kind == "closed":
        mesh = close_front(front, camera, diameter)
        return HeatSurface(
            vertices=mesh.vertices, faces=mesh.faces, num_front=mesh.num_front, cold=nowhere
        )
    return HeatSurface(
        vertices=front.points,
        faces=front.faces,
        num_front=len(front.points),
        cold=np.unique(border_edges(front.faces)) if kind == "clamped" else nowhere,
    )
