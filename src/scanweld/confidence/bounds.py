"""Deviation of a scan's pose -> bounds of its errors that hold for 95 % of the scans.

The deviation that follows from information and noise is too small where a sensor errs alike over
whole scans: then surfaces lie farther apart, and poses are off by more than in proportion. So
errors go with powers of both, which the calibration counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose_tolerance import PoseTolerance


@dataclass(frozen=True, kw_only=True, slots=True)
class BoundScale:
    """A bound is ``factor * deviation ** of_deviation * sigma ** of_sigma``.

    All are angles in radians, or shares of the diameter.

    Attributes:
        factor: Of the whole.
        of_deviation: Power of the deviation.
        of_sigma: Power of the distance between surfaces that should coincide.
    """

    factor: float
    of_deviation: float
    of_sigma: float

    def bound(self, deviation: float, sigma: float) -> float:
        """The bound, likewise an angle or a share."""
        return self.factor * deviation**self.of_deviation * sigma**self.of_sigma


@dataclass(frozen=True, kw_only=True, slots=True)
class Bounds:
    """How bounds of rotations and of translations follow from deviations."""

    rotation: BoundScale
    translation: BoundScale

    def of(
        self, deviations: Mapping[int, PoseTolerance], sigma: float, diameter: float
    ) -> dict[int, PoseTolerance]:
        """Bounds at 95 % of the error of each pose, if it is the right one.

        Farther off than rivals are apart it would be another pose: no bound says more.

        Args:
            deviations: Standard deviations of the poses.
            sigma: Robust standard deviation of the distance between surfaces, in the scans' unit.
            diameter: Of the run, likewise.
        """
        turn = sigma / lever_arm(diameter)
        bounds = {}
        for k, one in deviations.items():
            angle = float(np.degrees(self.rotation.bound(one.angle, turn)))
            shift = self.translation.bound(one.shift / diameter, sigma / diameter)
            bounds[k] = PoseTolerance(
                angle_deg=min(angle, RIVAL_ANGLE_DEG),
                shift=min(shift, RIVAL_SHIFT_DIAMETERS) * diameter,
            )
        return bounds
