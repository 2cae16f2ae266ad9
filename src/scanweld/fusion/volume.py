"""A sparse volume of weighted signed distances, kept in blocks of voxels near the surface.

After Curless and Levoy, A volumetric method for building complex models from range images (1996);
distances are taken to the tangent plane of the pixel, and space seen empty only removes surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.errors import InputError
from scanweld.fusion.posed_image import PosedImage, SingleArray
from scanweld.fusion.sampling import plane_distance, project, smooth_distance
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.grid import GAP_ROUNDS
from scanweld.work.threads import map_in_order

BLOCK = 8
"""Voxels along the edge of a block."""
_KEY_BITS = 20
"""Voxel and block coordinates are below 2^20, so that three of them fit into one number."""
_MARGIN_BLOCKS = 8
"""Block coordinates below the lowest block that stay free: closing holes may need them."""
DEPTH_VOXELS = 1.5
"""Weights fall to nothing this far behind a surface, where the other side of a wall may be,"""
DEPTH_SIGMAS = 3.0
"""or so many standard deviations of the noise, if that is more."""
_MIN_DEEP_VOXELS = 0.7
"""Voxels at least this far behind the surface are taken to be inside with certainty."""
MIN_EMPTY = 0.3
"""Sum of the weights of the rays that passed through a voxel above which it is empty, where no
surface was measured."""
_MAX_STEP_VOXELS = 2.5
"""Signed distances of voxels two apart that differ by more, in voxels, are of two surfaces."""
CHUNK = 512
"""Blocks that are worked on together: bounds the memory, and is a worker's share."""


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
    distance: SingleArray
    weight: SingleArray
    empty: SingleArray

    def mean_distance(self) -> SingleArray:
        """(B, 8, 8, 8) signed distances over the truncation.

        NaN where no surface was measured nearby, or where a voxel behind one is empty space. Voxels
        right behind one that is deep inside are inside too, and single ones between measured ones
        are filled: they would be pinholes in the surface.
        """
        is_solid = self.empty <= self.weight
        is_seen = (self.weight > 0) & ((self.distance >= 0) | is_solid)
        mean = np.full(self.weight.shape, np.nan, np.float32)
        np.divide(self.distance, self.weight, out=mean, where=is_seen)
        nearby = self.neighbours()
        for _ in range(GAP_ROUNDS):
            filled = mean.copy()
            _fill_pinholes(mean, self.empty, nearby, self.voxel / self.truncation, filled)
            mean = filled
        return mean

    def neighbours(self) -> IntArray:
        """(B, 6) blocks before and after along each axis, -1 for those not kept."""
        steps = np.concatenate([[-row, row] for row in np.eye(3, dtype=np.int64)])
        return np.stack([self.find(self.blocks + step) for step in steps], axis=1)

    def find(self, blocks: IntArray) -> IntArray:
        """Indices (N,) of blocks given by their coordinates (N, 3), -1 for those not kept."""
        keys = block_keys(blocks)
        index = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        return np.where(self.keys[index] == keys, index, -1)


def integrate(
    images: Sequence[PosedImage],
    voxel: float,
    truncation: float,
    depth: float,
    workers: int = 1,
) -> Volume:
    """Fuse images into a volume of blocks that lie within the truncation of a surface point.

    Args:
        images: At least one; one of them with at least one surface pixel.
        voxel: Edge of a voxel, in the scans' unit.
        truncation: Likewise; twice the voxel or more.
        depth: Likewise: how far behind a surface its weights fall to nothing. What is deep behind
            one surface may be just before another, as in a thin wall.
        workers: Threads; the result is the same for any number.

    Raises:
        InputError: If the scans are spread over more than a million voxels.
    """
    volume = _allocate(images, voxel, truncation)
    add_images(volume, images, depth, workers)
    return volume


def add_images(
    volume: Volume, images: Sequence[PosedImage], depth: float, workers: int = 1
) -> None:
    """Add images to the volume's sums, as ``integrate`` does."""

    def work(start: int) -> None:
        part = slice(start, start + CHUNK)
        for image in images:
            _integrate_image(
                volume.distance[part],
                volume.weight[part],
                volume.empty[part],
                volume.blocks[part],
                np.array([*volume.origin, volume.voxel, volume.truncation, depth]),
                image.sensor_from_world.matrix(),
                image.camera.parameters,
                image.depth,
                image.normals,
                image.weight,
                image.is_rim,
                image.precision,
                image.free_camera.parameters,
                image.is_free,
                image.trust,
            )

    for _ in map_in_order(work, range(0, len(volume.blocks), CHUNK), workers):
        pass


def empty_volume(origin: FloatArray, voxel: float, truncation: float, blocks: IntArray) -> Volume:
    """A volume of the given blocks (B, 3), sorted by their keys, that holds nothing yet."""
    shape = (len(blocks), BLOCK, BLOCK, BLOCK)
    return Volume(
        origin=origin,
        voxel=voxel,
        truncation=truncation,
        blocks=blocks,
        keys=block_keys(blocks),
        distance=np.zeros(shape, np.float32),
        weight=np.zeros(shape, np.float32),
        empty=np.zeros(shape, np.float32),
    )


def merged(first: Volume, second: Volume) -> tuple[Volume, IntArray]:
    """Two volumes of one layout without common blocks as one, and the order of their blocks."""
    keys = np.concatenate([first.keys, second.keys])
    order = np.argsort(keys)
    volume = Volume(
        origin=first.origin,
        voxel=first.voxel,
        truncation=first.truncation,
        blocks=np.concatenate([first.blocks, second.blocks])[order],
        keys=keys[order],
        distance=np.concatenate([first.distance, second.distance])[order],
        weight=np.concatenate([first.weight, second.weight])[order],
        empty=np.concatenate([first.empty, second.empty])[order],
    )
    return volume, order


def block_keys(blocks: IntArray) -> IntArray:
    """One number (N,) for the coordinates (N, 3) of each block."""
    x, y, z = blocks[..., 0], blocks[..., 1], blocks[..., 2]
    return (((x << _KEY_BITS) | y) << _KEY_BITS) | z


def blocks_of(keys: IntArray) -> IntArray:
    """Coordinates (N, 3) of the blocks with these keys (N,)."""
    mask = (1 << _KEY_BITS) - 1
    return np.stack([keys >> (2 * _KEY_BITS), (keys >> _KEY_BITS) & mask, keys & mask], axis=-1)


def _allocate(images: Sequence[PosedImage], voxel: float, truncation: float) -> Volume:
    bounds = [(p.min(axis=0), p.max(axis=0)) for p in (i.points() for i in images) if len(p)]
    if not bounds:
        raise InputError("the scans hold no surface to fuse: every pixel is seen too obliquely")
    low = np.min([low for low, _ in bounds], axis=0)
    high = np.max([high for _, high in bounds], axis=0)
    if float((high - low).max()) / voxel > 0.9 * 2**_KEY_BITS:
        raise InputError(
            "the posed scans cannot be fused, because they are spread over more than a million "
            "voxels: check their poses, or ask for larger voxels"
        )
    origin = low - truncation - (1 + _MARGIN_BLOCKS * BLOCK) * voxel
    keys = np.zeros(0, np.int64)
    for image in images:
        keys = np.union1d(keys, _near(image.points() - origin, voxel, truncation))
    return empty_volume(origin, voxel, truncation, blocks_of(keys))


def _near(points: FloatArray, voxel: float, truncation: float) -> IntArray:
    """Keys of the blocks within the truncation, along each axis, of points from the origin."""
    edge = BLOCK * voxel
    # Most points of a block reach the same blocks: look at one for each voxel.
    cells = np.floor(points / voxel).astype(np.int64)
    _, first = np.unique(block_keys(cells), return_index=True)
    centres = (cells[first] + 0.5) * voxel
    reach = truncation + 0.5 * voxel
    steps = np.linspace(-reach, reach, int(np.ceil(2 * reach / edge)) + 1)
    along = [np.floor((centres[:, a, None] + steps) / edge).astype(np.int64) for a in range(3)]
    x, y, z = along[0][:, :, None, None], along[1][:, None, :, None], along[2][:, None, None, :]
    return np.unique(block_keys(np.stack(np.broadcast_arrays(x, y, z), axis=-1)))


@njit(cache=True, nogil=True)
def _integrate_image(
    distance: SingleArray,
    weight: SingleArray,
    empty: SingleArray,
    blocks: IntArray,
    layout: FloatArray,
    sensor_from_world: FloatArray,
    camera: FloatArray,
    depth: SingleArray,
    normals: SingleArray,
    pixel_weight: SingleArray,
    is_rim: BoolArray,
    precision: float,
    free_camera: FloatArray,
    is_free: BoolArray,
    trust: float,
) -> None:  # pragma: no cover - compiled
    """Add one image: all voxels of all blocks that project into it.

    The layout is the volume's origin, voxel and truncation, and the depth of weights.
    """
    m, size, voxel, truncation = sensor_from_world, distance.shape[1], layout[3], layout[4]
    fade = layout[5] / truncation
    height, width = depth.shape
    for block, i, j, k in np.ndindex(distance.shape):
        wx = layout[0] + voxel * (blocks[block, 0] * size + i)
        wy = layout[1] + voxel * (blocks[block, 1] * size + j)
        wz = layout[2] + voxel * (blocks[block, 2] * size + k)
        x = m[0, 0] * wx + m[0, 1] * wy + m[0, 2] * wz + m[0, 3]
        y = m[1, 0] * wx + m[1, 1] * wy + m[1, 2] * wz + m[1, 3]
        z = m[2, 0] * wx + m[2, 1] * wy + m[2, 2] * wz + m[2, 3]
        u, v = project(camera, x, y, z)
        w, row, column = 0.0, 0, 0
        if -0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5:
            row, column = int(v + 0.5), int(u + 0.5)
            w = pixel_weight[row, column]
        if not w > 0.0:
            u, v = project(free_camera, x, y, z)
            inside = -0.5 <= u < is_free.shape[1] - 0.5 and -0.5 <= v < is_free.shape[0] - 0.5
            if inside and is_free[int(v + 0.5), int(u + 0.5)]:
                empty[block, i, j, k] += trust
            continue
        d = plane_distance(camera, depth, normals, row, column, x, y, z)
        if d > truncation:
            if not is_rim[row, column]:
                empty[block, i, j, k] += w
        elif d > -fade * truncation:
            if not is_rim[row, column]:
                d, w = smooth_distance(camera, depth, normals, pixel_weight, u, v, x, y, z)
            d = min(max(d / truncation, -1.0), 1.0)
            w *= precision * min(1.0, max(0.0, (d + fade) / (0.75 * fade)))
            distance[block, i, j, k] += w * d
            weight[block, i, j, k] += w


@njit(cache=True, nogil=True)
def _fill_pinholes(
    mean: SingleArray, empty: SingleArray, nearby: IntArray, voxel: float, filled: SingleArray
) -> None:  # pragma: no cover - compiled
    """Give unknown voxels the mean of pairs of opposite neighbours, or of one deep inside."""
    size = mean.shape[1]
    pair = np.zeros(2)
    for b, i, j, k in np.ndindex(mean.shape):
        if not np.isnan(mean[b, i, j, k]):
            continue
        total, count, deepest = 0.0, 0, 0.0
        for axis in range(3):
            for side in range(2):
                step = 2 * side - 1
                x, y, z = i + step * (axis == 0), j + step * (axis == 1), k + step * (axis == 2)
                block = b
                if min(x, y, z) < 0 or max(x, y, z) >= size:
                    block = nearby[b, 2 * axis + side]
                    x, y, z = x % size, y % size, z % size
                pair[side] = mean[block, x, y, z] if block >= 0 else np.nan
                if pair[side] < deepest:
                    deepest = pair[side]
            if abs(pair[0] - pair[1]) <= _MAX_STEP_VOXELS * voxel:
                total += 0.5 * (pair[0] + pair[1])
                count += 1
        if count > 0:
            filled[b, i, j, k] = total / count
        elif deepest < -_MIN_DEEP_VOXELS * voxel and empty[b, i, j, k] <= MIN_EMPTY:
            filled[b, i, j, k] = deepest
