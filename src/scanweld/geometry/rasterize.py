"""A z-buffer: which triangle a camera sees in each pixel, and how far away it is."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel


def render_depth(
    points: FloatArray, faces: IntArray, camera: Camera
) -> tuple[FloatArray, IntArray]:
    """Render triangles at the pixel centres of a pinhole or orthographic camera.

    Args:
        points: (V, 3) in the sensor frame.
        faces: (F, 3) indices of points.
        camera: Pinhole or orthographic.

    Returns:
        Depth (H, W), NaN where nothing is seen, exact on planes; and the index (H, W) of the
        face seen, -1 where none is. Faces with a vertex not in front of a pinhole are left out.

    Raises:
        ValueError: If the camera is spherical.
    """
    if camera.model is CameraModel.SPHERICAL:
        raise ValueError("triangles are not rendered into a spherical camera")
    pixels, depth = camera.project(points)
    # 1/z is linear in a pinhole's image, z in an orthographic one.
    is_pinhole = camera.model is CameraModel.PINHOLE
    with np.errstate(divide="ignore"):
        linear = 1.0 / depth if is_pinhole else np.array(depth)
    image = np.full((camera.height, camera.width), np.nan)
    face_of = np.full((camera.height, camera.width), -1, dtype=np.int64)
    # Contiguous and writable, whatever came in: the kernel is compiled for one kind. What is so
    # already is not copied: the triangles of two million points take 100 MB.
    pixels = np.require(pixels, requirements=["C", "W"])
    triangles = np.require(faces, requirements=["C", "W"])
    _fill(pixels, linear, triangles, is_pinhole, image, face_of)
    return (1.0 / image if is_pinhole else image), face_of


@njit(cache=True, nogil=True)
def _fill(
    pixels: FloatArray,
    linear: FloatArray,
    faces: IntArray,
    is_pinhole: bool,
    image: FloatArray,
    face_of: IntArray,
) -> None:
    """Write the nearest triangle of each pixel into image and face_of; values linear in it."""
    height, width = image.shape
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay = pixels[a, 0], pixels[a, 1]
        bx, by = pixels[b, 0], pixels[b, 1]
        cx, cy = pixels[c, 0], pixels[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > 0.0:
            continue
        left = max(0, int(np.ceil(min(ax, bx, cx) - 1e-9)))
        right = min(width - 1, int(np.floor(max(ax, bx, cx) + 1e-9)))
        top = max(0, int(np.ceil(min(ay, by, cy) - 1e-9)))
        bottom = min(height - 1, int(np.floor(max(ay, by, cy) + 1e-9)))
        for v in range(top, bottom + 1):
            for u in range(left, right + 1):
                wa = ((bx - u) * (cy - v) - (by - v) * (cx - u)) / area
                wb = ((cx - u) * (ay - v) - (cy - v) * (ax - u)) / area
                wc = 1.0 - wa - wb
                if wa < -1e-9 or wb < -1e-9 or wc < -1e-9:
                    continue
                value = wa * linear[a] + wb * linear[b] + wc * linear[c]
                seen = image[v, u]
                nearer = value > seen if is_pinhole else value < seen
                if np.isnan(seen) or nearer:
                    image[v, u] = value
                    face_of[v, u] = f
