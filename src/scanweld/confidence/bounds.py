"""Deviation of a scan's pose -> bounds of its errors that hold for 95 % of the scans.

The deviation that follows from information, noise and open cycles is too small where a sensor errs
alike in all scans: no number of them averages that out. So bounds have a floor in proportion to
what neighbours share of the error, and the calibration counts by how much.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.sensor.model import SensorModel


@dataclass(frozen=True, kw_only=True, slots=True)
class Bounds:
    """A bound is a factor times the root of ``deviation**2 + (floor * correlated)**2``.

    Attributes:
        rotation: The factor of rotations, which count by the lengths at the lever arm.
        translation: The factor of translations.
        floor: Error that all scans share, over the one that neighbours share.
    """

    rotation: float
    translation: float
    floor: float

    def of(
        self, deviations: Mapping[int, PoseTolerance], sensor: SensorModel
    ) -> dict[int, PoseTolerance]:
        """Bounds at 95 % of the error of each pose, if it is the right one.

        Farther off than rivals are apart it would be another pose: no bound says more.

        Args:
            deviations: Standard deviations of the poses.
            sensor: What is known of the sensor.
        """
        arm, floor = lever_arm(sensor.diameter), self.floor * sensor.correlated
        farthest = RIVAL_SHIFT_DIAMETERS * sensor.diameter
        bounds = {}
        for k, one in deviations.items():
            turn = self.rotation * np.hypot(one.angle * arm, floor) / arm
            bounds[k] = PoseTolerance(
                angle_deg=min(float(np.degrees(turn)), RIVAL_ANGLE_DEG),
                shift=min(self.translation * float(np.hypot(one.shift, floor)), farthest),
            )
        return bounds
