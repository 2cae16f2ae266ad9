"""Scans with more points than memory has room for, thinned evenly and always in the same way."""

from dataclasses import replace

import numpy as np

from scanweld.geometry.arrays import FloatArray, IndexArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.scan import RangeScan

CELLS_PER_POINT = 8
"""Cells of a range grid for each of its points, at most: empty cells take memory as well."""
SLACK = 1.02
"""Factor by which the cubes grow, at least, until few enough are left."""


def thinned(scan: RangeScan, max_points: int) -> RangeScan:
    """The scan with so many points at most, and a note that says so; itself if it is small.

    Of a range grid every k-th row and column stays, with the camera that sees these. Other points
    are sorted into cubes, of which the point nearest to the middle stays; a mesh's faces go to the
    points that stay for their corners. The cubes follow the principal axes, so that moving a scan
    changes nothing.
    """
    cells = 0 if scan.grid is None else scan.grid.size
    if len(scan.points) <= max_points and cells <= CELLS_PER_POINT * max_points:
        return scan
    grid = None if scan.grid is None or not (scan.grid >= 0).any() else scan.grid
    smaller, how = _in_cubes(scan, max_points) if grid is None else _strided(scan, grid, max_points)
    note = f"thinned from {len(scan.points)} to {len(smaller.points)} points to save memory, {how}"
    return replace(smaller, notes=(*scan.notes, note))


def _strided(scan: RangeScan, grid: IndexArray, max_points: int) -> tuple[RangeScan, str]:
    """Every k-th row and column of the grid, k as small as it can be."""
    too_many = max((grid >= 0).sum(), grid.size / CELLS_PER_POINT) / max_points
    step = max(2, int(np.ceil(np.sqrt(too_many))))
    while (count := int((grid[::step, ::step] >= 0).sum())) > max_points:
        step += 1
    if count == 0:
        return _in_cubes(replace(scan, grid=None, seen_beyond=None, camera=None), max_points)
    coarse = np.ascontiguousarray(grid[::step, ::step])
    kept = np.zeros(len(scan.points), dtype=bool)
    kept[coarse[coarse >= 0]] = True
    beyond = None if scan.seen_beyond is None else scan.seen_beyond[::step, ::step]
    camera = _strided_camera(scan.camera, step)
    smaller = replace(scan, grid=coarse, seen_beyond=beyond, faces=None, camera=camera)
    return smaller.only(kept), f"one row and column in {step}"


def _strided_camera(camera: Camera | None, step: int) -> Camera | None:
    """The camera whose pixels are every step-th of another's."""
    if camera is None:
        return None
    return replace(
        camera,
        width=-(-camera.width // step),
        height=-(-camera.height // step),
        fx=camera.fx / step,
        fy=camera.fy / step,
        cx=camera.cx / step,
        cy=camera.cy / step,
    )


def _in_cubes(scan: RangeScan, max_points: int) -> tuple[RangeScan, str]:
    """One point of each cube of space, with cubes just large enough."""
    centred = scan.points - scan.points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    along = centred @ axes
    low, high = np.percentile(along, [0.1, 99.9], axis=0)  # strays do not count
    rounding = float(np.spacing(np.abs(scan.points).max()))
    edge = max(float((high - low).max()) / (4 * np.sqrt(max_points)), rounding)
    while True:
        cube_of = _cubes(along, edge)
        count = int(cube_of.max()) + 1
        if count <= max_points:
            break
        edge *= max(SLACK, np.sqrt(count / max_points))
    chosen = _central(along, edge, cube_of)
    kept = np.zeros(len(along), dtype=bool)
    kept[chosen] = True
    smaller = replace(scan, faces=None, grid=None, seen_beyond=None).only(kept)
    if scan.faces is not None:
        number = np.cumsum(kept) - 1
        faces = number[chosen[cube_of]][scan.faces]
        a, b, c = faces.T
        smaller = replace(smaller, faces=faces[(a != b) & (b != c) & (c != a)])
    return smaller, "one in each cube of space"


def _cubes(along: FloatArray, edge: float) -> IntArray:
    """Number (N,) of the cube that each point lies in; cubes are numbered from 0 without gaps."""
    cell = np.rint(along / edge)
    order = np.lexsort(cell.T)
    is_next = (cell[order[1:]] != cell[order[:-1]]).any(axis=1)
    cube_of = np.empty(len(cell), dtype=np.int64)
    cube_of[order] = np.append(0, np.cumsum(is_next))
    return cube_of


def _central(along: FloatArray, edge: float, cube_of: IntArray) -> IntArray:
    """Index (C,) of the point of each cube that is nearest to its middle."""
    off = along / edge
    off -= np.rint(off)
    order = np.lexsort(((off**2).sum(axis=1), cube_of))
    _, first = np.unique(cube_of[order], return_index=True)
    return order[first]
