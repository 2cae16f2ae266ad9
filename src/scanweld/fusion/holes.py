"""Closing what no scan saw: the volume's field continued until its surface is closed.

Measured distances and space that was seen empty stay as they are, so that what closes a hole lies
where no scan could have seen it. "fill" spans a membrane (the zero of a harmonic function; cf.
Davis et al., Filling holes in complex surfaces using volumetric diffusion, 2002), "carve" keeps
all space that was not seen to be empty (Curless and Levoy 1996, section 4).
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from scipy.ndimage import map_coordinates

from scanweld.compiled.kernels import njit
from scanweld.fusion.integrate import add_images
from scanweld.fusion.posed_image import PosedImage, SingleArray
from scanweld.fusion.volume import (
    BLOCK,
    DEPTH_VOXELS,
    MIN_EMPTY,
    Volume,
    block_keys,
    blocks_of,
    empty_volume,
    merged,
)
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

logger = logging.getLogger(__name__)

Closing = Literal["fill", "carve"]


@dataclass(frozen=True, kw_only=True, slots=True)
class _CoarseGrid:
    """How fine the coarse grid is.

    Attributes:
        across: Nodes along the longest side of the surface, at most.
        min_voxels: Least spacing of the nodes, in voxels.
        margin: Nodes around the surface; the outermost are outside of everything.
    """

    across: int = 128
    min_voxels: float = 4.0
    margin: int = 3


@dataclass(frozen=True, kw_only=True, slots=True)
class _Relaxation:
    """How Laplace's equation is solved, by successive over-relaxation.

    Attributes:
        factor: Of the over-relaxation; below 2, or it does not converge.
        coarse_sweeps: Over the coarse grid, which has far to go.
        fine_sweeps: Over the blocks of voxels, which begin with the coarse solution.
        rounds: Of relaxing and following the surface into new blocks; the last one only follows.
    """

    factor: float = 1.8
    coarse_sweeps: int = 300
    fine_sweeps: int = 40
    rounds: int = 3


_COARSE_GRID, _RELAXATION = _CoarseGrid(), _Relaxation()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ClosedField:
    """A field whose zero is a closed surface.

    Attributes:
        volume: The blocks that the surface passes through.
        distance: (B, 8, 8, 8) signed distances over the truncation, known everywhere.
        is_measured: (B, 8, 8, 8) voxels whose distance was measured.
    """

    volume: Volume
    distance: SingleArray
    is_measured: BoolArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Coarse:
    """A dense grid (X, Y, Z) of the field over all of the object; outside of it is outside."""

    origin: FloatArray
    spacing: float
    values: SingleArray

    def holds(self, points: FloatArray) -> BoolArray:
        """Which points (P, 3) lie within the outermost nodes."""
        where = (points - self.origin) / self.spacing
        return np.all((where > 0) & (where < np.array(self.values.shape) - 1), axis=1)

    def at(self, points: FloatArray) -> FloatArray:
        """Distances (P,) at points (P, 3), as a length, trilinear."""
        where = ((points - self.origin) / self.spacing).T
        scaled = map_coordinates(self.values, where, order=1, mode="nearest")
        return scaled * DEPTH_VOXELS * self.spacing


def closed_field(
    volume: Volume,
    images: Sequence[PosedImage],
    closing: Closing,
    depth: float,
    workers: int = 1,
) -> ClosedField:
    """Continue a volume's field so that its surface has no border.

    Args:
        volume: Of these images.
        images: Posed.
        closing: What is done with space of which nothing is known.
        depth: As for ``integrate``.
        workers: Threads; the result is the same for any number.
    """
    coarse = _coarse_field(volume, images, closing, workers)
    field = _begun(volume, closing, coarse)
    for k in range(_RELAXATION.rounds):
        if closing == "fill" and k < _RELAXATION.rounds - 1:
            is_fixed = ~_is_unknown(field.volume)
            nearby = field.volume.neighbours()
            how = _RELAXATION.fine_sweeps, _RELAXATION.factor
            _relax_blocks(field.distance, is_fixed, nearby, *how)
        while len(blocks := _missing_blocks(field)):
            new = empty_volume(volume.origin, volume.voxel, volume.truncation, blocks)
            add_images(new, images, depth, workers)
            field = _joined(field, _begun(new, closing, coarse))
    logger.debug("%d blocks close the surface", len(field.volume.blocks) - len(volume.blocks))
    return field


def _coarse_field(
    volume: Volume, images: Sequence[PosedImage], closing: Closing, workers: int
) -> _Coarse:
    low = volume.origin + volume.voxel * BLOCK * volume.blocks.min(axis=0)
    high = volume.origin + volume.voxel * BLOCK * (volume.blocks.max(axis=0) + 1)
    extent = high - low
    grid = _COARSE_GRID
    spacing = max(grid.min_voxels * volume.voxel, float(extent.max()) / grid.across)
    origin = low - grid.margin * spacing
    shape = np.ceil((extent / spacing + 2 * grid.margin + 1) / BLOCK).astype(np.int64)
    blocks = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    # Cut off where weights end: thinner parts of an object are the fine field's business.
    truncation = DEPTH_VOXELS * spacing
    coarse = empty_volume(origin, spacing, truncation, blocks)
    add_images(coarse, images, truncation, workers)
    values, is_unknown = _labelled(coarse)
    values, is_unknown = _dense(values, shape), _dense(is_unknown, shape)
    for axis in range(3):
        for end in (0, -1):
            np.moveaxis(values, axis, 0)[end] = 1.0
            np.moveaxis(is_unknown, axis, 0)[end] = False
    if closing == "fill":
        values[is_unknown] = 0.0
        _relax_grid(values, ~is_unknown, _RELAXATION.coarse_sweeps, _RELAXATION.factor)
    return _Coarse(origin=origin, spacing=spacing, values=values)


def _labelled(volume: Volume) -> tuple[SingleArray, BoolArray]:
    """Field of a volume, -1 where it is unknown, and where that is."""
    mean = volume.mean_distance()
    is_unknown = _is_unknown(volume)
    return np.where(np.isfinite(mean), mean, np.where(is_unknown, -1, 1)).astype(np.float32), (
        is_unknown
    )


def _is_unknown(volume: Volume) -> BoolArray:
    """Voxels (B, 8, 8, 8) that were neither measured nor seen to be empty."""
    return ~np.isfinite(volume.mean_distance()) & (volume.empty <= MIN_EMPTY)


def _dense(values: np.ndarray, shape: IntArray) -> np.ndarray:
    """Blocks (B, 8, 8, 8), sorted, as one array."""
    apart = values.reshape(*shape, BLOCK, BLOCK, BLOCK).transpose(0, 3, 1, 4, 2, 5)
    return np.ascontiguousarray(apart.reshape(shape * BLOCK))


def _begun(volume: Volume, closing: Closing, coarse: _Coarse) -> ClosedField:
    """The field of a volume, from the coarse grid where nothing is known.

    What is carved has the sharp edges of the rays: of the grid only its outside counts there.
    """
    values, is_unknown = _labelled(volume)
    block, *voxel = np.nonzero(is_unknown)
    index = BLOCK * volume.blocks[block] + np.stack(voxel, axis=1)
    points = volume.origin + volume.voxel * index
    if closing == "fill":
        values[is_unknown] = np.clip(coarse.at(points) / volume.truncation, -1.0, 1.0)
    else:
        values[is_unknown] = np.where(coarse.holds(points), -1.0, 1.0)
    is_measured = np.isfinite(volume.mean_distance())
    return ClosedField(volume=volume, distance=values, is_measured=is_measured)


def _missing_blocks(field: ClosedField) -> IntArray:
    """Blocks (N, 3) that are not kept though voxels inside and outside touch them."""
    inside, volume = field.distance < 0, field.volume
    layers = {-1: slice(0, 1), 0: slice(None), 1: slice(BLOCK - 1, None)}
    keys, some_in, some_out = [], [], []
    for step in product((-1, 0, 1), repeat=3):
        beside = volume.blocks + np.array(step)
        missing = np.flatnonzero(volume.find(beside) < 0)
        layer = inside[(missing, *(layers[s] for s in step))]
        keys.append(block_keys(beside[missing]))
        some_in.append(layer.any(axis=(1, 2, 3)))
        some_out.append(~layer.all(axis=(1, 2, 3)))
    unique, number = np.unique(np.concatenate(keys), return_inverse=True)
    is_in = np.bincount(number, weights=np.concatenate(some_in)) > 0
    is_out = np.bincount(number, weights=np.concatenate(some_out)) > 0
    return blocks_of(unique[is_in & is_out])


def _joined(first: ClosedField, second: ClosedField) -> ClosedField:
    volume, order = merged(first.volume, second.volume)
    return ClosedField(
        volume=volume,
        distance=np.concatenate([first.distance, second.distance])[order],
        is_measured=np.concatenate([first.is_measured, second.is_measured])[order],
    )


@njit(cache=True, nogil=True)
def _relax_grid(
    values: SingleArray, is_fixed: BoolArray, sweeps: int, factor: float
) -> None:  # pragma: no cover - compiled
    """Solve Laplace's equation off the fixed nodes of a grid, whose outermost nodes are fixed."""
    nx, ny, nz = values.shape
    for _ in range(sweeps):
        for i in range(1, nx - 1):
            for j in range(1, ny - 1):
                for k in range(1, nz - 1):
                    if is_fixed[i, j, k]:
                        continue
                    total = values[i - 1, j, k] + values[i + 1, j, k] + values[i, j - 1, k]
                    total += values[i, j + 1, k] + values[i, j, k - 1] + values[i, j, k + 1]
                    values[i, j, k] += factor * (total / 6.0 - values[i, j, k])


@njit(cache=True, nogil=True)
def _relax_blocks(
    values: SingleArray, is_fixed: BoolArray, nearby: IntArray, sweeps: int, factor: float
) -> None:  # pragma: no cover - compiled
    """The same over blocks with their neighbours; nothing flows where there is none."""
    size = values.shape[1]
    for _ in range(sweeps):
        for b, i, j, k in np.ndindex(values.shape):
            if is_fixed[b, i, j, k]:
                continue
            total, count = 0.0, 0
            for side in range(6):
                axis, step = side // 2, 2 * (side % 2) - 1
                x, y, z = i + step * (axis == 0), j + step * (axis == 1), k + step * (axis == 2)
                block = b
                if min(x, y, z) < 0 or max(x, y, z) >= size:
                    block = nearby[b, side]
                    x, y, z = x % size, y % size, z % size
                if block >= 0:
                    total += values[block, x, y, z]
                    count += 1
            if count > 0:
                values[b, i, j, k] += factor * (total / count - values[b, i, j, k])
