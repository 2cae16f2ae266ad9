"""From signed distances to triangles, where there are distances."""

import numpy as np

from scanweld.fusion.cases import corner_offsets, edge_corners, triangle_table
from scanweld.fusion.posed_image import SingleArray
from scanweld.fusion.volume import BLOCK, CHUNK, Volume, block_keys, blocks_of
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

_MIN_STEP = 0.02
"""Vertices keep this share of a voxel's edge away from its ends: no triangle shrinks to nothing."""


def extract_surface(
    volume: Volume, distance: SingleArray | None = None
) -> tuple[FloatArray, IntArray]:
    """Marching cubes over the cells whose eight corners have a distance.

    Args:
        volume: Where the voxels are.
        distance: (B, 8, 8, 8) of them, NaN where unknown; the mean distances if not given.

    Returns:
        Vertices (V, 3) in the world frame and faces (F, 3), counter-clockwise from outside. An edge
        has one face at the border of what was seen, two elsewhere.
    """
    distance = volume.mean_distance() if distance is None else distance
    found: list[tuple[IntArray, FloatArray]] = []
    corners: list[IntArray] = []
    num_found = 0
    for start in range(0, len(volume.blocks), CHUNK):
        index = np.arange(start, min(start + CHUNK, len(volume.blocks)))
        keys, ends = _cell_edges(volume, distance, index)
        keys, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        found.append((keys, ends[first]))
        corners.append(inverse.reshape(-1) + num_found)
        num_found += len(keys)
    keys, first, inverse = np.unique(
        np.concatenate([keys for keys, _ in found]), return_index=True, return_inverse=True
    )
    vertices = _vertices(volume, keys, np.concatenate([ends for _, ends in found])[first])
    faces = inverse.reshape(-1)[np.concatenate(corners)].reshape(-1, 3)
    return vertices, faces.astype(np.int64)


def _cell_edges(
    volume: Volume, distance: SingleArray, index: IntArray
) -> tuple[IntArray, FloatArray]:
    """Edges crossed by the surface, three a triangle, with the values at both of their ends.

    Returns:
        Keys (3 T,) of edges and values (3 T, 2).
    """
    padded = _with_neighbours(volume, distance, index)
    offsets = corner_offsets()
    corners = np.stack([padded[:, i:, j:, k:][:, :BLOCK, :BLOCK, :BLOCK] for i, j, k in offsets])
    case = np.packbits(corners < 0, axis=0, bitorder="little")[0]
    is_crossed = (case > 0) & (case < 255) & np.isfinite(corners).all(axis=0)
    cell = np.argwhere(is_crossed)
    edges = triangle_table().reshape(256, -1)[case[is_crossed]]
    row, column = np.nonzero(edges >= 0)
    edge = edges[row, column]
    ends = edge_corners()[edge]
    block, voxel = volume.blocks[index[cell[:, 0]]], cell[:, 1:]
    base = (BLOCK * block + voxel)[row] + offsets[ends[:, 0]]
    values = corners[:, is_crossed].T
    return 3 * block_keys(base) + edge // 4, values[row[:, None], ends].astype(np.float64)


def _with_neighbours(volume: Volume, distance: SingleArray, index: IntArray) -> SingleArray:
    """(N, 9, 9, 9) distances of blocks and of the next voxels; NaN where unseen."""
    padded = np.full((len(index), BLOCK + 1, BLOCK + 1, BLOCK + 1), np.nan, np.float32)
    for shift in corner_offsets():
        other = volume.find(volume.blocks[index] + shift)
        has_other = other >= 0
        source = tuple(slice(0, 1) if s else slice(None) for s in shift)
        target = tuple(slice(BLOCK, None) if s else slice(0, BLOCK) for s in shift)
        padded[(has_other, *target)] = distance[(other[has_other], *source)]
    return padded


def _vertices(volume: Volume, keys: IntArray, values: FloatArray) -> FloatArray:
    """Where the distance is zero on edges, by linear interpolation."""
    axis, base = keys % 3, blocks_of(keys // 3)
    step = np.clip(values[:, 0] / (values[:, 0] - values[:, 1]), _MIN_STEP, 1 - _MIN_STEP)
    return volume.origin + volume.voxel * (base + step[:, None] * np.eye(3)[axis])


def vertex_flags(volume: Volume, flags: BoolArray, vertices: FloatArray) -> BoolArray:
    """Whether both voxels at the ends of the edge that a vertex lies on have a flag.

    Args:
        volume: Where the voxels are.
        flags: (B, 8, 8, 8) of them.
        vertices: (V, 3) as ``extract_surface`` gives them.

    Returns:
        (V,), False where a block is not kept.
    """
    where = (vertices - volume.origin) / volume.voxel
    low = np.floor(where + 0.5 * _MIN_STEP).astype(np.int64)
    axis = np.argmax(where - low, axis=1)
    high = low + np.eye(3, dtype=np.int64)[axis]
    both = np.ones(len(vertices), dtype=bool)
    for end in (low, high):
        block = volume.find(end // BLOCK)
        i, j, k = (end % BLOCK).T
        both &= (block >= 0) & flags[block, i, j, k]
    return both
