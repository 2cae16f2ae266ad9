"""A scan laid out for the compiled kernels: what its sensor saw, and its closest points."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.prepared import PreparedScan, RangeImage

VOXEL_DIAMETERS = 0.01
GRID_MARGIN_DIAMETERS = 0.09
NUM_NEIGHBOURS = 6
"""Nearest samples of each: violations of neighbours make patches."""

RASTER_DEPTH, RASTER_NORMAL, RASTER_OUTSIDE, RASTER_KIND = 0, 1, 4, 5
"""Channels of a raster: depth, normal (three), distance outside the silhouette, kind."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanField:
    """What pair registration asks of a scan, in its sensor frame, as plain arrays.

    Attributes:
        diameter: Diameter of the scan, in its unit.
        jump_pixels: Depth step between neighbouring pixels, in footprints, above which they are on
            different surfaces.
        camera: (5,) parameters of the range image's camera.
        raster: (H, W, 6) float32 depth, normal, outside, kind of each pixel.
        points: (N, 3) evenly spread samples, any prefix of which is evenly spread too.
        normals: (N, 3) their normals.
        centre: (3,) mean of the samples.
        surface: (M, 7) points, normals and a flag that is 1 off the rim: targets of matching.
        closest: (A, B, C) int32 index into surface of the point nearest to each voxel.
        origin: (4,) centre of voxel (0, 0, 0), and the voxels' edge.
        neighbours: (N, 6) int32 index of the samples nearest to each.
    """

    diameter: float
    jump_pixels: float
    camera: FloatArray
    raster: NDArray[np.float32]
    points: FloatArray
    normals: FloatArray
    centre: FloatArray
    surface: FloatArray
    closest: NDArray[np.int32]
    origin: FloatArray
    neighbours: NDArray[np.int32] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "neighbours", _neighbours(self.points))


def make_field(scan: PreparedScan) -> ScanField:
    """Lay out a scan; lengths follow its own diameter, so that no other scan changes it."""
    samples = scan.samples
    surface, closest, origin = _closest_points(scan)
    return ScanField(
        diameter=scan.diameter,
        jump_pixels=scan.image.jump_pixels,
        camera=scan.image.camera.parameters,
        raster=_raster(scan.image),
        points=np.array(samples.points),
        normals=np.array(samples.normals),
        centre=samples.points.mean(axis=0),
        surface=surface,
        closest=closest,
        origin=origin,
    )


def with_margin(field: ScanField, margin: float) -> ScanField:
    """The scan as if its silhouette lay farther out: what is nearer to it is unknown, not free.

    Args:
        field: The scan.
        margin: How far, at the middle of the scan, in its unit.
    """
    raster = field.raster.copy()
    raster[..., RASTER_OUTSIDE] = np.maximum(raster[..., RASTER_OUTSIDE] - margin, 0.0)
    return replace(field, raster=raster)


def _neighbours(points: FloatArray) -> NDArray[np.int32]:
    count = min(NUM_NEIGHBOURS, len(points) - 1)
    _, nearest = KDTree(points).query(points, count + 1)
    return np.ascontiguousarray(nearest.reshape(len(points), -1)[:, 1:], dtype=np.int32)


def _raster(image: RangeImage) -> NDArray[np.float32]:
    raster = np.zeros((*image.depth.shape, 6), dtype=np.float32)
    raster[..., RASTER_DEPTH] = image.depth
    raster[..., RASTER_NORMAL : RASTER_NORMAL + 3] = image.normals
    raster[..., RASTER_OUTSIDE] = image.outside
    raster[..., RASTER_KIND] = image.kind
    return raster


def _closest_points(
    scan: PreparedScan,
) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    """One surface point for each occupied voxel, and for each voxel the nearest occupied one."""
    edge = VOXEL_DIAMETERS * scan.diameter
    vertices, off_rim = scan.mesh.vertices, ~scan.image.is_rim[np.isfinite(scan.image.depth)]
    origin = vertices.min(axis=0) - GRID_MARGIN_DIAMETERS * scan.diameter
    span = vertices.max(axis=0) + GRID_MARGIN_DIAMETERS * scan.diameter - origin
    shape = np.ceil(span / edge).astype(np.int64) + 1
    cell = np.rint((vertices - origin) / edge).astype(np.int64)
    flat = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    chosen = _representatives(flat, vertices - origin - cell * edge, off_rim)
    normals = np.asarray(scan.mesh.normals)
    surface = np.column_stack([vertices, normals, off_rim])[chosen].astype(np.float64)

    index = np.full(shape, -1, dtype=np.int32)
    index.ravel()[flat[chosen]] = np.arange(len(chosen), dtype=np.int32)
    nearest = np.zeros((3, *shape), dtype=np.int32)
    ndimage.distance_transform_edt(
        index < 0, return_distances=False, return_indices=True, indices=nearest
    )
    closest = index[tuple(nearest)]
    return np.ascontiguousarray(surface), np.ascontiguousarray(closest), np.append(origin, edge)


def _representatives(flat: IntArray, offsets: FloatArray, off_rim: NDArray[np.bool_]) -> IntArray:
    """Index of one point for each voxel: off the rim if it has one, the most central of them."""
    distance2 = (offsets**2).sum(axis=1)
    order = np.lexsort((distance2, ~off_rim, flat))
    _, first = np.unique(flat[order], return_index=True)
    return order[first]
