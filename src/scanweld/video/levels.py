"""A depth image at several sizes, and the plane about each of its pixels."""

from dataclasses import dataclass, replace

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.gauss_newton import SIGNIFICANT_SIGMAS
from scanweld.video.noise import DepthNoise

STEEPEST = 2.75
"""Tangent of 70 degrees: depths of neighbours that differ by more than on a surface seen at such an
angle, besides the noise, are of two surfaces."""
PLANE_RADIUS = 2
"""Pixels from its middle to the border of the window that a plane is fitted to."""
FINEST_PIXELS, COARSEST_PIXELS = 100_000, 2_000
"""Pixels with depths of the finest image that frames are aligned by, at most, and of the coarsest,
at least: that is 320 x 240 down to 80 x 60 for a full frame, as in KinectFusion (Newcombe 2011)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LevelChoice:
    """Which halvings of the images of one camera frames are aligned by.

    Attributes:
        cameras: Of the images halved 0, 1, 2 ... times.
        finest: Halvings of the finest image.
        coarsest: Halvings of the coarsest.
    """

    cameras: tuple[Camera, ...]
    finest: int
    coarsest: int

    def chosen(self) -> list[int]:
        """The halvings, the coarsest image first."""
        return list(range(self.coarsest, self.finest - 1, -1))


def choose_levels(num_depths: int, camera: Camera) -> LevelChoice:
    """The halvings for a keyframe with so many depths."""
    cameras, count, finest = [camera], float(num_depths), 0
    while count / 4 >= COARSEST_PIXELS:
        if count > FINEST_PIXELS:
            finest += 1
        count /= 4
        cameras.append(halved_camera(cameras[-1]))
    return LevelChoice(cameras=tuple(cameras), finest=finest, coarsest=len(cameras) - 1)


def halved_camera(camera: Camera) -> Camera:
    """The camera whose pixels are blocks of two by two of another's."""
    return replace(
        camera,
        width=camera.width // 2,
        height=camera.height // 2,
        fx=camera.fx / 2,
        fy=camera.fy / 2,
        cx=(camera.cx - 0.5) / 2,
        cy=(camera.cy - 0.5) / 2,
    )


def halvings(depth: FloatArray, levels: LevelChoice, noise: DepthNoise) -> list[FloatArray]:
    """A depth image (H, W), NaN for none, and all halvings of it that are needed."""
    images: list[FloatArray] = [depth]
    for k in range(levels.coarsest):
        step = STEEPEST / levels.cameras[k].fx
        images.append(_halved(images[-1], step, noise.halved(k).terms))
    return images


def planes_of(depth: FloatArray, camera: Camera, noise: DepthNoise) -> FloatArray:
    """Planes (H, W, 4) about the pixels of a depth image, NaN where there is none.

    They are fitted to the inverse depth, which on a plane is a x + b y + c in the directions
    x = X / Z and y = Y / Z: so (a, b, c) is the plane's normal over its distance from the sensor.
    The fourth number is by how much the inverse depths differ from the plane, root mean square.

    Args:
        depth: (H, W), NaN for none.
        camera: Of this image.
        noise: Of its depths.
    """
    step = STEEPEST / camera.fx
    return _planes(depth, camera.parameters, PLANE_RADIUS, step, noise.terms)


def unit_normals(planes: FloatArray) -> FloatArray:
    """Unit normals (N, 3) of planes (N, 4), which point away from the sensor."""
    normals = planes[..., :3]
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@njit(cache=True, nogil=True)
def _halved(
    depth: FloatArray, step: float, noise: FloatArray
) -> FloatArray:  # pragma: no cover - compiled
    """Means of what three or four pixels of each block see of its nearest surface."""
    rows, columns = depth.shape[0] // 2, depth.shape[1] // 2
    half = np.full((rows, columns), np.nan)
    for v, u in np.ndindex((rows, columns)):
        near = np.inf
        for k in range(4):
            z = depth[2 * v + k // 2, 2 * u + k % 2]
            if z < near:
                near = z
        farthest = near * (1.0 + step) + SIGNIFICANT_SIGMAS * (noise[0] + noise[1] * near * near)
        total, count = 0.0, 0
        for k in range(4):
            z = depth[2 * v + k // 2, 2 * u + k % 2]
            if z <= farthest:
                total += 1.0 / z
                count += 1
        if count >= 3:
            half[v, u] = count / total
    return half


@njit(cache=True, nogil=True)
def _planes(
    depth: FloatArray, camera: FloatArray, radius: int, step: float, noise: FloatArray
) -> FloatArray:  # pragma: no cover - compiled
    rows, columns = depth.shape
    planes = np.full((rows, columns, 4), np.nan)
    least = (2 * radius + 1) ** 2 // 2
    for v, u in np.ndindex((rows, columns)):
        z = depth[v, u]
        if not z > 0.0:
            continue
        apart = SIGNIFICANT_SIGMAS * (noise[0] + noise[1] * z * z)
        n = sx = sy = sd = sxx = sxy = syy = sxd = syd = sdd = 0.0
        for j in range(max(v - radius, 0), min(v + radius + 1, rows)):
            for i in range(max(u - radius, 0), min(u + radius + 1, columns)):
                away = max(abs(i - u), abs(j - v))
                if not abs(depth[j, i] - z) <= away * step * z + apart:
                    continue
                x, y, d = float(i - u), float(j - v), 1.0 / depth[j, i] - 1.0 / z
                n += 1.0
                sx += x
                sy += y
                sd += d
                sxx += x * x
                sxy += x * y
                syy += y * y
                sxd += x * d
                syd += y * d
                sdd += d * d
        if n <= least:
            continue
        xx, xy, yy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
        xd, yd = sxd - sx * sd / n, syd - sy * sd / n
        det = xx * yy - xy * xy
        if det <= 0.25 * n * n:  # all on one line
            continue
        a, b = (yy * xd - xy * yd) / det, (xx * yd - xy * xd) / det
        middle = 1.0 / z + (sd - a * sx - b * sy) / n
        planes[v, u, 3] = np.sqrt(max(0.0, sdd - sd * sd / n - a * xd - b * yd) / n)
        a, b = a * camera[1], b * camera[2]  # by pixel to by direction
        planes[v, u, 0], planes[v, u, 1] = a, b
        planes[v, u, 2] = middle - a * (u - camera[3]) / camera[1] - b * (v - camera[4]) / camera[2]
    return planes
