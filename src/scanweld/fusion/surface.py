"""From signed distances to triangles, where there are distances."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.fusion.cases import corner_offsets, edge_corners, triangle_table
from scanweld.fusion.posed_image import SingleArray
from scanweld.fusion.volume import BLOCK, KEY_BITS, Volume
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray

_MIN_STEP = 0.02
"""Vertices keep this share of a voxel's edge away from its ends: no triangle shrinks to nothing."""
_HASH = 0x9E3779B1
"""Odd, 2^32 over the golden ratio (Knuth): its products scatter keys over a table."""


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
    beside = np.stack([volume.find(volume.blocks + step) for step in corner_offsets()], axis=1)
    table, corners = triangle_table().reshape(256, -1), edge_corners()
    sizes = _count(distance, beside, (table >= 0).sum(axis=1) // 3)
    vertices, faces = _march(distance, beside, volume.blocks, table, corners, *sizes)
    return volume.origin + volume.voxel * vertices, faces


@njit(cache=True, nogil=True)
def _crossed(
    distance: SingleArray, beside: IntArray, block: int, values: SingleArray
) -> bool:  # pragma: no cover - compiled
    """Whether distances have both signs; values (9, 9, 9) of a block and of the next voxels."""
    least, most = np.inf, -np.inf
    for i, j, k in np.ndindex(values.shape):
        other = beside[block, i // BLOCK + 2 * (j // BLOCK) + 4 * (k // BLOCK)]
        value = np.float32(np.nan)
        if other >= 0:
            value = distance[other, i % BLOCK, j % BLOCK, k % BLOCK]
            least, most = min(least, value), max(most, value)
        values[i, j, k] = value
    return bool(least < 0.0 <= most)


@njit(cache=True, nogil=True)
def _case(values: SingleArray, i: int, j: int, k: int) -> int:  # pragma: no cover - compiled
    """Which corners of a cell are inside, as bits; 0 if one of them is not known."""
    case = 0
    for c in range(8):
        value = values[i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]
        if np.isnan(value):
            return 0
        case |= (value < 0.0) << c
    return case


@njit(cache=True, nogil=True)
def _count(
    distance: SingleArray, beside: IntArray, per_case: IntArray
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Number of faces, and of edges between voxels that the surface may cross.

    Known is the number of faces in each of the 256 cases.
    """
    values = np.empty((BLOCK + 1, BLOCK + 1, BLOCK + 1), np.float32)
    num_faces, num_edges = 0, 0
    for block in range(len(distance)):
        if not _crossed(distance, beside, block, values):
            continue
        for i, j, k in np.ndindex((BLOCK, BLOCK, BLOCK)):
            num_faces += per_case[_case(values, i, j, k)]
            is_in = values[i, j, k] < 0.0
            num_edges += is_in != (values[i + 1, j, k] < 0.0)
            num_edges += is_in != (values[i, j + 1, k] < 0.0)
            num_edges += is_in != (values[i, j, k + 1] < 0.0)
    return num_faces, num_edges


@njit(cache=True, nogil=True)
def _march(
    distance: SingleArray,
    beside: IntArray,
    blocks: IntArray,
    table: IntArray,
    edge_ends: IntArray,
    num_faces: int,
    num_edges: int,
) -> tuple[FloatArray, IntArray]:  # pragma: no cover - compiled
    """Vertices (V, 3), in voxels, and faces (F, 3); a hash table knows the edges that were met."""
    values = np.empty((BLOCK + 1, BLOCK + 1, BLOCK + 1), np.float32)
    size = 2
    while 2 * size < 3 * num_edges:
        size *= 2
    keys, vertex_of = np.full(size, -1), np.empty(size, np.int32)
    vertices, faces = np.empty((num_edges, 3)), np.empty((num_faces, 3), np.int64)
    num_vertices, corner = 0, 0
    for block in range(len(distance)):
        if not _crossed(distance, beside, block, values):
            continue
        for i, j, k in np.ndindex((BLOCK, BLOCK, BLOCK)):
            for edge in table[_case(values, i, j, k)]:
                if edge < 0:
                    break
                first, second = edge_ends[edge]
                x, y, z = i + (first & 1), j + (first >> 1 & 1), k + (first >> 2)
                key = BLOCK * blocks[block, 0] + x
                key = (key << KEY_BITS) | (BLOCK * blocks[block, 1] + y)
                key = 3 * ((key << KEY_BITS) | (BLOCK * blocks[block, 2] + z)) + edge // 4
                slot = (key * _HASH >> 20) & (size - 1)
                while keys[slot] != key and keys[slot] >= 0:
                    slot = (slot + 1) & (size - 1)
                if keys[slot] < 0:
                    keys[slot], vertex_of[slot] = key, num_vertices
                    value = float(values[x, y, z])
                    other = values[i + (second & 1), j + (second >> 1 & 1), k + (second >> 2)]
                    step = min(max(value / (value - other), _MIN_STEP), 1 - _MIN_STEP)
                    vertices[num_vertices, 0] = BLOCK * blocks[block, 0] + x
                    vertices[num_vertices, 1] = BLOCK * blocks[block, 1] + y
                    vertices[num_vertices, 2] = BLOCK * blocks[block, 2] + z
                    vertices[num_vertices, edge // 4] += step
                    num_vertices += 1
                faces[corner // 3, corner % 3] = vertex_of[slot]
                corner += 1
    return vertices[:num_vertices].copy(), faces


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
