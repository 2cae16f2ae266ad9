"""Bodies under soft light: two lamps, the sky, and shade where a surface is hemmed in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.paper.drawing.shade import ambient_occlusion
from benchmarks.paper.drawing.style import INK, PAPER
from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.shading import barycentric, looking_from

_OVERSAMPLING = 2
_GAMMA = 2.2
_KEY, _KEY_LIGHT = np.array([-0.50, -0.62, -0.60]), 0.80
_FILL, _FILL_LIGHT = np.array([0.80, -0.05, -0.60]), 0.22
"""Directions to the lamps (x right, y down, z away from the viewer), and how bright they are."""
_SKY_LIGHT = 0.52
_GLOSS, _GLOSS_POWER = 0.05, 24.0
_BACK_GREY, _BACK_LIGHT = 0.45, 0.72
"""The inside of a scan is greyer and darker than its outside."""
_OUTLINE, _OUTLINE_STEP = 0.45, 0.012
"""How dark outlines are, and the step in depth that makes one, as a share of the picture."""
_WIRE = 0.38
_SHADE_STEP = 3


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Body:
    """A surface to be drawn.

    Attributes:
        vertices: (V, 3).
        faces: (F, 3), counter-clockwise as seen from outside.
        normals: (V, 3) for smooth shading, or None.
        colors: (V, 3) sRGB from 0 to 1.
        wired: Whether the edges of the faces are drawn.
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None
    colors: FloatArray
    wired: bool = False

    def moved(self, pose: Pose) -> "Body":
        """The same body elsewhere."""
        return Body(
            vertices=pose.apply(self.vertices),
            faces=self.faces,
            normals=None if self.normals is None else pose.turn(self.normals),
            colors=self.colors,
            wired=self.wired,
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Look:
    """Where a picture is taken from: orthographic, x right, y down.

    Attributes:
        picture_from_world: The picture's axes.
        camera: Its pixels.
    """

    picture_from_world: Pose
    camera: Camera

    def pixels(self, points: FloatArray) -> FloatArray:
        """Where points (N, 3) lie in the picture: (N, 2)."""
        return self.camera.project(self.picture_from_world.apply(points))[0]


def look_at(
    points: FloatArray,
    direction: Sequence[float] | FloatArray,
    up: Sequence[float] | FloatArray,
    width: int,
    height: int,
    margin: float = 0.04,
) -> Look:
    """Look at points so that they all are in the middle of a picture and fill it.

    Args:
        points: (N, 3).
        direction: (3,) from the points to the viewer.
        up: (3,) what is up in the picture.
        width: Of the picture, in pixels.
        height: Of the picture, in pixels.
        margin: Left free on every side, as a share of the shorter side.
    """
    pose = looking_from(np.asarray(direction, float), np.asarray(up, float))
    seen = pose.apply(points)[:, :2]
    low, high = seen.min(axis=0), seen.max(axis=0)
    room = np.array([width, height]) - 2 * margin * min(width, height)
    scale = float((room / (high - low)).min())
    centre = 0.5 * (np.array([width, height]) - 1) - scale * 0.5 * (low + high)
    camera = Camera(
        model=CameraModel.ORTHOGRAPHIC,
        width=width,
        height=height,
        fx=scale,
        fy=scale,
        cx=float(centre[0]),
        cy=float(centre[1]),
    )
    return Look(picture_from_world=pose, camera=camera)


def render(bodies: Sequence[Body], look: Look) -> ByteArray:
    """The picture (H, W, 3) of bodies in one frame."""
    vertices, faces = _joined(bodies)
    points = look.picture_from_world.apply(vertices)
    camera = _finer(look.camera)
    depth, face_of = render_depth(points, faces, camera)
    seen = face_of >= 0
    corners = faces[face_of[seen]]
    shares = barycentric(points[corners], camera.unproject_image(depth)[seen])
    flat = _unit(face_normals(points, corners))
    outside = flat[:, 2] < 0
    normals = _normals(bodies, look, corners, shares, flat)
    color = np.einsum("nk,nkc->nc", shares, np.concatenate([b.colors for b in bodies])[corners])
    color = np.where(outside[:, None], color, _inside(color))
    wired = np.repeat([b.wired for b in bodies], [len(b.faces) for b in bodies])[face_of[seen]]
    lines = _wires(points[corners], shares, camera) * wired
    color = color * (1 - _WIRE * lines)[:, None]
    open_share = _open_share(depth, camera)[seen]
    picture = np.broadcast_to(PAPER, (*depth.shape, 3)).copy()
    picture[seen] = _lit(color, normals, open_share)
    strength = _OUTLINE * _outlines(depth, _OUTLINE_STEP * max(depth.shape) / camera.fx)
    picture += strength[..., None] * (INK - picture)
    return _shrunk(picture)


def _joined(bodies: Sequence[Body]) -> tuple[FloatArray, IntArray]:
    starts = np.cumsum([0, *(len(b.vertices) for b in bodies[:-1])])
    faces = [b.faces + start for b, start in zip(bodies, starts, strict=True)]
    return np.concatenate([b.vertices for b in bodies]), np.concatenate(faces)


def _finer(camera: Camera) -> Camera:
    k = _OVERSAMPLING
    return Camera(
        model=camera.model,
        width=k * camera.width,
        height=k * camera.height,
        fx=k * camera.fx,
        fy=k * camera.fy,
        cx=k * camera.cx + 0.5 * (k - 1),
        cy=k * camera.cy + 0.5 * (k - 1),
    )


def _normals(
    bodies: Sequence[Body], look: Look, corners: IntArray, shares: FloatArray, flat: FloatArray
) -> FloatArray:
    """Unit normals (N, 3) towards the viewer: smooth ones where a body has them."""
    own = [np.full_like(b.vertices, np.nan) if b.normals is None else b.normals for b in bodies]
    turned = look.picture_from_world.turn(np.concatenate(own))
    smooth = np.einsum("nk,nkc->nc", shares, turned[corners])
    normals = _unit(np.where(np.isfinite(smooth), smooth, flat))
    return np.where(normals[:, 2:] > 0, -normals, normals)


def _lit(color: FloatArray, normals: FloatArray, open_share: FloatArray) -> FloatArray:
    """Colours (N, 3) of a surface under the lamps; ``open_share`` (N,) of the sky reaches it."""
    key, fill = (_unit(v[None])[0] for v in (_KEY, _FILL))
    sky = _SKY_LIGHT * (0.65 - 0.35 * normals[:, 1])
    # Wrapped light: soft, as from a window rather than a bulb.
    lamps = _KEY_LIGHT * np.maximum((normals @ key + 0.25) / 1.25, 0.0)
    lamps += _FILL_LIGHT * np.maximum(normals @ fill, 0.0)
    light = sky * open_share + lamps * (0.45 + 0.55 * open_share)
    half = _unit((key + np.array([0.0, 0.0, -1.0]))[None])[0]
    gloss = _GLOSS * np.maximum(normals @ half, 0.0) ** _GLOSS_POWER
    linear = color**_GAMMA * light[:, None] + gloss[:, None]
    return np.clip(linear, 0.0, 1.0) ** (1 / _GAMMA)


def _inside(color: FloatArray) -> FloatArray:
    grey = color.mean(axis=1, keepdims=True)
    return _BACK_LIGHT * (color + _BACK_GREY * (grey - color))


def _wires(corners: FloatArray, shares: FloatArray, camera: Camera) -> FloatArray:
    """How much (N,) a pixel lies on an edge of its triangle: 1 within half a pixel."""
    flat = corners[..., :2] * camera.fx
    a, b, c = flat[:, 0], flat[:, 1], flat[:, 2]
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    sides = np.stack([np.linalg.norm(v, axis=1) for v in (c - b, a - c, b - a)], axis=1)
    away = (shares * (area[:, None] / np.maximum(sides, 1e-12))).min(axis=1)
    return np.clip(1.6 - away, 0.0, 1.0)


def _outlines(depth: FloatArray, step: float) -> FloatArray:
    """Where (H, W) the surface ends in front of something: 1, elsewhere 0."""
    filled = np.where(np.isfinite(depth), depth, np.inf)
    padded = np.pad(filled, 1, mode="edge")
    around = (padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1])
    farthest = np.maximum.reduce(around)
    is_edge: BoolArray = np.isfinite(depth) & (farthest > filled + step)
    return is_edge.astype(np.float64)


def _open_share(depth: FloatArray, camera: Camera) -> FloatArray:
    """How much of the sky (H, W) reaches a surface; it is smooth, so a coarse image will do."""
    k = _SHADE_STEP
    coarse = ambient_occlusion(depth[::k, ::k], camera.fx / k)
    return coarse.repeat(k, axis=0).repeat(k, axis=1)[: depth.shape[0], : depth.shape[1]]


def _shrunk(picture: FloatArray) -> ByteArray:
    k = _OVERSAMPLING
    height, width = picture.shape[0] // k, picture.shape[1] // k
    cells = picture.reshape(height, k, width, k, 3).mean(axis=(1, 3))
    return np.rint(255 * np.clip(cells, 0, 1)).astype(np.uint8)


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)
