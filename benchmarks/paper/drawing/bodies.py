"""What is put into a scene: scans, coloured meshes, and balls that mark points."""

import numpy as np
from trimesh.creation import icosphere

from benchmarks.paper.drawing.scene import Body
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.prepared import PreparedScan

_BALL_DETAIL = 3


def scan_body(scan: PreparedScan, colors: FloatArray) -> Body:
    """The surface of a scan, sensor frame, in one colour (3,) or with one (V, 3) a vertex."""
    mesh = scan.mesh
    return Body(
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=mesh.normals,
        colors=np.broadcast_to(colors, mesh.vertices.shape),
    )


def wired_body(vertices: FloatArray, faces: IntArray, colors: FloatArray) -> Body:
    """A mesh (V, 3), (F, 3) with its edges drawn and a colour (F, 3) a face."""
    corners = vertices[faces].reshape(-1, 3)
    return Body(
        vertices=corners,
        faces=np.arange(len(corners)).reshape(-1, 3),
        normals=None,
        colors=np.repeat(colors, 3, axis=0),
        wired=True,
    )


def balls(points: FloatArray, radius: float, color: FloatArray) -> Body:
    """Balls of a radius about points (N, 3)."""
    ball = icosphere(subdivisions=_BALL_DETAIL)
    unit, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    starts = len(unit) * np.arange(len(points))[:, None, None]
    vertices = (points[:, None] + radius * unit).reshape(-1, 3)
    return Body(
        vertices=vertices,
        faces=(faces + starts).reshape(-1, 3),
        normals=np.tile(unit, (len(points), 1)),
        colors=np.broadcast_to(color, vertices.shape),
    )
