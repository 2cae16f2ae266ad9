"""Points that are none: what stands for pixels that saw nothing, and the grid that it fills."""

import numpy as np

from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.sampling import NUM_FEW

_MANY = 10
"""So many points at the very same place, or with the very same coordinate far beyond all others,
were not measured."""
_SHARE = 0.01
"""Of all points, that copies elsewhere than at the origin must have: coarse files have a few."""
_BEYOND = 10.0
"""Factor by which a value that stands for nothing is larger than all that were measured."""
_CLEAR = 0.7
"""The step to the next row of a grid, at most, as a share of that with any other number of columns:
it is twice as long to the row after, and longer still where rows are cut at the wrong place."""


def seen_points(
    points: FloatArray, faces: IntArray | None = None
) -> tuple[BoolArray, tuple[str, ...]]:
    """Which points (N,) were seen, and notes on the others, which stand for pixels without return.

    Those are not finite, or many copies of one point, most often (0, 0, 0), or many that have one
    coordinate in common which is far beyond those of all others, such as 65535 or 1e9. Of the
    latter two, corners of faces stay.
    """
    is_seen = np.asarray(np.isfinite(points).all(axis=1))
    notes = _told(~is_seen, "that are not finite")
    is_corner = np.zeros(len(points), dtype=bool)
    if faces is not None:
        is_corner[faces.reshape(-1)] = True
    for place, least in ((np.zeros(3), _MANY), (_usual_place(points), _SHARE * len(points))):
        copies = is_seen & ~is_corner
        for k in range(3):
            copies &= points[:, k] == place[k]
        if copies.sum() >= max(least, _MANY):
            at = ", ".join(f"{value:g}" for value in place + 0.0)
            notes += _told(copies, f"that are all ({at})")
            is_seen &= ~copies
    for k, axis in enumerate("xyz"):
        beyond, value = _beyond(points, k, is_seen)
        beyond &= ~is_corner
        if beyond.sum() >= _MANY:
            notes += _told(beyond, f"with {axis} = {value:g}")
            is_seen &= ~beyond
    return is_seen, notes


def grid_in_order(points: FloatArray, is_seen: BoolArray) -> IntArray | None:
    """The grid (rows, columns) in which the points stand, row after row; None unless certain.

    Args:
        points: (N, 3), those that stand for nothing as well.
        is_seen: (N,) which were measured.

    Returns:
        Indices of all points. Neighbours in the next row are near to each other, nearer than
        those on the diagonals, and with no other number of columns nearly so near.
    """
    n = len(points)
    widths = [width for width in range(2, n // 2 + 1) if n % width == 0]
    steps = {lag: _median_step(points, is_seen, lag) for lag in (1, *widths)}
    if not widths:
        return None
    best = min(widths, key=lambda width: steps[width])
    rivals = [steps.get(lag, _median_step(points, is_seen, lag)) for lag in (best // 2, 2 * best)]
    rivals += [steps[width] for width in widths if width != best]
    diagonals = min(_median_step(points, is_seen, best + shift) for shift in (-1, 1))
    is_clear = steps[best] < min(diagonals, _CLEAR * min(rivals))
    if not (is_clear and steps[best] < _BEYOND * steps[1] < np.inf):
        return None
    return np.arange(n, dtype=np.int64).reshape(-1, best)


def _usual_place(points: FloatArray) -> FloatArray:
    """The place (3,) of most of a sample of points."""
    sample = points[:: max(1, len(points) // NUM_FEW)]
    sample = sample[np.isfinite(sample).all(axis=1)]
    if not len(sample):
        return np.zeros(3)
    places, counts = np.unique(sample, axis=0, return_counts=True)
    return places[np.argmax(counts)]


def _told(dropped: BoolArray, which: str) -> tuple[str, ...]:
    count = int(dropped.sum())
    return (f"{count} points {which} dropped: nothing was seen there",) if count else ()


def _beyond(points: FloatArray, axis: int, is_seen: BoolArray) -> tuple[BoolArray, float]:
    """Which points (N,) have the largest coordinate, and that, if there are others far below it."""
    size = np.where(is_seen, np.abs(points[:, axis]), 0.0)
    top = float(size.max(initial=0.0))
    is_top = is_seen & (size == top)
    others = np.abs(points[is_seen & ~is_top])
    if is_top.sum() < _MANY or not len(others) or not top > _BEYOND * others.max():
        return np.zeros(len(points), dtype=bool), top
    return is_top, float(points[np.argmax(is_top), axis])


def _median_step(points: FloatArray, is_seen: BoolArray, lag: int) -> float:
    """Median distance of points so many apart in their order; infinite if there are few."""
    both = np.flatnonzero(is_seen[lag:] & is_seen[:-lag])
    if len(both) < _MANY:
        return np.inf
    both = both[:: max(1, len(both) // NUM_FEW)]
    return float(np.median(np.linalg.norm(points[both + lag] - points[both], axis=1)))
