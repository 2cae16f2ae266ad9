"""Coordinates stored in steps so large that they no longer hold the surface.

The limit is a resolution. N points spread over a scan of diameter D lie at least D / sqrt(N) apart
on average, unless they fall on each other. Where single precision has steps larger than that at
the coordinates of a scan (0.5 at 5,400,000), the steps drown what the points are to tell. Steps of
decimals, the same along all axes, are told from a regular lattice by their points: there are so
many that several fall on one and the same place.
"""

from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.sampling import NUM_SAMPLED
from scanweld.geometry.scan import principal_diameter

_FEWEST = 100
"""Points that tell steps from chance; fewer are no scan, which preparing them says."""
_NEAR_SINGLE = 0.05
"""Share of a step by which printed decimals may miss a number of single precision."""
_COPIES = 4.0
"""Steps of decimals are too large at so many times D / sqrt(N): a lattice as coarse has at most
some 5 D^2 / step^2 cells on a closed surface, and more than three points fall on each."""


def refuse_coarse(path: Path, points: FloatArray, *, are_vertices: bool = False) -> None:
    """Refuse finite points (N, 3) whose coordinates are stored in too large steps.

    Args:
        path: Of the file, for the message.
        points: What was read from it.
        are_vertices: Whether they are a mesh's, of which copies tell nothing.

    Raises:
        ReadError: If a step is larger than what N points over that size resolve.
    """
    if len(points) < _FEWEST or np.abs(points).max() > np.finfo(np.float32).max:
        return
    some = points[:: -(-len(points) // NUM_SAMPLED)]
    single = _single_step(some)
    decimal = 0.0 if are_vertices else _common_step(some) / _COPIES
    if max(single, decimal) == 0.0:
        return
    size = principal_diameter(some)
    if max(single, decimal) <= size / np.sqrt(len(points)):
        return
    step = max(single, _COPIES * decimal)
    raise ReadError(
        f"{path}: coordinates are stored too coarsely: steps of {step:.2g} beside a size of "
        f"{size:.2g}; export in double precision with all digits, or shifted to the origin"
    )


def _single_step(points: FloatArray) -> float:
    """The largest step of single precision at the points, along axes that are of such numbers."""
    single = points.astype(np.float32)
    spacing = np.abs(np.spacing(single)).astype(np.float64)
    of_such = (np.abs(points - single) <= _NEAR_SINGLE * spacing).all(axis=0)
    if not of_such.all():  # a plane across an axis is no proof
        of_such &= np.ptp(points, axis=0) > 0
    return float(np.median(spacing, axis=0)[of_such].max(initial=0.0))


def _common_step(points: FloatArray) -> float:
    """The smallest difference of coordinates along any axis."""
    steps = [np.diff(np.unique(axis)) for axis in points.T]
    return min(float(each.min()) if len(each) else 0.0 for each in steps)
