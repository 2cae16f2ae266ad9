"""When two poses count as the same."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose


@dataclass(frozen=True, kw_only=True, slots=True)
class PoseTolerance:
    """How far two poses of one body may differ and still be the same.

    Attributes:
        angle_deg: Angle between them, in degrees.
        shift: Distance between the two places of the body's middle, in the scans' unit.
    """

    angle_deg: float
    shift: float

    @property
    def angle(self) -> float:
        """The angle in radians."""
        return float(np.radians(self.angle_deg))

    def covers(self, p: Pose, q: Pose, middle: FloatArray) -> bool:
        """Whether two poses are the same; ``middle`` (3,) is the body's, in the frame they move."""
        apart = p.inverse() @ q
        return apart.shift_at(middle) < self.shift and apart.angle_deg() < self.angle_deg
