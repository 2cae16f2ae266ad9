"""An axis of rotation in space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp, rotation_log


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Axis:
    """A line: a unit direction (3,) and a point (3,) on it."""

    direction: FloatArray
    point: FloatArray

    def angle_of(self, motion: Pose) -> float:
        """Angle, in radians, of the rotation about the line that is closest to a motion's."""
        r = motion.rotation
        skew = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
        along = float(self.direction @ r @ self.direction)
        return float(np.arctan2(float(self.direction @ skew), float(np.trace(r)) - along))

    def nearest_turn(self, motion: Pose) -> Pose:
        """The rotation about the line whose angle is closest to a motion's."""
        turn = rotation_exp(self.angle_of(motion) * self.direction)
        return Pose(rotation=turn, translation=self.point - turn @ self.point)


def fit_axis(motions: Sequence[Pose], middle: FloatArray) -> Axis:
    """The line that motions turn about best; its point is the one nearest to a given middle."""
    # As rotation vectors: small turns say little of the direction, and count little.
    turns = np.array([rotation_log(motion.rotation) for motion in motions])
    direction = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    direction = direction * (1.0 if direction[np.argmax(np.abs(direction))] > 0 else -1.0)
    # Points on the axis stay where they are: (I - R) c = t, solved about the middle.
    across = np.eye(3) - np.outer(direction, direction)
    rows = np.concatenate([*(np.eye(3) - motion.rotation for motion in motions)]) @ across
    moved = np.concatenate([motion.apply(middle) - middle for motion in motions])
    offset = np.linalg.lstsq(rows, moved, rcond=1e-9)[0]
    return Axis(direction=direction, point=middle + across @ offset)
