"""A sparse volume of weighted signed distances, kept in blocks of voxels near the surface.

After Curless and Levoy, A volumetric method for building complex models from range images (1996);
distances are taken to the tangent plane of the pixel, carving only takes support away.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scanweld.errors import InputError
from scanweld.fusion.posed_image import PosedImage
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

VoxelArray = NDArray[np.float32]

BLOCK = 8
"""Voxels along the edge of a block."""
KEY_BITS = 20
"""Voxel and block coordinates are below 2^20, so that three of them fit into one number."""
_CARVE_RATIO = 1.0
"""A voxel is empty where free space weighs more than this share of its surface's weight."""
_DEPTH_VOXELS = 2.0
"""Weights fall to nothing this far behind a surface: no cell that it crosses reaches deeper."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Volume:
    """Signed distances at the centres of voxels, world frame; B blocks sorted by ``keys``.

    Attributes:
        origin: (3,) centre of voxel 0 of block (0, 0, 0).
        voxel: Edge of a voxel.
        truncation: Distance at which signed distances are cut off.
        blocks: (B, 3) block coordinates, not negative.
        keys: (B,) one number a block, ascending.
        distance: (B, 8, 8, 8) weighted sum of signed distances over the truncation, positive in
            front of the surface.
        weight: (B, 8, 8, 8) sum of the weights.
        empty: (B, 8, 8, 8) sum of the weights of the rays that went on through the voxel.
    """

    origin: FloatArray
    voxel: float
    truncation: float
    blocks: IntArray
    keys: IntArray
    distance: VoxelArray
    weight: VoxelArray
    empty: VoxelArray

    def mean_distance(self) -> VoxelArray:
        """(B, 8, 8, 8) signed distances over the truncation.

        NaN where no surface was measured nearby, or where a voxel behind one is empty space.
        """
        is_solid = self.empty <= _CARVE_RATIO * self.weight
        is_seen = (self.weight > 0) & ((self.distance >= 0) | is_solid)
        mean = np.full(self.weight.shape, np.nan, np.float32)
        return np.divide(self.distance, self.weight, out=mean, where=is_seen)

    def find(self, blocks: IntArray) -> IntArray:
        """Indices (N,) of blocks given by their coordinates (N, 3), -1 for those not kept."""
        keys = _keys(blocks)
        index = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return np.where(self.keys[index] == keys, index, -1)


def integrate(images: Sequence[PosedImage], voxel: float, truncation: float) -> Volume:
    """Fuse images into a volume of blocks that lie within the truncation of a surface point.

    Args:
        images: At least one; one of them with at least one surface pixel.
        voxel: Edge of a voxel, in the scans' unit.
        truncation: Likewise; twice the voxel or more.

    Raises:
        InputError: If the scans are spread over more than a million voxels.
    """
    volume = _allocate(images, voxel, truncation)
    for image in images:
        _integrate_image(
            volume.distance,
            volume.weight,
            volume.empty,
            volume.blocks,
            volume.origin,
            voxel,
            truncation,
            image.sensor_from_world.matrix(),
            image.camera.parameters,
            image.points,
            image.normals,
            image.weight,
            image.carving,
            image.is_rim,
        )
    return volume


def _allocate(images: Sequence[PosedImage], voxel: float, truncation: float) -> Volume:
    surfaces = [image.points[image.weight > 0] for image in images]
    low = np.min([points.min(axis=0) for points in surfaces if len(points)], axis=0)
    origin = low - truncation - voxel
    high = np.max([points.max(axis=0) for points in surfaces if len(points)], axis=0)
    if float((high - low).max()) / voxel > 0.9 * 2**KEY_BITS:
        raise InputError("the posed scans lie too far apart to be fused; see their poses")
    keys = np.unique(np.concatenate([_near(p - origin, voxel, truncation) for p in surfaces]))
    mask = (1 << KEY_BITS) - 1
    blocks = np.stack([keys >> (2 * KEY_BITS), (keys >> KEY_BITS) & mask, keys & mask], axis=-1)
    shape = (len(keys), BLOCK, BLOCK, BLOCK)
    return Volume(
        origin=origin,
        voxel=voxel,
        truncation=truncation,
        blocks=blocks,
        keys=keys,
        distance=np.zeros(shape, np.float32),
        weight=np.zeros(shape, np.float32),
        empty=np.zeros(shape, np.float32),
    )


def _near(points: FloatArray, voxel: float, truncation: float) -> IntArray:
    """Keys of the blocks within the truncation, along each axis, of points from the origin."""
    edge = BLOCK * voxel
    steps = np.linspace(-truncation, truncation, int(np.ceil(2 * truncation / edge)) + 1)
    along = [np.floor((points[:, a, None] + steps) / edge).astype(np.int64) for a in range(3)]
    x, y, z = along[0][:, :, None, None], along[1][:, None, :, None], along[2][:, None, None, :]
    return np.unique(_keys(np.stack(np.broadcast_arrays(x, y, z), axis=-1)))


def _keys(blocks: IntArray) -> IntArray:
    x, y, z = blocks[..., 0], blocks[..., 1], blocks[..., 2]
    return (((x << KEY_BITS) | y) << KEY_BITS) | z


@njit(cache=True, nogil=True)
def _integrate_image(
    distance: VoxelArray,
    weight: VoxelArray,
    empty: VoxelArray,
    blocks: IntArray,
    origin: FloatArray,
    voxel: float,
    truncation: float,
    sensor_from_world: FloatArray,
    camera: FloatArray,
    points: FloatArray,
    normals: FloatArray,
    pixel_weight: FloatArray,
    carving: FloatArray,
    is_rim: BoolArray,
) -> None:  # pragma: no cover - compiled
    """Add one image: all voxels of all blocks that project into it."""
    m, size = sensor_from_world, distance.shape[1]
    height, width = carving.shape
    depth = _DEPTH_VOXELS * voxel / truncation
    for block, i, j, k in np.ndindex(distance.shape):
        x = origin[0] + voxel * (blocks[block, 0] * size + i)
        y = origin[1] + voxel * (blocks[block, 1] * size + j)
        z = origin[2] + voxel * (blocks[block, 2] * size + k)
        a = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]
        b = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]
        if camera[0] == 0.0:
            c = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3]
            if c <= 0.0:
                continue
            a, b = a / c, b / c
        u, v = camera[1] * a + camera[3], camera[2] * b + camera[4]
        if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
            continue
        row, column = int(v + 0.5), int(u + 0.5)
        w = pixel_weight[row, column]
        d = np.inf
        if w > 0.0:
            d = _plane_distance(points, normals, row, column, x, y, z)
        if d > truncation:
            empty[block, i, j, k] += carving[row, column]
        elif d > -depth * truncation:
            if not is_rim[row, column]:
                d, w = _smooth_distance(points, normals, pixel_weight, u, v, x, y, z)
            d = min(max(d / truncation, -1.0), 1.0)
            # What is deep behind one surface may be just before another, as in a thin wall.
            w *= min(1.0, max(0.0, (d + depth) / (0.75 * depth)))
            distance[block, i, j, k] += w * d
            weight[block, i, j, k] += w


@njit(cache=True, nogil=True)
def _plane_distance(
    points: FloatArray, normals: FloatArray, row: int, column: int, x: float, y: float, z: float
) -> float:  # pragma: no cover - compiled
    """Distance of (x, y, z) to the tangent plane of a pixel, positive towards the sensor."""
    p, n = points[row, column], normals[row, column]
    return n[0] * (x - p[0]) + n[1] * (y - p[1]) + n[2] * (z - p[2])


@njit(cache=True, nogil=True)
def _smooth_distance(
    points: FloatArray,
    normals: FloatArray,
    pixel_weight: FloatArray,
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
        share = (t if k // 2 else 1.0 - t) * (s if k % 2 else 1.0 - s) * pixel_weight[q, p]
        if share > 0.0:
            d += share * _plane_distance(points, normals, q, p, x, y, z)
            w += share
    return d / w, w
