"""The line of sight of a scan without a grid, from its points alone.

What one sensor saw is a height field along its line of sight: no two layers of it fall into one
cell of a raster square to that line. Of all such lines the one is taken from which the surface is
least steep on average, by a mean over all that are nearly as good as the best.
"""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.sampling import NUM_SAMPLED
from scanweld.geometry.scan import RangeScan
from scanweld.preparation.resolution import point_spacing


@dataclass(frozen=True, kw_only=True, slots=True)
class _Cost:
    """How unlike a height field points are along a direction.

    Attributes:
        cell_spacings: Cell of the raster, in spacings of the points.
        layered_cells: Standard deviation of depth within a cell, in cells, above which it holds
            several layers.
        max_deviation: Most that a cell's deviation of depth counts, in cells.
        steepness_weight: Of the mean deviation of depth, a measure of steepness, beside the share
            of layered cells.
        nearly: Excess of the cost over the least at which a direction's weight has fallen to 1/e.
    """

    cell_spacings: float = 1.5
    layered_cells: float = 1.5
    max_deviation: float = 4.0
    steepness_weight: float = 0.1
    nearly: float = 0.005


@dataclass(frozen=True, kw_only=True, slots=True)
class _Search:
    """How the line of sight is searched for, coarse to fine.

    Attributes:
        first_points: Of a scan, in the first steps, at most; the last uses more.
        num_coarse: Directions on the half sphere that are tried first, about 8 deg apart.
        num_fine: Directions of which those near the best ones are tried, about 3 deg apart.
        num_starts: Distinct coarse directions around which fine ones are tried.
        start_deg: Angle within which they are, around each.
        cap_deg: Angle within which they are averaged around the best of all.
    """

    first_points: int = 6_000
    num_coarse: int = 300
    num_fine: int = 2_000
    num_starts: int = 6
    start_deg: float = 10.0
    cap_deg: float = 25.0


_COST, _SEARCH = _Cost(), _Search()


def line_of_sight_of_points(points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """The line along which points (N, 3) look most like a height field.

    Returns:
        The unit axis (3,), whose sign means nothing; a unit vector (3,) square to it; and the share
        of the points that lie in cells of several layers: near 0 for a scan from one viewpoint.
        Both vectors turn with the points.
    """
    frame = _principal_frame(points)
    centred = (points - points.mean(axis=0)) @ frame.T
    first = _thinned(centred, _SEARCH.first_points)
    cell = _COST.cell_spacings * point_spacing(first)
    coarse, fine = _half_sphere(_SEARCH.num_coarse), _half_sphere(_SEARCH.num_fine)
    starts = _starts(coarse, _costs(first, coarse, cell))
    candidates = np.concatenate([_cap(fine, start, _SEARCH.start_deg) for start in starts])
    best = candidates[int(np.argmin(_costs(first, candidates, cell)))]

    dense = _thinned(centred, NUM_SAMPLED)
    cell = _COST.cell_spacings * point_spacing(dense)
    cap = _cap(fine, best, _SEARCH.cap_deg)
    costs = _costs(dense, cap, cell)
    axis = np.exp((costs.min() - costs) / _COST.nearly) @ cap
    axis /= np.linalg.norm(axis)
    layered, _ = _depth_within_cells(dense, axis, cell)
    right = _square_to(axis)
    return axis @ frame, right @ frame, layered


def surface_points(scan: RangeScan) -> FloatArray:
    """At most 20,000 points of a scan; of a mesh, spread evenly over its faces."""
    if scan.faces is None or not len(scan.faces):
        return _thinned(scan.points, NUM_SAMPLED)
    areas = np.linalg.norm(face_normals(scan.points, scan.faces), axis=1)
    if not areas.sum() > 0:
        return _thinned(scan.points, NUM_SAMPLED)
    rng = np.random.default_rng(0)
    steps = (np.arange(NUM_SAMPLED) + 0.5) / NUM_SAMPLED
    chosen = np.searchsorted(np.cumsum(areas) / areas.sum(), steps)
    u, v = rng.random((2, NUM_SAMPLED, 1))
    a, b, c = (scan.points[scan.faces[chosen, k]] for k in range(3))
    return a + (1 - np.sqrt(u)) * (b - a) + np.sqrt(u) * v * (c - a)


def _thinned(points: FloatArray, max_points: int) -> FloatArray:
    """At most so many of the points (N, 3), drawn evenly, always the same."""
    if len(points) <= max_points:
        return points
    chosen = np.random.default_rng(0).choice(len(points), max_points, replace=False)
    return points[np.sort(chosen)]


def depth_image(points: FloatArray, axis: FloatArray, right: FloatArray, cell: float) -> FloatArray:
    """Mean coordinate (H, W) along the axis (3,) of points (N, 3); NaN where there are none."""
    cells, shape, depth = _raster(points, np.stack([right, np.cross(axis, right), axis]), cell)
    count = np.bincount(cells, minlength=shape[0] * shape[1])
    total = np.bincount(cells, weights=depth, minlength=shape[0] * shape[1])
    image = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return image.reshape(shape)


def _principal_frame(points: FloatArray) -> FloatArray:
    """A rotation (3, 3) to the points' principal axes; turns with the points."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    lean = ((centred @ axes[:, 1:]) ** 3).sum(axis=0)
    long, middle = axes[:, 2] * _sign(lean[1]), axes[:, 1] * _sign(lean[0])
    return np.stack([long, middle, np.cross(long, middle)])


def _half_sphere(count: int) -> FloatArray:
    """Unit directions (count, 3) with z > 0, evenly spread on a spiral of golden angles."""
    k = np.arange(count) + 0.5
    z, turn = k / count, k * np.pi * (1 + np.sqrt(5))
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def _cap(axes: FloatArray, centre: FloatArray, degrees: float) -> FloatArray:
    """Those of the axes within an angle of the centre (3,), turned to its side."""
    cosine = axes @ centre
    near = np.abs(cosine) >= np.cos(np.radians(degrees))
    return axes[near] * np.sign(cosine[near])[:, None]


def _starts(axes: FloatArray, costs: FloatArray) -> list[FloatArray]:
    """The best few axes that are farther from each other than the caps around them reach."""
    starts: list[FloatArray] = []
    for axis in axes[np.argsort(costs, kind="stable")]:
        if all(abs(axis @ other) < np.cos(np.radians(1.5 * _SEARCH.start_deg)) for other in starts):
            starts.append(axis)
        if len(starts) == _SEARCH.num_starts:
            break
    return starts


def _costs(points: FloatArray, axes: FloatArray, cell: float) -> FloatArray:
    """How unlike a gentle height field the points are along each axis."""
    found = np.array([_depth_within_cells(points, axis, cell) for axis in axes])
    return found @ (1.0, _COST.steepness_weight)


def _depth_within_cells(points: FloatArray, axis: FloatArray, cell: float) -> tuple[float, float]:
    """Share of the points in layered cells, and the mean deviation of depth in cells."""
    right = _square_to(axis)
    cells, _, depth = _raster(points, np.stack([right, np.cross(axis, right), axis]), cell)
    count = np.bincount(cells)
    filled = np.maximum(count, 1)
    mean = np.bincount(cells, weights=depth) / filled
    variance = np.bincount(cells, weights=depth * depth) / filled - mean * mean
    deviation = np.sqrt(np.maximum(variance, 0)) / cell
    layered = float(count[deviation > _COST.layered_cells].sum()) / len(points)
    return layered, float(count @ np.minimum(deviation, _COST.max_deviation)) / len(points)


def _raster(
    points: FloatArray, frame: FloatArray, cell: float
) -> tuple[IntArray, tuple[int, int], FloatArray]:
    """Cell numbers (N,), the raster's shape and depths (N,) along the last row of frame (3, 3)."""
    right, down, depth = frame @ points.T
    columns = ((right - right.min()) / cell).astype(np.int64)
    rows = ((down - down.min()) / cell).astype(np.int64)
    shape = (int(rows.max()) + 1, int(columns.max()) + 1)
    return rows * shape[1] + columns, shape, depth


def _square_to(axis: FloatArray) -> FloatArray:
    other = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    return other / np.linalg.norm(other)


def _sign(value: float) -> float:
    return -1.0 if value < 0 else 1.0
