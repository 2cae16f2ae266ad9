"""From signed distances to triangles: extraction where the volume was seen, and cleaning."""

import logging

import numpy as np

from scanweld.fusion.cases import corner_offsets, edge_corners, triangle_table
from scanweld.fusion.volume import BLOCK, KEY_BITS, Volume, VoxelArray
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import compact, face_normals, pieces

logger = logging.getLogger(__name__)

_CHUNK = 4096
"""Blocks that are looked at together; bounds the memory."""
_MIN_STEP = 0.02
"""Vertices keep this share of a voxel's edge away from its ends: no triangle shrinks to nothing."""
_MIN_PIECE_VOXELS = 50.0
_MIN_PIECE_SHARE = 2e-3
"""Pieces with less area than so many squared voxels, or this share of all area, are dropped."""


def extract_surface(volume: Volume) -> tuple[FloatArray, IntArray]:
    """Marching cubes over the cells whose eight corners were all seen.

    Returns:
        Vertices (V, 3) in the world frame and faces (F, 3), counter-clockwise from outside. An edge
        has one face at the border of what was seen, two elsewhere.
    """
    distance = volume.mean_distance()
    edge_keys, values = [], []
    for start in range(0, len(volume.blocks), _CHUNK):
        index = np.arange(start, min(start + _CHUNK, len(volume.blocks)))
        keys, ends = _cell_edges(volume, distance, index)
        edge_keys.append(keys)
        values.append(ends)
    keys, first, inverse = np.unique(
        np.concatenate(edge_keys), return_index=True, return_inverse=True
    )
    vertices = _vertices(volume, keys, np.concatenate(values)[first])
    return vertices, inverse.reshape(-1, 3)


def _cell_edges(
    volume: Volume, distance: VoxelArray, index: IntArray
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
    keys = (base[:, 0] << KEY_BITS | base[:, 1]) << KEY_BITS | base[:, 2]
    values = corners[:, is_crossed].T
    return 3 * keys + edge // 4, values[row[:, None], ends].astype(np.float64)


def _with_neighbours(volume: Volume, distance: VoxelArray, index: IntArray) -> VoxelArray:
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
    axis, corner = keys % 3, keys // 3
    mask = (1 << KEY_BITS) - 1
    base = np.stack([corner >> 2 * KEY_BITS, corner >> KEY_BITS & mask, corner & mask], axis=1)
    step = np.clip(values[:, 0] / (values[:, 0] - values[:, 1]), _MIN_STEP, 1 - _MIN_STEP)
    return volume.origin + volume.voxel * (base + step[:, None] * np.eye(3)[axis])


def drop_small_pieces(
    vertices: FloatArray, faces: IntArray, voxel: float
) -> tuple[FloatArray, IntArray]:
    """The mesh without the connected pieces too small to be trusted; the largest always stays."""
    if not len(faces):
        return vertices, faces
    piece = pieces(faces, len(vertices))[faces[:, 0]]
    face_area = 0.5 * np.linalg.norm(face_normals(vertices, faces), axis=1)
    area = np.bincount(piece, weights=face_area)
    min_area = max(_MIN_PIECE_VOXELS * voxel**2, _MIN_PIECE_SHARE * float(area.sum()))
    stays = (area >= min_area) | (np.arange(len(area)) == np.argmax(area))
    logger.debug("%d of %d pieces stay", stays.sum(), len(area))
    kept, kept_faces, _ = compact(vertices, faces[stays[piece]])
    return kept, kept_faces
