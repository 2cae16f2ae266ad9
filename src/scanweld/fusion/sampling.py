"""Looking up points in a posed image: how far they lie from its surface, compiled.

The distance is to the tangent planes of the four pixels around, so that it is smooth from pixel to
pixel and exact on planes; on a rim, where the four may not be of one surface, to the nearest alone.
"""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.fusion.posed_image import PosedImage, SingleArray
from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray
from scanweld.geometry.prepared import MIN_COSINE


def sample_surface(
    image: PosedImage, points: FloatArray, normals: FloatArray, min_cosine: float = MIN_COSINE
) -> tuple[SingleArray, SingleArray]:
    """Signed distances (P,) of points (P, 3), world frame, to an image's surface, and weights (P,).

    Distances are positive towards the sensor. The weight is 0 where the image has no surface, or
    where its sensor would see the points' normals (P, 3) more obliquely than a cosine.
    """
    distance = np.zeros(len(points), np.float32)
    weight = np.zeros(len(points), np.float32)
    _sample(
        np.ascontiguousarray(points),
        np.ascontiguousarray(normals),
        min_cosine,
        image.sensor_from_world.matrix(),
        image.camera.parameters,
        image.depth,
        image.normals,
        image.weight,
        image.is_rim,
        distance,
        weight,
    )
    return distance, weight


def sample_colors(image: PosedImage, points: FloatArray) -> tuple[SingleArray, SingleArray]:
    """Colours (P, 3) of an image with colours at points (P, 3), world frame, and weights (P,).

    Bilinear between the pixels that have a weight; the weight is 0 where there are none.

    Raises:
        ValueError: If the image has no colours.
    """
    if image.colors is None:
        raise ValueError("the image has no colours")
    local = np.ascontiguousarray(image.sensor_from_world.apply(points))
    color = np.zeros((len(points), 3), np.float32)
    weight = np.zeros(len(points), np.float32)
    _sample_colors(
        local, image.camera.parameters, image.colors, image.weight, image.is_rim, color, weight
    )
    return color, weight


@njit(cache=True, nogil=True)
def project(
    camera: FloatArray, x: float, y: float, z: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Column and row of a point of the sensor frame; -1 beside or behind a pinhole."""
    if camera[0] == 0.0:
        if z <= 0.0:
            return -1.0, -1.0
        x, y = x / z, y / z
    return camera[1] * x + camera[3], camera[2] * y + camera[4]


@njit(cache=True, nogil=True)
def plane_distance(
    camera: FloatArray,
    depth: SingleArray,
    normals: SingleArray,
    row: int,
    column: int,
    x: float,
    y: float,
    z: float,
) -> float:  # pragma: no cover - compiled
    """Distance of (x, y, z) to the tangent plane of a pixel, positive towards the sensor."""
    pz = float(depth[row, column])
    px, py = (column - camera[3]) / camera[1], (row - camera[4]) / camera[2]
    if camera[0] == 0.0:
        px, py = px * pz, py * pz
    n = normals[row, column]
    return n[0] * (x - px) + n[1] * (y - py) + n[2] * (z - pz)


@njit(cache=True, nogil=True)
def smooth_distance(
    camera: FloatArray,
    depth: SingleArray,
    normals: SingleArray,
    weight: SingleArray,
    u: float,
    v: float,
    x: float,
    y: float,
    z: float,
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Distance and weight, bilinear over the tangent planes of the four pixels around (u, v).

    The pixel nearest to (u, v) must not be on a rim, so that all four are of one surface.
    """
    row, column = int(v), int(u)
    s, t = u - column, v - row
    d, w = 0.0, 0.0
    for k in range(4):
        q, p = row + k // 2, column + k % 2
        share = (t if k // 2 else 1.0 - t) * (s if k % 2 else 1.0 - s) * weight[q, p]
        if share > 0.0:
            d += share * plane_distance(camera, depth, normals, q, p, x, y, z)
            w += share
    return d / w, w


@njit(cache=True, nogil=True)
def _pixel_near(
    weight: SingleArray, u: float, v: float
) -> tuple[int, int]:  # pragma: no cover - compiled
    """The pixel with a weight nearest to (u, v), at most one off; (-1, -1) if there is none.

    A surface reaches up to a voxel beyond its outermost pixels, which are on a rim.
    """
    row, column = int(v + 0.5), int(u + 0.5)
    if weight[row, column] > 0.0:
        return row, column
    best, found = np.inf, (-1, -1)
    for q in range(max(0, row - 1), min(weight.shape[0], row + 2)):
        for p in range(max(0, column - 1), min(weight.shape[1], column + 2)):
            away = (q - v) ** 2 + (p - u) ** 2
            if weight[q, p] > 0.0 and away < best:
                best, found = away, (q, p)
    return found


@njit(cache=True, nogil=True)
def _cosine(
    camera: FloatArray, sensor_from_world: FloatArray, n: FloatArray, x: float, y: float, z: float
) -> float:  # pragma: no cover - compiled
    """Cosine between a normal, world frame, and the way from (x, y, z) back to the sensor."""
    m = sensor_from_world
    back = m[2, 0] * n[0] + m[2, 1] * n[1] + m[2, 2] * n[2]
    if camera[0] == 0.0:
        back = back * z + x * (m[0, 0] * n[0] + m[0, 1] * n[1] + m[0, 2] * n[2])
        back += y * (m[1, 0] * n[0] + m[1, 1] * n[1] + m[1, 2] * n[2])
        back /= np.sqrt(x * x + y * y + z * z)
    return -back


@njit(cache=True, nogil=True)
def _sample(
    points: FloatArray,
    point_normals: FloatArray,
    min_cosine: float,
    sensor_from_world: FloatArray,
    camera: FloatArray,
    depth: SingleArray,
    normals: SingleArray,
    weight: SingleArray,
    is_rim: BoolArray,
    distance: SingleArray,
    found: SingleArray,
) -> None:  # pragma: no cover - compiled
    height, width = depth.shape
    m = sensor_from_world
    for k in range(points.shape[0]):
        px, py, pz = points[k, 0], points[k, 1], points[k, 2]
        x = m[0, 0] * px + m[0, 1] * py + m[0, 2] * pz + m[0, 3]
        y = m[1, 0] * px + m[1, 1] * py + m[1, 2] * pz + m[1, 3]
        z = m[2, 0] * px + m[2, 1] * py + m[2, 2] * pz + m[2, 3]
        u, v = project(camera, x, y, z)
        if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
            continue
        if _cosine(camera, m, point_normals[k], x, y, z) <= min_cosine:
            continue
        row, column = _pixel_near(weight, u, v)
        if row < 0:
            continue
        if is_rim[row, column] or max(abs(v - row), abs(u - column)) > 0.5:
            distance[k] = plane_distance(camera, depth, normals, row, column, x, y, z)
            found[k] = weight[row, column]
        else:
            d, w = smooth_distance(camera, depth, normals, weight, u, v, x, y, z)
            distance[k] = d
            found[k] = w


@njit(cache=True, nogil=True)
def _sample_colors(
    points: FloatArray,
    camera: FloatArray,
    colors: ByteArray,
    weight: SingleArray,
    is_rim: BoolArray,
    color: SingleArray,
    found: SingleArray,
) -> None:  # pragma: no cover - compiled
    height, width = weight.shape
    for k in range(points.shape[0]):
        u, v = project(camera, points[k, 0], points[k, 1], points[k, 2])
        if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
            continue
        row, column = _pixel_near(weight, u, v)
        if row < 0:
            continue
        if is_rim[row, column] or max(abs(v - row), abs(u - column)) > 0.5:
            for c in range(3):
                color[k, c] = colors[row, column, c]
            found[k] = weight[row, column]
            continue
        row, column = int(v), int(u)
        s, t = u - column, v - row
        for corner in range(4):
            q, p = row + corner // 2, column + corner % 2
            share = (t if corner // 2 else 1.0 - t) * (s if corner % 2 else 1.0 - s) * weight[q, p]
            found[k] += share
            for c in range(3):
                color[k, c] += share * colors[q, p, c]
        for c in range(3):
            color[k, c] /= found[k]
