"""Deviations of poses -> bounds of their errors that hold for 95 % of the scans.

What deviations do not tell is counted: how many of them make a bound, and how much of the distance
between surfaces (that noise and bent depth leave) moves whole scans. Both come from the
calibration.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.gauss_newton import lever_arm
from scanweld.geometry.pose_tolerance import PoseTolerance

FULL_TURN_DEG = 180.0
"""Bound of a turn that nothing determines."""


@dataclass(frozen=True, kw_only=True, slots=True)
class BoundScale:
    """A bound is ``factor * hypot(deviation, share * sigma)``.

    Attributes:
        factor: Deviations that make a bound.
        share: Of the distance between surfaces that should coincide.
    """

    factor: float
    share: float

    def bound(self, deviation: float, sigma: float) -> float:
        """The bound, in the unit of both."""
        return self.factor * float(np.hypot(deviation, self.share * sigma))

    def deviation(self, bound: float, sigma: float) -> float:
        """The deviation that has a bound."""
        return float(np.sqrt(max((bound / self.factor) ** 2 - (self.share * sigma) ** 2, 0.0)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Bounds:
    """How bounds of rotations and of translations follow from deviations."""

    rotation: BoundScale
    translation: BoundScale

    def of(
        self, deviations: Mapping[int, PoseTolerance], sigma: float, diameter: float
    ) -> dict[int, PoseTolerance]:
        """Bounds at 95 % of the error of each pose.

        Args:
            deviations: Standard deviations of the poses.
            sigma: Robust standard deviation of the distance between surfaces, in the scans' unit.
            diameter: Of the run, likewise.
        """
        turn = float(np.degrees(sigma / lever_arm(diameter)))
        return {
            k: PoseTolerance(
                angle_deg=min(self.rotation.bound(one.angle_deg, turn), FULL_TURN_DEG),
                shift=min(self.translation.bound(one.shift, sigma), diameter),
            )
            for k, one in deviations.items()
        }
