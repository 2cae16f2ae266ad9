"""Scans in their poses: coloured surfaces from one viewpoint, and cuts through them."""

from collections.abc import Mapping, Sequence

import numpy as np
from trimesh import Trimesh
from trimesh.intersections import mesh_plane

from benchmarks.paper.drawing.bodies import scan_body
from benchmarks.paper.drawing.scene import Look, look_at, render
from benchmarks.paper.drawing.sheet import Sheet, draw_segments
from benchmarks.paper.drawing.style import PAPER, QUIET, SCANS
from benchmarks.paper.views import UP, VirtualScan, mesh_of
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.pose import Pose

_UPWARDS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_RAISED = 0.22
"""How much the viewer stands above the cameras, against how far off."""
_TRUTH = PAPER + 0.3 * (QUIET - PAPER)
_TRUTH_WIDTH, _CUT_WIDTH = 7.0, 2.4


class Scene:
    """An object's scans, and the one viewpoint from which all their poses are shown.

    Args:
        name: Of the object.
        scans: Of the object.
        width: Of a picture, in pixels.
        height: Of a picture, in pixels.
        cut_at: Height of the cut, as a share of the object's.
        towards: Weights of the scans' viewing directions in the viewer's.
        margin: Left free around the object, as a share of the picture's shorter side.
    """

    def __init__(
        self,
        name: str,
        scans: Sequence[VirtualScan],
        width: int,
        height: int,
        cut_at: float,
        towards: Sequence[float],
        margin: float = 0.07,
    ) -> None:
        self.name, self.scans = name, scans
        self.up = np.array(_UPWARDS[UP[name]])
        self.true = {k: scan.world_from_sensor for k, scan in enumerate(scans)}
        ways = [
            w * -s.world_from_sensor.rotation[:, 2] for w, s in zip(towards, scans, strict=False)
        ]
        way = np.sum(ways, axis=0)
        mesh = mesh_of(name)
        self.direction = way / np.linalg.norm(way) + _RAISED * self.up
        self.look = look_at(mesh.vertices, self.direction, self.up, width, height, margin)
        heights = mesh.vertices @ self.up
        self.level = float(heights.min() + cut_at * np.ptp(heights))
        self.mesh = mesh

    def picture(self, poses: Mapping[int, Pose]) -> ByteArray:
        """The scans under poses ``first_from_sensor``, the first one in its true place."""
        bodies = [
            scan_body(self.scans[k].scan, SCANS[k % len(SCANS)]).moved(pose)
            for k, pose in self.in_world(poses).items()
        ]
        return render(bodies, self.look)

    def in_world(self, poses: Mapping[int, Pose]) -> dict[int, Pose]:
        """World from sensor, of poses given against the first scan."""
        world_from_first = self.true[0] @ poses[0].inverse()
        return {k: world_from_first @ pose for k, pose in sorted(poses.items())}

    def draw_cut(
        self,
        sheet: Sheet,
        poses: Mapping[int, Pose],
        left: float,
        top: float,
        width: int,
        height: int,
    ) -> None:
        """Draw a level cut through the scans, in their colours, over that through the object."""
        axes = sheet.axes(left, top, width, height)
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
        truth = self.object_cut()
        away = _RAISED * self.up - self.direction
        look = look_at(truth.reshape(-1, 3), self.up, away, width, height, margin=0.12)
        draw_segments(axes, _flat(truth, look), _TRUTH, _TRUTH_WIDTH)
        for k, pose in self.in_world(poses).items():
            cut = self.scan_cut(k, pose)
            draw_segments(axes, _flat(cut, look), SCANS[k % len(SCANS)], _CUT_WIDTH)

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


def _flat(segments: FloatArray, look: Look) -> FloatArray:
    return look.pixels(segments.reshape(-1, 3)).reshape(-1, 2, 2)
