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
    look_at,
    render,
    scan_body,
)
from benchmarks.paper.views import MADE, UP, VirtualScan, mesh_of
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.pose import Pose

CUT_AT = {"armadillo": 0.60, "bunny": 0.40, MADE: 0.45}
"""Height of the cuts, as a share of the object's: through most of what overlaps."""
_RAISED = 0.22
"""How much the viewer stands above the cameras, against how far off."""
_TRUTH = PAPER + 0.3 * (QUIET - PAPER)
_TRUTH_WIDTH, _CUT_WIDTH = 7.0, 2.4


class Placed:
    """An object's scans, and the one viewpoint from which all their poses are shown.

    Args:
        name: Of the object.
        scans: Of the object.
        size: Width and height of a picture, in pixels.
        towards: Weights of the scans' viewing directions in the viewer's.
        margin: Left free around the object, as a share of the picture's shorter side.
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
        ways = [
            w * -s.world_from_sensor.rotation[:, 2] for w, s in zip(towards, scans, strict=False)
        ]
        way = np.sum(ways, axis=0)
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
        blank = np.rint(255 * np.broadcast_to(PAPER, (height + cut_height, width, 3)))
        picture, lines = blank.astype(np.uint8), []
        if poses is not None:
            in_world = self.in_world(poses)
            bodies = [
                scan_body(self.scans[k].scan, SCANS[k % len(SCANS)]).moved(pose)
                for k, pose in in_world.items()
            ]
            picture[:height] = render(bodies, self.look)
            lines = self._cut_lines(in_world, cut_height) if cut_height else []
        return Panel(picture=picture, lines=lines, title=title, notes=[(note, QUIET)])

    def in_world(self, poses: Mapping[int, Pose]) -> dict[int, Pose]:
        """World from sensor, of poses given against the first scan."""
        world_from_first = self.scans[0].world_from_sensor @ poses[0].inverse()
        return {k: world_from_first @ pose for k, pose in sorted(poses.items())}

    def _cut_lines(self, in_world: Mapping[int, Pose], height: int) -> list[Lines]:
        truth = self.object_cut()
        away = _RAISED * self.up - self.direction
        size = (self.size[0], height)
        look = look_at(truth.reshape(-1, 3), self.up, away, size, margin=0.12)
        below = np.array([0, self.size[1]])
        cuts = [
            Lines(look.pixels(self.scan_cut(k, pose)) + below, SCANS[k % len(SCANS)], _CUT_WIDTH)
            for k, pose in in_world.items()
        ]
        return [Lines(look.pixels(truth) + below, _TRUTH, _TRUTH_WIDTH), *cuts]

    def object_cut(self) -> FloatArray:
        """Segments (N, 2, 3) of the object in the plane of the cut."""
        return self._cut(self.mesh.vertices, self.mesh.faces)

    def scan_cut(self, k: int, world_from_sensor: Pose) -> FloatArray:
        """The same of a scan in a pose."""
        mesh = self.scans[k].scan.mesh
        return self._cut(world_from_sensor.apply(mesh.vertices), mesh.faces)

    def _cut(self, vertices: FloatArray, faces: IntArray) -> FloatArray:
        mesh = Trimesh(vertices, faces, process=False)
        return np.asarray(mesh_plane(mesh, self.up, self.level * self.up)).reshape(-1, 2, 3)
