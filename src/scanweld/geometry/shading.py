"""Shaded pictures of meshes, for looking at results and for the documentation."""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.rasterize import render_depth

_FRONT = np.array([205.0, 205.0, 200.0])
"""Red, green and blue (0 to 255) of a face seen from outside,"""
_BACK = np.array([120.0, 140.0, 190.0])
"""and of one seen from inside."""
_AMBIENT = 0.15
"""Brightness of a face seen edge-on, as a share of one that faces the viewer."""
_MARGIN = 0.03
"""Space around the object, as a share of its size in the picture."""
_OVERSAMPLING = 2
"""Pixels rendered along the edge of each pixel of the picture, against jagged outlines."""


def render_shaded(
    mesh: TriangleMesh,
    direction: ArrayLike,
    up: ArrayLike = (0.0, 0.0, 1.0),
    size: int = 600,
    *,
    smooth: bool = True,
) -> ByteArray:
    """A mesh under a headlight, seen orthographically and filling the picture.

    Colours are the mesh's own, else grey; faces seen from behind are blue.

    Args:
        mesh: With at least one face.
        direction: (3,) from the object to the viewer, of any length.
        up: (3,) what is up in the picture; must not be parallel to the direction.
        size: Pixels along the longer side of the picture.
        smooth: Shade by the vertices' normals, where there are any, rather than by the faces'.

    Returns:
        (H, W, 3) picture on white.
    """
    picture, _ = _render(mesh, direction, up, size, smooth)
    return np.rint(_shrunk(picture)).astype(np.uint8)


def render_cutout(
    mesh: TriangleMesh,
    direction: ArrayLike,
    up: ArrayLike = (0.0, 0.0, 1.0),
    size: int = 600,
    *,
    smooth: bool = True,
) -> ByteArray:
    """Like ``render_shaded``, but (H, W, 4) with the background transparent."""
    picture, seen = _render(mesh, direction, up, size, smooth)
    picture[~seen] = 0.0
    cover = _shrunk(seen[..., None].astype(np.float64))
    color = np.divide(_shrunk(picture), cover, out=np.zeros((*cover.shape[:2], 3)), where=cover > 0)
    return np.rint(np.concatenate([color, 255.0 * cover], axis=2)).astype(np.uint8)


def _render(
    mesh: TriangleMesh, direction: ArrayLike, up: ArrayLike, size: int, smooth: bool
) -> tuple[FloatArray, BoolArray]:
    """The picture (H, W, 3) at twice the size, and which of its pixels (H, W) show the mesh."""
    picture_from_world = looking_from(np.asarray(direction, float), np.asarray(up, float))
    points = picture_from_world.apply(mesh.vertices)
    camera = _camera_around(points[np.unique(mesh.faces)], size * _OVERSAMPLING)
    depth, face_of = render_depth(points, mesh.faces, camera)
    seen = face_of >= 0
    picture = np.full((*depth.shape, 3), 255.0)
    faces = mesh.faces[face_of[seen]]
    shares = barycentric(points[faces], camera.unproject_image(depth)[seen])
    flat = face_normals(points, faces)
    facing = flat[:, 2] / np.maximum(np.linalg.norm(flat, axis=1), np.finfo(float).tiny)
    light = np.abs(facing)
    if smooth and mesh.normals is not None:
        turned = picture_from_world.turn(mesh.normals)
        light = np.abs(np.einsum("nk,nk->n", shares, turned[faces][..., 2]))
    color = np.broadcast_to(_FRONT, (len(faces), 3))
    if mesh.colors is not None:
        color = np.einsum("nk,nkc->nc", shares, mesh.colors[faces].astype(float))
    color = np.where((facing > 0)[:, None], _BACK, color)
    picture[seen] = color * (_AMBIENT + (1 - _AMBIENT) * np.minimum(light, 1.0))[:, None]
    return picture, seen


def side_by_side(pictures: Sequence[ByteArray]) -> ByteArray:
    """Pictures (H, W, 3) in one row, on white, aligned at the bottom."""
    height = max(picture.shape[0] for picture in pictures)
    padded = [
        np.pad(p, ((height - p.shape[0], 0), (0, 0), (0, 0)), constant_values=255) for p in pictures
    ]
    return np.concatenate(padded, axis=1)


def write_png(path: Path | str, picture: ByteArray) -> None:
    """Write a picture (H, W, 3) as a PNG file."""
    Path(path).write_bytes(png_bytes(picture))


def png_bytes(picture: ByteArray) -> bytes:
    """A picture (H, W, 3), or (H, W, 4) with transparency, as a PNG file's bytes."""
    height, width, channels = picture.shape
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)
    rows = np.zeros((height, 1 + channels * width), np.uint8)
    rows[:, 1:] = picture.reshape(height, -1)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def looking_from(direction: FloatArray, up: FloatArray) -> Pose:
    """The picture's frame (x right, y down, z away from the viewer) from the world's."""
    away = -direction / np.linalg.norm(direction)
    right = np.cross(away, up)
    if np.linalg.norm(right) < 1e-9 * np.linalg.norm(up):
        raise ValueError("up must not be parallel to the direction")
    right = right / np.linalg.norm(right)
    rotation = nearest_rotation(np.stack([right, np.cross(away, right), away]))
    return Pose(rotation=rotation, translation=np.zeros(3))


def _camera_around(points: FloatArray, size: int) -> Camera:
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    middle, extent = 0.5 * (low + high), (1 + 2 * _MARGIN) * (high - low)
    scale = size / float(extent.max())
    width, height = (max(1, int(np.ceil(scale * e / 2)) * 2) for e in extent)
    return Camera(
        model=CameraModel.ORTHOGRAPHIC,
        width=width,
        height=height,
        fx=scale,
        fy=scale,
        cx=0.5 * (width - 1) - scale * float(middle[0]),
        cy=0.5 * (height - 1) - scale * float(middle[1]),
    )


def barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Shares (N, 3) of the corners (N, 3, 3) of triangles in points (N, 3) on them, by (x, y)."""
    a, b, c = (corners[:, k, :2] for k in range(3))
    p = points[:, :2]
    cross = lambda v, w: v[:, 0] * w[:, 1] - v[:, 1] * w[:, 0]  # noqa: E731
    area = cross(b - a, c - a)
    shares = np.stack([cross(b - p, c - p), cross(c - p, a - p), cross(a - p, b - p)], axis=1)
    return shares / np.where(area != 0, area, 1.0)[:, None]


def _shrunk(picture: FloatArray) -> ByteArray:
    k = _OVERSAMPLING
    height, width = picture.shape[0] // k, picture.shape[1] // k
    cells = picture[: k * height, : k * width].reshape(height, k, width, k, -1)
    return cells.mean(axis=(1, 3))
