"""A sparse volume of weighted signed distances, kept in blocks of voxels near the surface."""

from dataclasses import dataclass

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.fusion.posed_image import SingleArray
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.grid import GAP_ROUNDS

BLOCK = 8
"""Voxels along the edge of a block."""
KEY_BITS = 20
"""Voxel and block coordinates are below 2^20, so that three of them fit into one number."""
DEPTH_VOXELS = 1.5
"""Weights fall to nothing this far behind a surface, where the other side of a wall may be; or
as far behind it as its noise reaches, if that is more."""
_MIN_DEEP_VOXELS = 0.7
"""Voxels at least this far behind the surface are taken to be inside with certainty."""
MIN_EMPTY = 0.3
"""Sum of the weights of the rays that passed through a voxel above which it is empty, where no
surface was measured."""
_MAX_STEP_VOXELS = 2.5
"""Signed distances of voxels two apart that differ by more, in voxels, are of two surfaces."""


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
    return (((x << KEY_BITS) | y) << KEY_BITS) | z


def blocks_of(keys: IntArray) -> IntArray:
    """Coordinates (N, 3) of the blocks with these keys (N,)."""
    mask = (1 << KEY_BITS) - 1
    return np.stack([keys >> (2 * KEY_BITS), (keys >> KEY_BITS) & mask, keys & mask], axis=-1)


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
