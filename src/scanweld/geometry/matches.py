"""Matches of two scans, each with the one direction along which it constrains their pose."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray, frozen

MIN_AGREEMENT = 0.8
"""Cosine of the angle between the normals of two matched points below which they do not match."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Matches:
    """Points of scan i matched to scan j, in the sensor frame of j at the pose they were found.

    A match constrains its point along one direction, which belongs to j: a surface normal of j in a
    point-to-plane match, the normal of a contour in j's image in a contour match. Moving the point
    by minus the residual along it removes the error.

    Attributes:
        points: (N, 3) points of i.
        directions: (N, 3) unit directions of j.
        residuals: (N,) signed distances along the direction from the matched point of j.
    """

    points: FloatArray
    directions: FloatArray
    residuals: FloatArray

    def __post_init__(self) -> None:
        n = len(self.residuals)
        object.__setattr__(self, "points", frozen(self.points, np.float64, (n, 3)))
        object.__setattr__(self, "directions", frozen(self.directions, np.float64, (n, 3)))
        object.__setattr__(self, "residuals", frozen(self.residuals, np.float64, (n,)))

    def __len__(self) -> int:
        return len(self.residuals)
