"""Range images fused into a sparse volume of weighted signed distances.

After Curless and Levoy, A volumetric method for building complex models from range images (1996);
distances are taken to the tangent plane of the pixel, and space seen empty only removes surface.
"""

from collections.abc import Sequence

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.errors import InputError
from scanweld.fusion.posed_image import PosedImage, SingleArray
from scanweld.fusion.sampling import plane_distance, project, smooth_distance
from scanweld.fusion.volume import BLOCK, KEY_BITS, Volume, block_keys, blocks_of, empty_volume
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.prepared import MIN_COSINE
from scanweld.work.threads import map_in_order

_MARGIN_BLOCKS = 8
"""Block coordinates below the lowest block that stay free: closing holes may need them."""
_TILE = 16
"""Pixels along the edge of a tile of an image."""
CHUNK = 512
"""Blocks that are worked on together: bounds the memory, and is a worker's share."""


def integrate(
    images: Sequence[PosedImage],
    voxel: float,
    truncation: float,
    depth: float,
    workers: int = 1,
) -> Volume:
    """Fuse images into a volume of the blocks that their surface may pass through.

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
    volume = _allocate(images, voxel, truncation, depth, workers)
    add_images(volume, images, depth, workers)
    return volume


def add_images(
    volume: Volume, images: Sequence[PosedImage], depth: float, workers: int = 1
) -> None:
    """Add images to the volume's sums, as ``integrate`` does."""
    tiles = [*map_in_order(lambda image: _tiles(image, depth), images, workers)]

    def work(start: int) -> None:
        part = slice(start, start + CHUNK)
        for image, (ends, has_free) in zip(images, tiles, strict=True):
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
                ends,
                image.free_camera.parameters,
                image.is_free,
                image.trust,
                has_free,
            )

    for _ in map_in_order(work, range(0, len(volume.blocks), CHUNK), workers):
        pass


def _tiles(image: PosedImage, depth: float) -> tuple[SingleArray, SingleArray]:
    """How far along the axis an image's tiles say anything of a surface, or of empty space."""
    surface = image.camera.parameters, image.depth, image.normals, image.weight
    return _tile_ends(*surface, depth), _tile_ends_of_free(image.is_free)


def _allocate(
    images: Sequence[PosedImage], voxel: float, truncation: float, depth: float, workers: int
) -> Volume:
    bounds = [each for each in map_in_order(_bounds, images, workers) if each is not None]
    if not bounds:
        raise InputError("the scans hold no surface to fuse: every pixel is seen too obliquely")
    low = np.min([low for low, _ in bounds], axis=0)
    high = np.max([high for _, high in bounds], axis=0)
    if float((high - low).max()) / voxel > 0.9 * 2**KEY_BITS:
        raise InputError(
            "the posed scans cannot be fused, because they are spread over more than a million "
            "voxels: check their poses, or ask for larger voxels"
        )
    origin = low - truncation - (1 + _MARGIN_BLOCKS * BLOCK) * voxel
    layout = np.array([*origin, voxel, min(truncation, depth + voxel)])

    def keys_of(image: PosedImage) -> IntArray:
        near = _near_surface(
            image.camera.parameters,
            image.depth,
            image.normals,
            image.weight,
            image.sensor_from_world.inverse().matrix(),
            layout,
        )
        return np.unique(block_keys(near))

    keys = np.zeros(0, np.int64)
    for found in map_in_order(keys_of, images, workers):
        keys = np.union1d(keys, found)
    return empty_volume(origin, voxel, truncation, blocks_of(keys))


def _bounds(image: PosedImage) -> tuple[FloatArray, FloatArray] | None:
    """Lowest and highest coordinates (3,) of an image's surface; None without one."""
    points = image.points()
    return (points.min(axis=0), points.max(axis=0)) if len(points) else None


@njit(cache=True, nogil=True)
def _near_surface(
    camera: FloatArray,
    depth: SingleArray,
    normals: SingleArray,
    weight: SingleArray,
    world_from_sensor: FloatArray,
    layout: FloatArray,
) -> IntArray:  # pragma: no cover - compiled
    """Blocks (N, 3), some of them twice, that rays pass through near the tangent planes they hit.

    The layout is the volume's origin and voxel, and how near to the planes.
    """
    m, voxel, reach = world_from_sensor, layout[3], layout[4]
    edge = BLOCK * voxel
    found = [(0, 0, 0)]
    found.clear()
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    last = np.full((int(2.0 * reach / (edge * MIN_COSINE)) + 3, 6), -1)
    for row, column in np.ndindex(depth.shape):
        if not weight[row, column] > 0.0:
            continue
        n, z = normals[row, column], float(depth[row, column])
        a, b = (column - camera[3]) / camera[1], (row - camera[4]) / camera[2]
        is_pinhole = camera[0] == 0.0
        cosine = -(a * n[0] + b * n[1] + n[2]) if is_pinhole else -n[2]
        ahead = reach / cosine
        length = 2.0 * ahead * (np.sqrt(a * a + b * b + 1.0) if is_pinhole else 1.0)
        num = int(length / edge) + 1
        for piece in range(num):
            first = z + ahead * (2.0 * piece / num - 1.0)
            final = z + ahead * (2.0 * (piece + 1) / num - 1.0)
            is_same = piece < len(last)
            for axis in range(3):
                along = m[axis, 0] * a + m[axis, 1] * b
                if is_pinhole:
                    p, q = (along + m[axis, 2]) * first, (along + m[axis, 2]) * final
                else:
                    p, q = along + m[axis, 2] * first, along + m[axis, 2] * final
                start = m[axis, 3] - layout[axis]
                low[axis] = int(np.floor((start + min(p, q) - voxel) / edge))
                high[axis] = int(np.floor((start + max(p, q) + voxel) / edge))
                if piece < len(last):
                    is_same &= last[piece, axis] == low[axis]
                    is_same &= last[piece, axis + 3] == high[axis]
                    last[piece, axis], last[piece, axis + 3] = low[axis], high[axis]
            if is_same:
                continue
            for i in range(low[0], high[0] + 1):
                for j in range(low[1], high[1] + 1):
                    for k in range(low[2], high[2] + 1):
                        found.append((i, j, k))
    return np.array(found).reshape(-1, 3)


@njit(cache=True, nogil=True)
def _tile_ends(
    camera: FloatArray, depth: SingleArray, normals: SingleArray, weight: SingleArray, reach: float
) -> SingleArray:  # pragma: no cover - compiled
    """Depth, of each tile of pixels, behind which no plane of its pixels is within reach."""
    height, width = depth.shape
    ends = np.full((height // _TILE + 1, width // _TILE + 1), -np.inf, np.float32)
    for row, column in np.ndindex(depth.shape):
        if not weight[row, column] > 0.0:
            continue
        n, z = normals[row, column], float(depth[row, column])
        # Points that are looked up lie up to half a pixel off its centre.
        off = 0.5 * (abs(n[0]) / camera[1] + abs(n[1]) / camera[2])
        if camera[0] == 0.0:
            a, b = (column - camera[3]) / camera[1], (row - camera[4]) / camera[2]
            cosine = -(a * n[0] + b * n[1] + n[2])
            end = (reach + z * cosine) / (cosine - off) if cosine > off else np.inf
        else:
            end = z - (reach + off) / n[2]
        tile = row // _TILE, column // _TILE
        ends[tile] = max(ends[tile], end + 1e-3 * reach)
    return ends


@njit(cache=True, nogil=True)
def _tile_ends_of_free(is_free: BoolArray) -> SingleArray:  # pragma: no cover - compiled
    """The same of pixels that saw empty space however far they saw."""
    ends = np.full(
        (is_free.shape[0] // _TILE + 1, is_free.shape[1] // _TILE + 1), -np.inf, np.float32
    )
    for row, column in np.ndindex(is_free.shape):
        if is_free[row, column]:
            ends[row // _TILE, column // _TILE] = np.inf
    return ends


@njit(cache=True, nogil=True)
def _is_before(
    ends: SingleArray, shape: tuple[int, int], camera: FloatArray, corners: FloatArray
) -> bool:  # pragma: no cover - compiled
    """Whether a box with corners (8, 3), sensor frame, reaches before the ends of its tiles."""
    left, top, right, bottom, near = np.inf, np.inf, -np.inf, -np.inf, np.inf
    for c in range(8):
        x, y, z = corners[c, 0], corners[c, 1], corners[c, 2]
        if camera[0] == 0.0 and z <= 0.0:
            return True
        u, v = project(camera, x, y, z)
        left, right, near = min(left, u), max(right, u), min(near, z)
        top, bottom = min(top, v), max(bottom, v)
    if right < -0.5 or bottom < -0.5 or left > shape[1] - 0.5 or top > shape[0] - 0.5:
        return False
    for row in range(_tile(top, shape[0]), _tile(bottom, shape[0]) + 1):
        for column in range(_tile(left, shape[1]), _tile(right, shape[1]) + 1):
            if near <= ends[row, column]:
                return True
    return False


@njit(cache=True, nogil=True)
def _tile(at: float, size: int) -> int:  # pragma: no cover - compiled
    return int(min(max(at + 0.5, 0.0), size - 1.0)) // _TILE


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
    ends: SingleArray,
    free_camera: FloatArray,
    is_free: BoolArray,
    trust: float,
    has_free: SingleArray,
) -> None:  # pragma: no cover - compiled
    """Add one image: all voxels of all blocks that project into it.

    The layout is the volume's origin, voxel and truncation, and the depth of weights; what lies
    behind the ends of the image's tiles is passed over.
    """
    m, size, voxel, truncation = sensor_from_world, distance.shape[1], layout[3], layout[4]
    fade = layout[5] / truncation
    height, width = depth.shape
    corners = np.empty((8, 3))
    for block in range(len(blocks)):
        bx = layout[0] + voxel * (blocks[block, 0] * size)
        by = layout[1] + voxel * (blocks[block, 1] * size)
        bz = layout[2] + voxel * (blocks[block, 2] * size)
        for c in range(8):
            wx, wy = bx + (c & 1) * (size - 1) * voxel, by + (c >> 1 & 1) * (size - 1) * voxel
            wz = bz + (c >> 2) * (size - 1) * voxel
            for axis in range(3):
                corners[c, axis] = m[axis, 0] * wx + m[axis, 1] * wy + m[axis, 2] * wz + m[axis, 3]
        has_surface = _is_before(ends, depth.shape, camera, corners)
        sees_through = _is_before(has_free, is_free.shape, free_camera, corners)
        if not (has_surface or sees_through):
            continue
        for i, j in np.ndindex((size, size)):
            wx, wy = bx + voxel * i, by + voxel * j
            ax = m[0, 0] * wx + m[0, 1] * wy + m[0, 3]
            ay = m[1, 0] * wx + m[1, 1] * wy + m[1, 3]
            az = m[2, 0] * wx + m[2, 1] * wy + m[2, 3]
            for k in range(size):
                wz = bz + voxel * k
                x, y, z = ax + m[0, 2] * wz, ay + m[1, 2] * wz, az + m[2, 2] * wz
                u, v = project(camera, x, y, z)
                w, row, column = 0.0, 0, 0
                if -0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5:
                    row, column = int(v + 0.5), int(u + 0.5)
                    w = pixel_weight[row, column]
                if not w > 0.0:
                    if sees_through:
                        u, v = project(free_camera, x, y, z)
                        inside = -0.5 <= u < is_free.shape[1] - 0.5
                        inside = inside and -0.5 <= v < is_free.shape[0] - 0.5
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
