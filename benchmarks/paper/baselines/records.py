"""What every method of the study takes and gives back, and the clouds that libraries are given."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanPair:
    """Two scans, j to be moved onto i, and the diameter of them or of their object."""

    i: PreparedScan
    j: PreparedScan
    diameter: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Answer:
    """What a method says of a pair."""

    i_from_j: Pose | None  # Between the sensor frames; None where the method finds none
    # The method's own confidence, finite and at least 0 but for the default's, higher is better; 0
    # where there is no pose.
    score: float
    reason: str = ""  # Why there is no pose, or what else the method says
    accepted: bool | None = None  # Whether it vouches for the pose; None if it does not judge it

    def __post_init__(self) -> None:
        if not np.isfinite(self.score):
            raise ValueError("a score is a finite number")


Method = Callable[[ScanPair, Pose, int], Answer]
"""A pair, the pose i_from_j to start at, a seed; the answer is the same for the same three."""


def closeness(distance: float, diameter: float) -> float:
    """A score of methods that minimise a distance: 1 at none, a half at 1 % of the diameter."""
    return 1.0 / (1.0 + 100.0 * distance / diameter)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CloudPair:
    """Points (N, 3) of both scans about their middles (3,), in diameters, axes of the sensors.

    Libraries have their settings in metres, for streets and rooms, and step about the origin of
    what they are given. With the objects in the middle and one unit long the settings are shares
    of the diameter, and no method pays for where the sensor stood.
    """

    points: tuple[FloatArray, FloatArray]
    middles: tuple[FloatArray, FloatArray]
    diameter: float

    def matrix_of(self, i_from_j: Pose) -> FloatArray:
        """A pose between the sensors as a (4, 4) matrix between the clouds."""
        middle_i, middle_j = self.middles
        shift = (i_from_j.apply(middle_j) - middle_i) / self.diameter
        return Pose(rotation=i_from_j.rotation, translation=shift).matrix()

    def pose_of(self, matrix: FloatArray) -> Pose:
        """A (4, 4) matrix between the clouds as a pose between the sensors."""
        middle_i, middle_j = self.middles
        unit = Pose.from_matrix(matrix)
        shift = self.diameter * unit.translation + middle_i - unit.turn(middle_j)
        return Pose(rotation=unit.rotation, translation=shift)


def cloud_pair(pair: ScanPair) -> CloudPair:
    """The clouds of a pair: all pixels of the range images that the project's own methods use."""
    vertices = [scan.mesh.vertices for scan in (pair.i, pair.j)]
    middle_i, middle_j = (points.mean(axis=0) for points in vertices)
    i, j = (
        np.ascontiguousarray((points - middle) / pair.diameter)
        for points, middle in zip(vertices, (middle_i, middle_j), strict=True)
    )
    return CloudPair(points=(i, j), middles=(middle_i, middle_j), diameter=pair.diameter)
