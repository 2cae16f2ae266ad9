"""A scan as a range image at the working resolution, whatever its file looked like."""

from typing import TYPE_CHECKING

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.grid import GAP_ROUNDS, grid_faces
from scanweld.geometry.mesh import (
    MIN_PIECE_SHARE,
    SMOOTHING_ROUNDS,
    TriangleMesh,
    border_vertices,
    pieces,
    smoothed_normals,
)
from scanweld.geometry.prepared import RangeImage
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import RangeScan
from scanweld.preparation.denoise import CLEAN_NOISE_PIXELS, clean_depth, has_gaps
from scanweld.preparation.silhouette import classify_pixels

if TYPE_CHECKING:
    from scanweld.config import PrepareConfig

MARGIN_DIAMETERS = 0.05
"""Width of the free space around the closed silhouette that is part of the image."""
MAX_EDGE_PIXELS = 4.0
"""Points farther apart than this across the line of sight are not joined by a triangle."""
COARSE_PIXELS = 80
"""A scan with faces and fewer points across its diameter is coarse. It is rendered with at least
twice as many pixels, finer than its points: else the rims would take most of its surface."""
POINT_PIXELS = 1.6
"""Size of a pixel of points without a grid or faces, in point spacings: smaller pixels would leave
most of the surface empty."""


def make_range_image(
    scan: RangeScan, points: FloatArray, resolution: float, diameter: float, config: "PrepareConfig"
) -> tuple[RangeImage, TriangleMesh]:
    """Render a scan into a regular range image along its own viewing rays.

    Args:
        scan: A scan whose sensor is located.
        points: (N, 3), the scan's points in the sensor frame.
        resolution: Median spacing of the points.
        diameter: Diameter of the scan.
        config: Settings.

    Returns:
        The range image, and the surface between its pixels cut at depth jumps: vertices are the
        surface pixels in row-major order, faces and smoothed normals look to the sensor.
    """
    spacing = max(natural_pixel(scan, resolution), diameter / config.image_pixels)
    organised = scan.grid is not None or scan.faces is not None
    pixel = _pixel_size(spacing, diameter, config) if organised else spacing
    margin = (config.closing_diameters + MARGIN_DIAMETERS) * diameter
    camera, depth, mesh = render_surface(scan, points, spacing, pixel, margin, config)
    closing = config.closing_diameters * diameter / pixel
    in_view, blind = _in_view(scan, camera), _blind(scan, camera)
    kind, outside = classify_pixels(np.isfinite(depth), in_view, blind, closing)
    normals, is_rim = normals_image(depth, mesh), rim_pixels(depth, mesh, config.rim_pixels)
    with np.errstate(invalid="ignore"):
        is_facing = incidence_cosines(camera, depth, normals) > config.min_cosine
    image = RangeImage(
        camera=camera,
        depth=depth,
        normals=normals,
        kind=kind,
        outside=outside * pixel,
        is_rim=is_rim,
        is_reliable=np.isfinite(depth) & ~is_rim & is_facing,
        pixel=pixel,
        jump_pixels=config.jump_pixels,
    )
    return image, mesh


def natural_pixel(scan: RangeScan, resolution: float) -> float:
    """The finest footprint of a pixel that a scan's points, with this spacing, can fill."""
    is_organised = scan.grid is not None or scan.faces is not None
    return resolution * (1.0 if is_organised else POINT_PIXELS)


def render_surface(
    scan: RangeScan,
    points: FloatArray,
    spacing: float,
    pixel: float,
    margin: float,
    config: "PrepareConfig",
    max_noise_pixels: float = CLEAN_NOISE_PIXELS,
) -> tuple[Camera, FloatArray, TriangleMesh]:
    """A scan's surface along its own viewing rays, at any footprint of a pixel.

    Args:
        scan: A scan whose sensor is located.
        points: (N, 3), the scan's points in the sensor frame.
        spacing: Of the points, or coarser; points farther apart than some of it are not joined.
        pixel: Footprint of a pixel on the object.
        margin: Space around the points that the image holds, likewise a length.
        config: Settings.
        max_noise_pixels: Noise of depth, in pixels, above which it is smoothed.

    Returns:
        The camera, the depth (H, W), NaN where there is no surface, and the mesh between the
        pixels cut at depth jumps: vertices are the surface pixels in row-major order.
    """
    camera = working_camera(scan, points, pixel, margin)
    faces, max_step = _scan_faces(scan, points, spacing, config), config.jump_pixels * pixel
    if faces is not None:
        depth, _ = render_depth(points, faces, camera)
        # Points that lost returns have cut off from every face are surface too: without them the
        # silhouette shrinks, and right poses seem to lie in free space. Where many returns are
        # lost the faces that are left leave most of the surface out.
        is_lonely = np.ones(len(points), dtype=bool)
        if not has_gaps(depth):
            is_lonely[faces] = False
        splat = _splat(points[is_lonely], camera, max_step)
        depth = np.where(np.isfinite(depth), depth, splat)
    else:
        depth = _splat(points, camera, max_step)
    for _ in range(GAP_ROUNDS):
        depth = _fill_pinholes(depth, max_step)
    depth = clean_depth(depth, pixel, max_step, max_noise_pixels)
    depth, mesh = _surface(depth, camera, pixel, config)
    return camera, depth, mesh


def _pixel_size(spacing: float, diameter: float, config: "PrepareConfig") -> float:
    """Footprint of a pixel: the points' spacing, or a whole part of it where that is coarse."""
    if spacing * min(COARSE_PIXELS, config.image_pixels) <= diameter:
        return spacing
    return float(spacing / np.ceil(spacing * 2 * COARSE_PIXELS / diameter))


def working_camera(scan: RangeScan, points: FloatArray, pixel: float, margin: float) -> Camera:
    """A camera along the scan's viewing rays whose pixels have a given footprint on the object.

    It is a pinhole where the sensor's centre is known and the points lie well before it, else
    orthographic; its axes are those of the sensor frame.
    """
    z = points[:, 2]
    is_central = scan.camera is not None and scan.camera.model is not CameraModel.ORTHOGRAPHIC
    if is_central and z.min() > 0.5 * np.hypot(points[:, 0], points[:, 1]).max():
        model, focal = CameraModel.PINHOLE, float(np.median(z)) / pixel
        flat = focal * points[:, :2] / z[:, None]
    else:
        model, focal = CameraModel.ORTHOGRAPHIC, 1.0 / pixel
        flat = focal * points[:, :2]
    low = np.floor(flat.min(axis=0) - margin / pixel)
    high = np.ceil(flat.max(axis=0) + margin / pixel)
    width, height = (high - low + 1).astype(int)
    return Camera(
        model=model,
        width=int(width),
        height=int(height),
        fx=focal,
        fy=focal,
        cx=float(-low[0]),
        cy=float(-low[1]),
    )


def _scan_faces(
    scan: RangeScan, points: FloatArray, spacing: float, config: "PrepareConfig"
) -> IntArray | None:
    """Triangles (F, 3) between the scan's points; None for bare points."""
    if scan.grid is None:
        return scan.faces
    max_step = config.jump_pixels * spacing
    return grid_faces(scan.grid, points, points[:, 2], max_step, MAX_EDGE_PIXELS * spacing)


def _splat(points: FloatArray, camera: Camera, max_step: float) -> FloatArray:
    """Depth of the nearest surface at the middle of each pixel, NaN where there is none.

    The nearest point of a pixel alone would bring tilted surfaces forward: the whole scan would
    look larger than it is. So points of one surface are averaged, and brought to the middle.

    Args:
        points: (N, 3), sensor frame.
        camera: Of the image.
        max_step: Points of a pixel farther behind the nearest one are on another surface.
    """
    shape = (camera.height, camera.width)
    pixels, z = camera.project(points)
    cells = np.rint(pixels).astype(np.int64)
    flat = cells[:, 1] * camera.width + cells[:, 0]
    nearest = np.full(shape, np.inf).ravel()
    np.minimum.at(nearest, flat, z)
    front = z <= nearest[flat] + max_step
    away, flat, z = (pixels - cells)[front], flat[front], z[front]
    count = np.bincount(flat, minlength=nearest.size).reshape(shape)

    def mean(values: FloatArray) -> FloatArray:
        total = np.bincount(flat, weights=values, minlength=nearest.size).reshape(shape)
        return np.divide(total, count, out=np.full(shape, np.nan), where=count > 0)

    depth = mean(z)
    right, down = mean(away[:, 0]), mean(away[:, 1])
    return depth - right * _slope(depth, 1, max_step) - down * _slope(depth, 0, max_step)


def _slope(depth: FloatArray, axis: int, max_step: float) -> FloatArray:
    """Change of depth (H, W) from pixel to pixel along an axis; 0 across edges and beside gaps."""
    padded = np.pad(depth, 1, constant_values=np.nan)
    after = np.roll(padded, -1, axis)[1:-1, 1:-1] - depth
    before = depth - np.roll(padded, 1, axis)[1:-1, 1:-1]
    steps = np.stack([after, before])
    is_one = np.abs(steps) <= max_step
    total = np.where(is_one, steps, 0.0).sum(axis=0)
    return total / np.maximum(is_one.sum(axis=0), 1)


def _fill_pinholes(depth: FloatArray, max_step: float) -> FloatArray:
    """Fill empty pixels between opposite neighbours on one surface: lost returns, gaps of a splat.

    They get the mean depth of all such pairs of neighbours.
    """
    padded = np.pad(depth, 1, constant_values=np.nan)
    height, width = depth.shape
    total, count = np.zeros(depth.shape), np.zeros(depth.shape)
    for y, x in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = padded[1 + y : 1 + y + height, 1 + x : 1 + x + width]
        b = padded[1 - y : 1 - y + height, 1 - x : 1 - x + width]
        is_one = np.abs(a - b) <= max_step
        total[is_one] += 0.5 * (a + b)[is_one]
        count += is_one
    return np.where(np.isnan(depth) & (count > 0), total / np.maximum(count, 1), depth)


def _surface(
    depth: FloatArray, camera: Camera, pixel: float, config: "PrepareConfig"
) -> tuple[FloatArray, TriangleMesh]:
    """The mesh of a depth image, and the image without pieces too small to be a surface."""
    points, faces = _depth_faces(depth, camera, pixel, config)
    keep = _piece_sizes(faces, len(points)) >= MIN_PIECE_SHARE * len(points)
    if not keep.all():
        kept = depth.copy()
        kept[np.isfinite(depth)] = np.where(keep, depth[np.isfinite(depth)], np.nan)
        depth = kept
        points, faces = _depth_faces(depth, camera, pixel, config)
    normals = _smoothed_normals(points, faces, camera)
    return depth, TriangleMesh(vertices=points, faces=faces, normals=normals)


def _depth_faces(
    depth: FloatArray, camera: Camera, pixel: float, config: "PrepareConfig"
) -> tuple[FloatArray, IntArray]:
    """Points (V, 3) of the surface's pixels in row-major order, and triangles (F, 3) of them."""
    has = np.isfinite(depth)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[has] = np.arange(int(has.sum()))
    points = camera.unproject_image(depth)[has]
    faces = grid_faces(
        grid, points, points[:, 2], config.jump_pixels * pixel, MAX_EDGE_PIXELS * pixel
    )
    return points, faces


def _smoothed_normals(points: FloatArray, faces: IntArray, camera: Camera) -> FloatArray:
    """Area-weighted normals (V, 3), averaged over the neighbours along the mesh, to the sensor."""
    normals = smoothed_normals(points, faces, SMOOTHING_ROUNDS)
    lonely = ~(np.abs(normals).sum(axis=1) > 0)
    normals[lonely] = -camera.view_directions(points[lonely])
    return normals


def _piece_sizes(faces: IntArray, num_vertices: int) -> IntArray:
    """How many vertices (V,) the connected piece of each vertex has."""
    piece = pieces(faces, num_vertices)
    return np.bincount(piece)[piece]


def rim_pixels(depth: FloatArray, mesh: TriangleMesh, width: int) -> BoolArray:
    """Pixels (H, W) of a surface's border, and the next ones up to a width of so many."""
    from scipy import ndimage

    has = np.isfinite(depth)
    border = np.zeros(depth.shape, dtype=bool)
    has_face = np.zeros(len(mesh.vertices), dtype=bool)
    has_face[mesh.faces.ravel()] = True
    border[has] = border_vertices(mesh.faces, len(mesh.vertices)) | ~has_face
    if width > 1:
        border = ndimage.binary_dilation(border, np.ones((3, 3), dtype=bool), iterations=width - 1)
    return border & has


def normals_image(depth: FloatArray, mesh: TriangleMesh) -> FloatArray:
    """The normals of a depth image's mesh as an image (H, W, 3), NaN off the surface."""
    image = np.full((*depth.shape, 3), np.nan)
    image[np.isfinite(depth)] = mesh.normals
    return image


def incidence_cosines(camera: Camera, depth: FloatArray, normals: FloatArray) -> FloatArray:
    """Cosines (H, W) of incidence: between normals and the way back to the sensor; NaN off it."""
    rays = camera.view_directions(camera.unproject_image(depth))
    return -np.einsum("hwk,hwk->hw", rays, normals)


def _in_view(scan: RangeScan, camera: Camera) -> BoolArray:
    """Working pixels (H, W) that lie in the scan's own field of view; all, where it is unknown."""
    if scan.camera is None:
        return np.ones((camera.height, camera.width), dtype=bool)
    u, v = _own_pixels(scan.camera, camera)
    # Up to the outermost pixels' centres, as the surface: no gap opens between it and the border.
    inside_u = (u >= -1e-6) & (u <= scan.camera.width - 1 + 1e-6)
    return inside_u & (v >= -1e-6) & (v <= scan.camera.height - 1 + 1e-6)


def _blind(scan: RangeScan, camera: Camera) -> BoolArray:
    """Working pixels (H, W) in which what lies behind was not seen, where most of it was.

    Else it is out of the sensor's reach, and pixels are empty because they look at it.
    """
    none = np.zeros((camera.height, camera.width), dtype=bool)
    if scan.seen_beyond is None or scan.camera is None or scan.grid is None:
        return none
    if (scan.grid < 0).sum() > 2 * scan.seen_beyond.sum():
        return none
    u, v = _own_pixels(scan.camera, camera)
    column = np.clip(np.rint(u), 0, scan.camera.width - 1).astype(np.int64)
    row = np.clip(np.rint(v), 0, scan.camera.height - 1).astype(np.int64)
    return ~scan.seen_beyond[row, column]


def _own_pixels(own: Camera, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Where the pixels (H, W) of a working camera lie in the scan's own image: columns and rows."""
    pixels, _ = own.project(camera.unproject_image(np.ones((camera.height, camera.width))))
    return pixels[..., 0], pixels[..., 1]
