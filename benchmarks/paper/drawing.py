"""How the study's figures look: surfaces under soft light, and sheets of pictures with captions."""

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from trimesh.creation import icosphere

from benchmarks.study.optional import need
from scanweld.evaluation.turntable import joined
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.shading import looking_from

PAPER, INK, QUIET, CLAY = "#FBFAF7", "#23272F", "#737880", "#D3CCC0"
WALL, BACK_PLANE, ACCENT, SECOND = "#E6D3A8", "#DCE4EE", "#C2274B", "#7A4FA3"
SCANS = ("#D9734E", "#3E82B0", "#E3B04B", "#62A07E")
"""One a scan, in the order of the scans."""
_HEAT = ("#27416B", "#4C86B8", "#A9CBD9", "#F3EBD7", "#F2BE62", "#E0703E", "#A31B36")
_LAMP, _LAMP_LIGHT, _SKY_LIGHT = np.array([-0.52, -0.62, -0.59]), 0.55, 0.50
"""Direction to the lamp (x right, y down, z away from the viewer), and how bright all is."""
_INSIDE_GREY, _INSIDE_LIGHT = 0.45, 0.72
"""The inside of a scan is greyer and darker than its outside."""
_OVERSAMPLING = 2
_DPI, _TEXT, _SMALL, _GAP = 100, 27, 23, 16
_PALETTES, _MOST_BYTES = (256, 128, 64), 400_000


def rgb(color: str) -> FloatArray:
    """(3,) red, green and blue from 0 to 255."""
    return np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)], float)


def heat_colors(values: FloatArray, low: float, high: float) -> FloatArray:
    """Colours (N, 3) of values (N,), cold at ``low`` and below, hot at ``high`` and above."""
    shares, at = (values - low) / (high - low), np.linspace(0.0, 1.0, len(_HEAT))
    channels = np.stack([rgb(color) for color in _HEAT], axis=1)
    return np.stack([np.interp(shares, at, channel) for channel in channels], axis=-1)


def colored(mesh: TriangleMesh, color: str | FloatArray) -> TriangleMesh:
    """A mesh in one colour, or with one (V, 3) a vertex."""
    colors = np.broadcast_to(rgb(color) if isinstance(color, str) else color, mesh.vertices.shape)
    return replace(mesh, colors=np.rint(colors).astype(np.uint8))


def moved(mesh: TriangleMesh, pose: Pose) -> TriangleMesh:
    """The same mesh elsewhere."""
    normals = None if mesh.normals is None else pose.turn(mesh.normals)
    return replace(mesh, vertices=pose.apply(mesh.vertices), normals=normals)


def balls(points: FloatArray, radius: float, color: str) -> TriangleMesh:
    """Balls of a radius about points (N, 3)."""
    ball = icosphere(subdivisions=3)
    unit, starts = np.asarray(ball.vertices), np.arange(len(points))[:, None, None]
    mesh = TriangleMesh(
        vertices=(points[:, None] + radius * unit).reshape(-1, 3),
        faces=(np.asarray(ball.faces) + len(unit) * starts).reshape(-1, 3),
        normals=np.tile(unit, (len(points), 1)),
    )
    return colored(mesh, color)


class Look(NamedTuple):
    """Where a picture is taken from: x right, y down. Its camera is finer than the picture."""

    picture_from_world: Pose
    camera: Camera

    def pixels(self, points: FloatArray) -> FloatArray:
        """Where points (..., 3) lie in the picture: (..., 2)."""
        flat = self.picture_from_world.apply(points.reshape(-1, 3))
        pixels = (self.camera.project(flat)[0] + 0.5) / _OVERSAMPLING - 0.5
        return pixels.reshape(*points.shape[:-1], 2)


def look_at(
    points: FloatArray,
    direction: Sequence[float] | FloatArray,
    up: Sequence[float] | FloatArray,
    size: tuple[int, int],
    margin: float = 0.04,
) -> Look:
    """Look at points (N, 3), orthographically, so that they fill the middle of a picture.

    Args:
        points: (N, 3).
        direction: (3,) from the points to the viewer.
        up: (3,) what is up in the picture.
        size: Width and height of the picture, in pixels.
        margin: Left free on every side, as a share of the shorter side.
    """
    pose = looking_from(np.asarray(direction, float), np.asarray(up, float))
    plain = Camera(
        model=CameraModel.ORTHOGRAPHIC, width=1, height=1, fx=1.0, fy=1.0, cx=0.0, cy=0.0
    )
    return Look(picture_from_world=pose, camera=_enlarged(plain, pose.apply(points), size, margin))


def look_through(scan: PreparedScan, size: tuple[int, int]) -> Look:
    """Look at what a scan's camera sees, enlarged to fill a picture."""
    camera = _enlarged(scan.image.camera, scan.mesh.vertices, size, margin=0.05)
    return Look(picture_from_world=Pose.identity(), camera=camera)


def _enlarged(camera: Camera, points: FloatArray, size: tuple[int, int], margin: float) -> Camera:
    """A camera with larger pictures, filled by what points (N, 3) show."""
    pixels, whole = camera.project(points)[0], _OVERSAMPLING * np.array(size)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    scale = float(((whole - 2 * margin * min(whole)) / (high - low)).min())
    middle = 0.5 * (low + high) - [camera.cx, camera.cy]
    (width, height), (cx, cy) = whole.tolist(), (0.5 * (whole - 1) - scale * middle).tolist()
    focal = {"fx": scale * camera.fx, "fy": scale * camera.fy}
    return replace(camera, width=width, height=height, cx=cx, cy=cy, **focal)


def render(meshes: Sequence[TriangleMesh], look: Look) -> ByteArray:
    """The picture (H, W, 3) of coloured meshes in one frame."""
    whole = joined(*meshes)
    faces, points = whole.faces, look.picture_from_world.apply(whole.vertices)
    normals = [m.normals if m.normals is not None else np.nan * m.vertices for m in meshes]
    turned = look.picture_from_world.turn(np.concatenate(normals))
    colors = np.concatenate([m.colors for m in meshes if m.colors is not None]).astype(float)
    depth, face_of = render_depth(points, faces, look.camera)
    seen = face_of >= 0
    corners = faces[face_of[seen]]
    shares = _barycentric(points[corners], look.camera.unproject_image(depth)[seen])
    flat = _unit(face_normals(points, corners))
    smooth = np.einsum("nk,nkc->nc", shares, turned[corners])
    color = np.einsum("nk,nkc->nc", shares, colors[corners])
    inside = _INSIDE_LIGHT * (color + _INSIDE_GREY * (color.mean(axis=1, keepdims=True) - color))
    picture = np.broadcast_to(rgb(PAPER), (*depth.shape, 3)).copy()
    picture[seen] = _lit(
        np.where(flat[:, 2:] < 0, color, inside),
        _unit(np.where(np.isfinite(smooth), smooth, flat)),
    )
    k, (height, width) = _OVERSAMPLING, depth.shape
    cells = picture.reshape(height // k, k, width // k, k, 3).mean(axis=(1, 3))
    return np.rint(cells).astype(np.uint8)


def _lit(color: FloatArray, normals: FloatArray) -> FloatArray:
    """Colours (N, 3) of a surface under the lamp and the sky; normals on either side."""
    normals = np.where(normals[:, 2:] > 0, -normals, normals)
    # Wrapped light: soft, as from a window rather than a bulb.
    lamp = _LAMP_LIGHT * np.maximum((normals @ _LAMP + 0.25) / 1.25, 0.0)
    sky = _SKY_LIGHT * (1.0 - 0.3 * normals[:, 1] - 0.2 * (1.0 + normals[:, 2]))
    return np.clip(color * (0.1 + lamp + sky)[:, None], 0.0, 255.0)


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


class Lines(NamedTuple):
    """Segments (N, 2, 2) drawn over a picture, in its pixels."""

    segments: FloatArray
    color: str
    width: float


class Panel(NamedTuple):
    """A picture, below it a title and notes, each in its colour, and lines over it."""

    picture: ByteArray
    title: str = ""
    notes: Sequence[tuple[str, str]] = ()
    lines: Sequence[Lines] = ()


def draw_sheet(rows: Sequence[Sequence[Panel]], path: Path, *, letters: bool = True) -> None:
    """Lay rows of panels out on a sheet, pixel on pixel, and write it as a small PNG."""
    figures, agg = need("matplotlib.figure"), need("matplotlib.backends.backend_agg")
    collections = need("matplotlib.collections").LineCollection
    feet = [_GAP + round(1.5 * _TEXT) * (1 + max(len(p.notes) for p in row)) for row in rows]
    heights = [max(p.picture.shape[0] for p in row) for row in rows]
    widths = [sum(p.picture.shape[1] for p in row) for row in rows]
    width, height = max(widths), sum(feet) + sum(heights) + _GAP
    figure = figures.Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=PAPER)
    names, top = iter("abcdefghijklmnop"), _GAP
    for row, row_width, high, foot in zip(rows, widths, heights, feet, strict=True):
        left = (width - row_width) / 2
        for panel in row:
            h, w = panel.picture.shape[:2]
            axes = figure.add_axes(
                (left / width, 1 - (top + h) / height, w / width, h / height), frameon=False
            )
            axes.imshow(panel.picture, interpolation="none", aspect="auto")
            axes.set(xlim=(-0.5, w - 0.5), ylim=(h - 0.5, -0.5), xticks=[], yticks=[])
            for lines in panel.lines:
                look = {"linewidths": 72 * lines.width / _DPI, "capstyle": "round"}
                axes.add_collection(collections(list(lines.segments), colors=lines.color, **look))
            letter = rf"$\bf{{({next(names)})}}$ " if letters and panel.title else ""
            told = [(letter + panel.title, INK, _TEXT), *((*note, _SMALL) for note in panel.notes)]
            for k, (text, color, size) in enumerate(told):
                down = top + high + _GAP + 1.45 * _TEXT * (k + 0.5)
                at = ((left + w / 2) / width, 1 - down / height)
                figure.text(*at, text, color=color, ha="center", va="center", size=72 * size / _DPI)
            left += w
        top += high + foot
    canvas = agg.FigureCanvasAgg(figure)
    canvas.draw()
    path.write_bytes(_png(np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])))


def _png(picture: ByteArray) -> bytes:
    """A PNG of so few colours that the file stays small."""
    image, buffer = need("PIL.Image"), io.BytesIO()
    for colors in _PALETTES:
        buffer = io.BytesIO()
        few = image.fromarray(picture).quantize(colors, image.Quantize.MEDIANCUT, kmeans=2)
        few.save(buffer, "PNG", optimize=True)
        if buffer.tell() <= _MOST_BYTES:
            break
    return buffer.getvalue()


def _barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Shares (N, 3) of the corners (N, 3, 3) of triangles in points (N, 3) on them, by (x, y)."""
    a, b, c = (corners[:, k, :2] for k in range(3))
    p = points[:, :2]
    cross = lambda v, w: v[:, 0] * w[:, 1] - v[:, 1] * w[:, 0]  # noqa: E731
    area = cross(b - a, c - a)
    shares = np.stack([cross(b - p, c - p), cross(c - p, a - p), cross(a - p, b - p)], axis=1)
    return shares / np.where(area != 0, area, 1.0)[:, None]
