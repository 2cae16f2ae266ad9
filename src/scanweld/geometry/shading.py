"""Shaded pictures of meshes, for looking at results and for the documentation."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
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


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Side:
    """A mesh under a headlight, seen from one side: rendered once, and then in any colours.

    Attributes:
        faces: (F, 3) of the mesh.
        pixels: (V, 2) places of its vertices in an image of twice the picture's size.
        face_of: (H, W) face that is seen in each pixel of that image, -1 where none is.
        light: (V,) of the vertices, or (F,) of the faces if these are flat: cosine between the
            normal and the direction to the viewer.
        is_smooth: Which of the two.
    """

    faces: IntArray
    pixels: FloatArray
    face_of: IntArray
    light: FloatArray
    is_smooth: bool

    def shaded(self, colors: ByteArray | None = None) -> ByteArray:
        """(H, W, 3) picture on white, of vertices in colours (V, 3), grey if not given."""
        total, cover = self._sums(colors)
        white = 255.0 * (_OVERSAMPLING**2 - cover[..., None])
        return np.rint((total + white) / _OVERSAMPLING**2).astype(np.uint8)

    def cutout(self, colors: ByteArray | None = None) -> ByteArray:
        """The same as (H, W, 4) with the background transparent."""
        total, cover = self._sums(colors)
        color = total / np.maximum(cover, 1)[..., None]
        alpha = 255.0 * cover[..., None] / _OVERSAMPLING**2
        return np.rint(np.concatenate([color, alpha], axis=2)).astype(np.uint8)

    def _sums(self, colors: ByteArray | None) -> tuple[FloatArray, IntArray]:
        """Sum of the colours (H, W, 3) that are seen in each pixel, and their number (H, W)."""
        height, width = (size // _OVERSAMPLING for size in self.face_of.shape)
        total, cover = np.zeros((height, width, 3)), np.zeros((height, width), np.int64)
        shown = np.zeros((0, 3), np.uint8) if colors is None else np.array(colors, order="C")
        faces = np.array(self.faces, order="C")  # writable: the kernel is compiled for one kind
        seen = (self.pixels, self.face_of, self.light, self.is_smooth)
        _shade(faces, *seen, shown, _FRONT, _BACK, total, cover)
        return total, cover


def seen_from(
    mesh: TriangleMesh,
    direction: ArrayLike,
    up: ArrayLike = (0.0, 0.0, 1.0),
    size: int = 600,
    *,
    smooth: bool = True,
) -> Side:
    """A mesh seen orthographically and filling the picture; faces seen from behind are blue.

    Args:
        mesh: With at least one face.
        direction: (3,) from the object to the viewer, of any length.
        up: (3,) what is up in the picture; must not be parallel to the direction.
        size: Pixels along the longer side of the picture.
        smooth: Shade by the vertices' normals, where there are any, rather than by the faces'.
    """
    picture_from_world = looking_from(np.asarray(direction, float), np.asarray(up, float))
    points = picture_from_world.apply(mesh.vertices)
    is_used = np.zeros(len(points), bool)
    is_used[mesh.faces.ravel()] = True
    camera = _camera_around(points[is_used], size * _OVERSAMPLING)
    if smooth and mesh.normals is not None:
        light = mesh.normals @ picture_from_world.rotation[2]
    else:
        flat = face_normals(points, mesh.faces)
        light = flat[:, 2] / np.maximum(np.linalg.norm(flat, axis=1), np.finfo(float).tiny)
    return Side(
        faces=mesh.faces,
        pixels=camera.project(points)[0],
        face_of=render_depth(points, mesh.faces, camera)[1],
        light=light,
        is_smooth=smooth and mesh.normals is not None,
    )


@njit(cache=True, nogil=True)
def _shade(
    faces: IntArray,
    pixels: FloatArray,
    face_of: IntArray,
    light: FloatArray,
    is_smooth: bool,
    colors: ByteArray,
    front: FloatArray,
    back: FloatArray,
    total: FloatArray,
    cover: IntArray,
) -> None:
    """Add up the shaded colours of the small pixels of each pixel, and count these."""
    for v in range(_OVERSAMPLING * total.shape[0]):
        for u in range(_OVERSAMPLING * total.shape[1]):
            f = face_of[v, u]
            if f < 0:
                continue
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay = pixels[a, 0] - u, pixels[a, 1] - v
            bx, by = pixels[b, 0] - u, pixels[b, 1] - v
            cx, cy = pixels[c, 0] - u, pixels[c, 1] - v
            wa, wb, wc = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
            area = wa + wb + wc  # not 0: the face is seen
            wa, wb, wc = wa / area, wb / area, wc / area
            cosine = wa * light[a] + wb * light[b] + wc * light[c] if is_smooth else light[f]
            bright = _AMBIENT + (1.0 - _AMBIENT) * min(abs(cosine), 1.0)
            row, column = v // _OVERSAMPLING, u // _OVERSAMPLING
            cover[row, column] += 1
            for k in range(3):
                color = front[k]
                if area > 0:
                    color = back[k]
                elif len(colors):
                    color = wa * colors[a, k] + wb * colors[b, k] + wc * colors[c, k]
                total[row, column, k] += color * bright


def render_shaded(
    mesh: TriangleMesh,
    direction: ArrayLike,
    up: ArrayLike = (0.0, 0.0, 1.0),
    size: int = 600,
    *,
    smooth: bool = True,
) -> ByteArray:
    """A mesh in its own colours as (H, W, 3) picture on white; see ``seen_from``."""
    return seen_from(mesh, direction, up, size, smooth=smooth).shaded(mesh.colors)


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
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b""))
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
