"""The clouds that libraries are given: both scans about their middles, in diameters."""

from dataclasses import dataclass

import numpy as np

from benchmarks.paper.baselines.records import ScanPair
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Cloud:
    """A scan's points about their middle, one diameter long.

    Attributes:
        points: (N, 3), axes of the sensor frame.
        sensor: (3,) where the sensor stands.
    """

    points: FloatArray
    sensor: FloatArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CloudPair:
    """The clouds of a pair, and the way between their poses and those of the sensors.

    Libraries have their settings in metres, for streets and rooms, and step about the origin of
    what they are given. With the objects in the middle and one unit long the settings are shares
    of the diameter, and no method pays for where the sensor stood.
    """

    i: Cloud
    j: Cloud
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
    clouds, middles = [], []
    for scan in (pair.i, pair.j):
        points = scan.mesh.vertices
        middle = points.mean(axis=0)
        points, sensor = (points - middle) / pair.diameter, -middle / pair.diameter
        clouds.append(Cloud(points=np.ascontiguousarray(points), sensor=sensor))
        middles.append(middle)
    return CloudPair(
        i=clouds[0], j=clouds[1], middles=(middles[0], middles[1]), diameter=pair.diameter
    )
