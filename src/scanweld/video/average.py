"""A keyframe's depth image, averaged over the frames that see the same."""

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.gauss_newton import SIGNIFICANT_SIGMAS
from scanweld.geometry.pose import Pose
from scanweld.video.levels import planes_of
from scanweld.video.noise import DepthNoise

EDGE_PIXELS = 3
"""Pixels along an edge in which sensors often see nothing."""
SIDE = 3
"""Pixels on one side of a pixel, of the eight around it."""

Counts = NDArray[np.int32]


class Average:
    """Depths of one view, each the weighted mean of what frames measured in its pixel.

    A depth that is too far from the mean does not count: it is of another surface, of what moves,
    or an error. What more frames contradict than confirm is left out in the end, and so is what
    one frame alone saw where the first saw nothing.

    Args:
        depth: (H, W) of the first frame, NaN for none.
        camera: Of all frames.
        noise: Of single depths.
    """

    def __init__(self, depth: FloatArray, camera: Camera, noise: DepthNoise) -> None:
        self._camera, self._noise = camera, noise
        self._first = np.isfinite(depth)
        weight = np.where(self._first, noise.at(depth) ** -2.0, 0.0)
        self._weight = weight
        self._total = np.where(self._first, weight * np.nan_to_num(depth), 0.0)
        self._count = self._first.astype(np.int32)
        self._against = np.zeros(depth.shape, np.int32)
        self._planes = planes_of(depth, camera, noise)
        self.num_frames = 1

    @property
    def is_due(self) -> bool:
        """Whether so many frames were added that planes are worth fitting anew."""
        return self.num_frames & (self.num_frames - 1) == 0

    def add(self, depth: FloatArray, keyframe_from_frame: Pose, spread: float) -> None:
        """Average a frame in.

        Args:
            depth: (H, W) of the frame, NaN for none.
            keyframe_from_frame: Its pose.
            spread: By how much its depths differ from the mean, in units of their noise.
        """
        pose = keyframe_from_frame
        _add(
            depth,
            self._planes,
            self._camera.parameters,
            np.concatenate([pose.rotation.ravel(), pose.translation]),
            self._noise.terms,
            SIGNIFICANT_SIGMAS * max(spread, 1.0),
            self._total,
            self._weight,
            self._count,
            self._against,
        )
        self.num_frames += 1
        if self.is_due:
            # One frame's noise is still enough to tell two surfaces apart.
            self._planes = planes_of(self.depth(), self._camera, self._noise)

    def depth(self) -> FloatArray:
        """(H, W) so far, NaN for none."""
        is_known = (self._count > self._against) & (self._first | (self._count > 1))
        with np.errstate(invalid="ignore"):
            return np.where(is_known, self._total / self._weight, np.nan)

    def count(self) -> Counts:
        """(H, W) measurements that the depths are means of, 0 where there is none."""
        return np.where(np.isfinite(self.depth()), self._count, 0).astype(np.int32)


@njit(cache=True, nogil=True)
def _add(
    depth: FloatArray,
    planes: FloatArray,
    camera: FloatArray,
    pose: FloatArray,
    noise: FloatArray,
    sigmas: float,
    total: FloatArray,
    weight: FloatArray,
    count: Counts,
    against: Counts,
) -> None:  # pragma: no cover - compiled
    """Add a frame's depths, brought to the middles of the keyframe's pixels along its planes."""
    fx, fy, cx, cy = camera[1], camera[2], camera[3], camera[4]
    rows, columns = depth.shape
    for v, u in np.ndindex((rows, columns)):
        z = depth[v, u]
        if not z > 0.0:
            continue
        x, y = z * (u - cx) / fx, z * (v - cy) / fy
        qx = pose[0] * x + pose[1] * y + pose[2] * z + pose[9]
        qy = pose[3] * x + pose[4] * y + pose[5] * z + pose[10]
        qz = pose[6] * x + pose[7] * y + pose[8] * z + pose[11]
        if qz <= 0.0:
            continue
        i, j = int(np.rint(fx * qx / qz + cx)), int(np.rint(fy * qy / qz + cy))
        if i < 0 or j < 0 or i >= columns or j >= rows:
            continue
        variance = (noise[0] + noise[1] * z * z) ** 2
        at_j, at_i = _plane_near(planes, j, i, qx, qy, qz, sigmas * np.sqrt(variance))
        if at_j < 0:
            if weight[j, i] > 0.0:
                against[j, i] += 1
            continue
        a, b = planes[at_j, at_i, 0], planes[at_j, at_i, 1]
        mx, my = (i - cx) / fx, (j - cy) / fy
        moved = 1.0 / (1.0 / qz + a * (mx - qx / qz) + b * (my - qy / qz))
        if weight[j, i] > 0.0:
            uneven = planes[at_j, at_i, 3] * moved * moved  # nor is it a plane within the pixel
            apart = sigmas * np.sqrt(variance + 1.0 / weight[j, i] + uneven * uneven)
            if abs(moved - total[j, i] / weight[j, i]) > apart:
                against[j, i] += 1
                continue
        total[j, i] += moved / variance
        weight[j, i] += 1.0 / variance
        count[j, i] += 1


@njit(cache=True, nogil=True)
def _plane_near(
    planes: FloatArray,
    j: int,
    i: int,
    qx: float,
    qy: float,
    qz: float,
    apart: float,
) -> tuple[int, int]:  # pragma: no cover - compiled
    """The pixel if it has a plane, else the one beside it on whose plane a point lies; or -1.

    The point must lie on all planes about: near an edge it may be of what is behind the edge, which
    a sensor often does not see to its end.
    """
    if planes[j, i, 2] == planes[j, i, 2]:
        return j, i
    best, at_j, at_i, count = apart, -1, -1, 0
    for v in range(max(j - EDGE_PIXELS, 0), min(j + EDGE_PIXELS + 1, planes.shape[0])):
        for u in range(max(i - EDGE_PIXELS, 0), min(i + EDGE_PIXELS + 1, planes.shape[1])):
            a, b, c = planes[v, u, 0], planes[v, u, 1], planes[v, u, 2]
            off = abs(qz - qz * (a * qx + b * qy + c * qz))
            if off > apart:
                return -1, -1
            if max(abs(v - j), abs(u - i)) == 1 and off <= apart:  # False where there is none
                count += 1
                if off <= best:
                    best, at_j, at_i = off, v, u
    return (at_j, at_i) if count >= SIDE else (-1, -1)
