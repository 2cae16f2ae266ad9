"""Point spacing of a scan."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.sampling import NUM_FEW

_ASKED = 4
"""Points nearest to each, itself among them: where all of them coincide, it has no neighbour."""
_DIRECTION = np.array([0.48, 0.64, 0.6])
"""Points are sorted along it: planes of points lie across an axis, hardly ever across this."""


def point_spacing(points: FloatArray) -> float:
    """The median distance from a point of (N, 3) to its nearest distinct one, in their unit.

    Exact duplicates do not count as neighbours. Zero if all points coincide.
    """
    queries = np.arange(0, len(points), max(1, len(points) // NUM_FEW))
    nearest = _nearest_distinct(points, queries)
    nearest = nearest[np.isfinite(nearest)]
    return float(np.median(nearest)) if len(nearest) else 0.0


def _nearest_distinct(points: FloatArray, queries: IntArray) -> FloatArray:
    """Distances from some of points (N, 3) to the nearest other place of a point; else infinite.

    SciPy's tree would do, but takes a tenth of a second to import.
    """
    along = (points - points.mean(axis=0)) @ _DIRECTION
    order = np.argsort(along)
    return _nearest_on_line(points[order], along[order], np.argsort(order)[queries])


@njit(cache=True, nogil=True)
def _nearest_on_line(
    points: FloatArray, along: FloatArray, at: IntArray
) -> FloatArray:  # pragma: no cover - compiled
    """The same of points that are sorted along a line, where none is farther away than in space."""
    nearest = np.full(len(at), np.inf)
    for n in range(len(at)):
        here, best, num_same = at[n], np.inf, 1
        for side in (-1, 1):
            k = here + side
            while 0 <= k < len(points) and num_same < _ASKED:
                # A little more than the distance on the line is due to rounding.
                if 0.999 * abs(along[k] - along[here]) > best:
                    break
                away = 0.0
                for axis in range(3):
                    away += (points[k, axis] - points[here, axis]) ** 2
                away = np.sqrt(away)
                if away == 0.0:
                    num_same += 1
                elif away < best:
                    best = away
                k += side
        nearest[n] = best if num_same < _ASKED else np.inf
    return nearest
