"""From where the model is shown: as the reference scan's sensor saw it."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Orientation:
    """Unit directions in the model's frame.

    Attributes:
        front: From the object to the viewer.
        up: Up in the picture, perpendicular to it.
    """

    front: FloatArray
    up: FloatArray

    def turned(self, degrees: float) -> FloatArray:
        """The direction to a viewer who has walked around the object."""
        angle = np.radians(degrees)
        side = np.cross(self.up, self.front)
        return np.cos(angle) * self.front + np.sin(angle) * side

    def basis(self) -> list[list[float]]:
        """Rows right, up, front: the viewer's axes."""
        right = np.cross(self.up, self.front)
        return np.stack([right, self.up, self.front]).tolist()


def as_seen_from(world_from_sensor: Pose | None) -> Orientation:
    """The view of a sensor; without one, z up and seen from the front (-y)."""
    if world_from_sensor is None:
        return Orientation(front=np.array([0.0, -1.0, 0.0]), up=np.array([0.0, 0.0, 1.0]))
    rotation = world_from_sensor.rotation  # columns: right, down, away
    return Orientation(front=-rotation[:, 2], up=-rotation[:, 1])
