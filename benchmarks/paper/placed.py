"""Scans in their poses: coloured surfaces from one viewpoint, and cuts through them."""

from collections.abc import Mapping, Sequence

import numpy as np
from trimesh import Trimesh
from trimesh.intersections import mesh_plane

from benchmarks.paper.drawing import (
    PAPER,
    QUIET,
    SCANS,
    Lines,
    Panel,
    colored,
    look_at,
    moved,
    render,
    rgb,
)
from benchmarks.paper.views import MADE, UP, VirtualScan, mesh_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose

CUT_AT = {"armadillo": 0.60, "bunny": 0.40, MADE: 0.45}
"""Height of the cuts, as a share of the object's: through most of what overlaps."""
_RAISED = 0.22
"""How much the viewer stands above the cameras, against how far off."""
_TRUTH, _TRUTH_WIDTH, _CUT_WIDTH = "#D2D3D3", 7.0, 2.4


class Placed:
    """An object's scans, and the one viewpoint from which all their poses are shown.

    ``towards`` holds weights of the first scans' viewing directions in the viewer's; ``size`` is
    that of a picture in pixels, ``margin`` what is left free, as a share of its shorter side.
    """

    def __init__(
        self,
        name: str,
        scans: Sequence[VirtualScan],
        size: tuple[int, int],
        towards: Sequence[float],
        margin: float = 0.07,
    ) -> None:
        self.scans, self.size, self.mesh = scans, size, mesh_of(name)
        self.up = np.eye(3)["xyz".index(UP[name])]
        backwards = [scan.world_from_sensor.rotation[:, 2] for scan in scans[: len(towards)]]
        way = -np.asarray(towards) @ backwards
        self.direction = way / np.linalg.norm(way) + _RAISED * self.up
        self.look = look_at(self.mesh.vertices, self.direction, self.up, size, margin)
        heights = self.mesh.vertices @ self.up
        self.level = float(heights.min() + CUT_AT[name] * np.ptp(heights))

    def panel(
        self, poses: Mapping[int, Pose] | None, title: str, note: str, cut_height: int = 0
    ) -> Panel:
        """The scans under poses ``first_from_sensor``, the first one in its true place.

        Below them, if it has any height, a level cut in their colours over that of the object.
        """
        width, height = self.size
        picture = np.full((height + cut_height, width, 3), rgb(PAPER), np.uint8)
        lines: Sequence[Lines] = ()
        if poses is not None:
            meshes = self.in_world(poses)
            picture[:height] = render(meshes, self.look)
            lines = self._cuts(meshes, cut_height) if cut_height else ()
        return Panel(picture, title, [(note, QUIET)], lines)

    def in_world(self, poses: Mapping[int, Pose]) -> list[TriangleMesh]:
        """The scans, each in its colour, in the world's frame."""
        world_from_first = self.scans[0].world_from_sensor @ poses[0].inverse()
        return [
            moved(colored(self.scans[k].scan.mesh, SCANS[k % len(SCANS)]), world_from_first @ pose)
            for k, pose in sorted(poses.items())
        ]

    def _cuts(self, meshes: Sequence[TriangleMesh], height: int) -> list[Lines]:
        truth, away = self.cut(self.mesh), _RAISED * self.up - self.direction
        look = look_at(truth.reshape(-1, 3), self.up, away, (self.size[0], height), margin=0.12)
        cuts = [(truth, _TRUTH, _TRUTH_WIDTH)]
        cuts += [(self.cut(m), SCANS[k % len(SCANS)], _CUT_WIDTH) for k, m in enumerate(meshes)]
        below = np.array([0, self.size[1]])
        return [Lines(look.pixels(cut) + below, color, width) for cut, color, width in cuts]

    def cut(self, mesh: TriangleMesh) -> FloatArray:
        """Segments (N, 2, 3) of a surface in the plane of the cut."""
        surface = Trimesh(mesh.vertices, mesh.faces, process=False)
        return np.asarray(mesh_plane(surface, self.up, self.level * self.up)).reshape(-1, 2, 3)
