"""How the study's figures look: surfaces under soft light, and sheets of panels with captions."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.study.optional import need
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.shading import barycentric, looking_from


def _srgb(*codes: str) -> FloatArray:
    return np.array([[int(code[k : k + 2], 16) for k in (1, 3, 5)] for code in codes]) / 255.0


PAPER, INK, QUIET, CLAY, WALL, BACK_PLANE = _srgb(
    "#FBFAF7", "#23272F", "#737880", "#D3CCC0", "#E6D3A8", "#DCE4EE"
)
ACCENT, SECOND = _srgb("#C2274B", "#7A4FA3")
SCANS = _srgb("#D9734E", "#3E82B0", "#E3B04B", "#62A07E")
"""One a scan, in the order of the scans."""
_HEAT = _srgb("#27416B", "#4C86B8", "#A9CBD9", "#F3EBD7", "#F2BE62", "#E0703E", "#A31B36")
_LAMP, _LAMP_LIGHT, _SKY_LIGHT = np.array([-0.52, -0.62, -0.59]), 0.55, 0.50
"""Direction to the lamp (x right, y down, z away from the viewer), and how bright all is."""
_INSIDE_GREY, _INSIDE_LIGHT = 0.45, 0.72
"""The inside of a scan is greyer and darker than its outside."""
_OVERSAMPLING = 2
_DPI, _TEXT, _SMALL, _GAP = 100, 27, 23, 16
_PALETTES, _MOST_BYTES = (256, 128, 64), 400_000


def heat_colors(values: FloatArray, low: float, high: float) -> FloatArray:
    """Colours (N, 3) of values (N,), cold at ``low`` and below, hot at ``high`` and above."""
    shares, at = (values - low) / (high - low), np.linspace(0.0, 1.0, len(_HEAT))
    return np.stack([np.interp(shares, at, channel) for channel in _HEAT.T], axis=-1)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Body:
    """A surface to be drawn.

    Attributes:
        vertices: (V, 3).
        faces: (F, 3), counter-clockwise as seen from outside.
        normals: (V, 3) for smooth shading; NaN for the faces' own.
        colors: (V, 3) sRGB from 0 to 1.
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray
    colors: FloatArray

    def moved(self, pose: Pose) -> "Body":
        """The same body elsewhere."""
        vertices, normals = pose.apply(self.vertices), pose.turn(self.normals)
        return replace(self, vertices=vertices, normals=normals)


def scan_body(scan: PreparedScan, colors: FloatArray) -> Body:
    """The surface of a scan, sensor frame, in one colour (3,) or with one (V, 3) a vertex."""
    mesh, shape = scan.mesh, scan.mesh.vertices.shape
    normals = np.full(shape, np.nan) if mesh.normals is None else mesh.normals
    colors = np.broadcast_to(colors, shape)
    return Body(vertices=mesh.vertices, faces=mesh.faces, normals=normals, colors=colors)


def faceted_body(vertices: FloatArray, faces: IntArray, colors: FloatArray) -> Body:
    """A mesh (V, 3), (F, 3) with a colour (F, 3) a face."""
    corners = vertices[faces].reshape(-1, 3)
    return Body(
        vertices=corners,
        faces=np.arange(len(corners)).reshape(-1, 3),
        normals=np.full_like(corners, np.nan),
        colors=np.repeat(colors, 3, axis=0),
    )


def balls(points: FloatArray, radius: float, color: FloatArray) -> Body:
    """Balls of a radius about points (N, 3)."""
    ball = need("trimesh").creation.icosphere(subdivisions=3)
    unit, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    starts = len(unit) * np.arange(len(points))[:, None, None]
    vertices = (points[:, None] + radius * unit).reshape(-1, 3)
    return Body(
        vertices=vertices,
        faces=(faces + starts).reshape(-1, 3),
        normals=np.tile(unit, (len(points), 1)),
        colors=np.broadcast_to(color, vertices.shape),
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Look:
    """Where a picture is taken from: x right, y down."""

    picture_from_world: Pose
    camera: Camera

    def pixels(self, points: FloatArray) -> FloatArray:
        """Where points (..., 3) lie in the picture: (..., 2)."""
        flat = self.picture_from_world.apply(points.reshape(-1, 3))
        return self.camera.project(flat)[0].reshape(*points.shape[:-1], 2)


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
    seen = pose.apply(points)[:, :2]
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = float(((np.array(size) - 2 * margin * min(size)) / (high - low)).min())
    return Look(picture_from_world=pose, camera=_camera(scale, 0.5 * (low + high), size))


def look_through(scan: PreparedScan, size: tuple[int, int], margin: float = 0.05) -> Look:
    """Look at what a scan's camera sees, with its own pixels enlarged to fill a picture."""
    camera = scan.image.camera
    pixels = np.argwhere(np.isfinite(scan.image.depth))[:, ::-1]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    scale = float((np.array(size) * (1 - 2 * margin) / (high - low)).min())
    middle = (0.5 * (low + high) - [camera.cx, camera.cy]) * scale
    cx, cy = 0.5 * (np.array(size) - 1) - middle
    larger = replace(
        camera,
        width=size[0],
        height=size[1],
        fx=scale * camera.fx,
        fy=scale * camera.fy,
        cx=float(cx),
        cy=float(cy),
    )
    return Look(picture_from_world=Pose.identity(), camera=larger)


def _camera(scale: float, middle: FloatArray, size: tuple[int, int]) -> Camera:
    cx, cy = 0.5 * (np.array(size) - 1) - scale * middle
    width, height = size
    return Camera(
        model=CameraModel.ORTHOGRAPHIC,
        width=width,
        height=height,
        fx=scale,
        fy=scale,
        cx=float(cx),
        cy=float(cy),
    )


def render(bodies: Sequence[Body], look: Look) -> ByteArray:
    """The picture (H, W, 3) of bodies in one frame."""
    starts = np.cumsum([0, *(len(body.vertices) for body in bodies[:-1])])
    faces = np.concatenate([b.faces + start for b, start in zip(bodies, starts, strict=True)])
    vertices, normals, colors = (
        np.concatenate([getattr(body, name) for body in bodies])
        for name in ("vertices", "normals", "colors")
    )
    points = look.picture_from_world.apply(vertices)
    camera = _finer(look.camera)
    depth, face_of = render_depth(points, faces, camera)
    seen = face_of >= 0
    corners = faces[face_of[seen]]
    shares = barycentric(points[corners], camera.unproject_image(depth)[seen])
    flat = _unit(face_normals(points, corners))
    smooth = _mixed(shares, look.picture_from_world.turn(normals)[corners])
    color = _mixed(shares, colors[corners])
    inside = _INSIDE_LIGHT * (color + _INSIDE_GREY * (color.mean(axis=1, keepdims=True) - color))
    picture = np.broadcast_to(PAPER, (*depth.shape, 3)).copy()
    picture[seen] = _lit(
        np.where(flat[:, 2:] < 0, color, inside),
        _unit(np.where(np.isfinite(smooth), smooth, flat)),
    )
    k, (height, width) = _OVERSAMPLING, (look.camera.height, look.camera.width)
    cells = picture.reshape(height, k, width, k, 3).mean(axis=(1, 3))
    return np.rint(255 * cells).astype(np.uint8)


def _finer(camera: Camera) -> Camera:
    k = _OVERSAMPLING
    return replace(
        camera,
        width=k * camera.width,
        height=k * camera.height,
        fx=k * camera.fx,
        fy=k * camera.fy,
        cx=k * camera.cx + 0.5 * (k - 1),
        cy=k * camera.cy + 0.5 * (k - 1),
    )


def _mixed(shares: FloatArray, of_corners: FloatArray) -> FloatArray:
    return np.einsum("nk,nkc->nc", shares, of_corners)


def _lit(color: FloatArray, normals: FloatArray) -> FloatArray:
    """Colours (N, 3) of a surface under the lamp and the sky; normals on either side."""
    normals = np.where(normals[:, 2:] > 0, -normals, normals)
    # Wrapped light: soft, as from a window rather than a bulb.
    lamp = _LAMP_LIGHT * np.maximum((normals @ _LAMP + 0.25) / 1.25, 0.0)
    sky = _SKY_LIGHT * (1.0 - 0.3 * normals[:, 1] - 0.2 * (1.0 + normals[:, 2]))
    return np.clip(color * (0.1 + lamp + sky)[:, None], 0.0, 1.0)


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Segments (N, 2, 2) drawn over a picture, in its pixels."""

    segments: FloatArray
    color: FloatArray
    width: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Panel:
    """A picture with lines over it, and below it a title and notes, each in its colour."""

    picture: ByteArray
    lines: Sequence[Lines] = ()
    title: str = ""
    notes: Sequence[tuple[str, FloatArray]] = ()


def draw_sheet(rows: Sequence[Sequence[Panel]], path: Path, *, letters: bool = True) -> None:
    """Lay rows of panels out on a sheet, each with its letter and title, and write it as a PNG.

    Raises:
        InputError: If matplotlib is not installed.
    """
    need("matplotlib")
    figures, agg = need("matplotlib.figure"), need("matplotlib.backends.backend_agg")
    feet = [_GAP + round(1.5 * _TEXT) * (1 + max(len(p.notes) for p in row)) for row in rows]
    heights = [max(p.picture.shape[0] for p in row) for row in rows]
    width = max(sum(p.picture.shape[1] for p in row) for row in rows)
    height = sum(feet) + sum(heights) + _GAP
    figure = figures.Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=tuple(PAPER))
    names, top = iter("abcdefghijklmnop"), _GAP
    for row, high, foot in zip(rows, heights, feet, strict=True):
        left = (width - sum(p.picture.shape[1] for p in row)) / 2
        for panel in row:
            own_height, own_width = panel.picture.shape[:2]
            box = (left / width, 1 - (top + own_height) / height, own_width / width)
            _place(figure.add_axes((*box, own_height / height)), panel)
            letter = rf"$\bf{{({next(names)})}}$ " if letters and panel.title else ""
            lines = [(letter + panel.title, INK, _TEXT), *((*n, _SMALL) for n in panel.notes)]
            for k, (text, color, size) in enumerate(lines):
                at = top + high + _GAP + 1.45 * _TEXT * (k + 0.5)
                style = {"ha": "center", "va": "center", "fontsize": 72.0 * size / _DPI}
                middle = (left + own_width / 2) / width
                figure.text(middle, 1 - at / height, text, color=tuple(color), **style)
            left += own_width
        top += high + foot
    canvas = agg.FigureCanvasAgg(figure)
    canvas.draw()
    path.write_bytes(_png(np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])))


def _place(axes: Any, panel: Panel) -> None:
    """Put a picture down, pixel on pixel, and draw its lines in its pixels."""
    collections = need("matplotlib.collections")
    height, width = panel.picture.shape[:2]
    axes.set_axis_off()
    axes.imshow(panel.picture, interpolation="none", aspect="auto")
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    for lines in panel.lines:
        drawn = collections.LineCollection(
            list(lines.segments), colors=[tuple(lines.color)], linewidths=72.0 * lines.width / _DPI
        )
        drawn.set_capstyle("round")
        axes.add_collection(drawn)


def _png(picture: ByteArray) -> bytes:
    """A PNG of so few colours that the file stays small."""
    image_module = need("PIL.Image")
    image = image_module.fromarray(picture)
    png = b""
    for colors in _PALETTES:
        buffer = io.BytesIO()
        few = image.quantize(colors, image_module.Quantize.MEDIANCUT, kmeans=2)
        few.save(buffer, "PNG", optimize=True)
        png = buffer.getvalue()
        if len(png) <= _MOST_BYTES:
            break
    return png
