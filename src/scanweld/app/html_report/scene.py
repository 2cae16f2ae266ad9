"""The model as the screen shows it, light enough for a page, with what is known at each vertex."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanweld.app.html_report.buffers import box_around, directions, packed, quantised, steps
from scanweld.app.html_report.colors import (
    BORDER,
    RESIDUAL_STOPS,
    SUPPORT_STOPS,
    UNKNOWN,
    along,
    rgb,
    support_colors,
)
from scanweld.app.html_report.orientation import Orientation
from scanweld.app.html_report.simplify import cluster_faces, cluster_means, cluster_vertices
from scanweld.app.html_report.style import STYLE
from scanweld.app.html_report.surface_check import (
    OpenBorders,
    SurfaceCheck,
    median_edge,
    spread,
)
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, vertex_normals

NO_VALUE = np.iinfo(np.uint8).max
"""Byte that says that a vertex has no residual."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scene:
    """What is drawn.

    Attributes:
        mesh: With normals, and colours if the model has them.
        borders: (B, 2) vertices of the open borders' edges, those of the model before thinning.
        residual: (V,) in the scans' unit, NaN where unknown; or None.
        support: (V,) scans; or None.
        residual_end: Residual at the end of the colour scale.
        points: (N, 3) of all scans, thinned; or None.
        point_normals: (N, 3).
        point_scan: (N,) number of the scan, in the order of ``check.points``.
    """

    mesh: TriangleMesh
    borders: IntArray
    residual: FloatArray | None = None
    support: IntArray | None = None
    residual_end: float = 1.0
    points: FloatArray | None = None
    point_normals: FloatArray | None = None
    point_scan: IntArray | None = None

    def residual_colors(self) -> ByteArray | None:
        """(V, 3), or None where nothing was measured."""
        if self.residual is None:
            return None
        return along(RESIDUAL_STOPS, self.residual / self.residual_end)

    def support_colors(self) -> ByteArray | None:
        """(V, 3), open borders marked; or None where nothing was measured."""
        if self.support is None:
            return None
        colors = support_colors(self.support)
        on_border = np.zeros(len(colors), bool)
        on_border[self.borders.ravel()] = True
        colors[spread(on_border, self.mesh.faces, 1)] = rgb(BORDER)
        return colors


def make_scene(mesh: TriangleMesh, borders: OpenBorders, check: SurfaceCheck | None) -> Scene:
    """Thin the model and the scans to what a page can hold."""
    cluster = cluster_vertices(mesh.vertices, STYLE.max_shown)
    vertices = cluster_means(cluster, mesh.vertices)
    faces = cluster_faces(cluster, mesh.faces)
    colors = None
    if mesh.colors is not None:
        colors = np.rint(cluster_means(cluster, mesh.colors.astype(float))).astype(np.uint8)
    shown = TriangleMesh(
        vertices=vertices, faces=faces, normals=vertex_normals(vertices, faces), colors=colors
    )
    edges = cluster[borders.edges]
    edges = edges[edges[:, 0] != edges[:, 1]]
    if check is None:
        return Scene(mesh=shown, borders=edges)
    residual = cluster_means(cluster, check.residual[:, None])[:, 0]
    known = residual[np.isfinite(residual)]
    end = float(np.quantile(known, STYLE.residual_quantile)) if len(known) else 0.0
    support = np.rint(cluster_means(cluster, check.support[:, None].astype(float))[:, 0])
    points, normals, number = _thinned(check)
    return Scene(
        mesh=shown,
        borders=edges,
        residual=residual,
        support=support.astype(np.int64),
        residual_end=end or 1.0,
        points=points,
        point_normals=normals,
        point_scan=number,
    )


def _thinned(check: SurfaceCheck) -> tuple[FloatArray, FloatArray, IntArray]:
    """Points of all scans, the model's normals there, and the scans' numbers."""
    total = sum(map(len, check.points.values()))
    rng = np.random.default_rng(0)  # evenly strided points of a grid would show its columns
    points, directions_, numbers = [], [], []
    for k, (name, all_points) in enumerate(check.points.items()):
        wanted = len(all_points) * min(total, STYLE.max_shown) // max(total, 1)
        chosen = np.sort(rng.permutation(len(all_points))[:wanted])
        points.append(all_points[chosen])
        directions_.append(check.normals[check.nearest[name][chosen]])
        numbers.append(np.full(wanted, k))
    return np.concatenate(points), np.concatenate(directions_), np.concatenate(numbers)


def payload(
    scene: Scene, orientation: Orientation, scan_colors: Sequence[str]
) -> tuple[Mapping[str, Any], str]:
    """The scene for the script: a description, and the arrays as text.

    Args:
        scene: What is drawn.
        orientation: From where it is seen first.
        scan_colors: Colour of each scan, in the order of ``scene.point_scan``.
    """
    mesh = scene.mesh
    box = box_around([mesh.vertices])
    arrays: dict[str, NDArray] = {
        "position": quantised(mesh.vertices, box),
        "normal": directions(np.zeros((0, 3)) if mesh.normals is None else mesh.normals),
        "faces": steps(mesh.faces),
        "borders": steps(scene.borders),
    }
    if mesh.colors is not None:
        opaque = np.full((len(mesh.colors), 1), 255, np.uint8)
        arrays["color"] = np.concatenate([mesh.colors, opaque], axis=1)
    if scene.residual is not None and scene.support is not None:
        arrays["value"] = _values(scene.residual / scene.residual_end, scene.support)
    if scene.points is not None and scene.point_normals is not None:
        arrays["pointPosition"] = quantised(scene.points, box)
        arrays["pointNormal"] = directions(scene.point_normals)
        arrays["pointScan"] = np.asarray(scene.point_scan).astype(np.uint16)
    index, text = packed(arrays)
    description = {
        "arrays": index,
        "basis": orientation.basis(),
        "radius": float(np.linalg.norm(mesh.vertices - box.centre, axis=1).max()) / box.half,
        "pointSize": 2.4 * median_edge(mesh) / box.half,
        "residualStops": [rgb(color) for color in RESIDUAL_STOPS],
        "supportStops": [rgb(color) for color in SUPPORT_STOPS],
        "unknown": rgb(UNKNOWN),
        "border": rgb(BORDER),
        "scanColors": [rgb(color) for color in scan_colors],
    }
    return description, text


def _values(shares: FloatArray, support: IntArray) -> ByteArray:
    """(V, 4) bytes: residual (0 to 254, 255 unknown), support, and two of padding."""
    values = np.zeros((len(shares), 4), np.uint8)
    known = np.isfinite(shares)
    values[:, 0] = np.where(known, np.rint(254 * np.clip(np.nan_to_num(shares), 0, 1)), NO_VALUE)
    values[:, 1] = np.clip(support, 0, 255)
    return values
