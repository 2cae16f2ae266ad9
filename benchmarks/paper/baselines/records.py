"""What every method of the study takes and gives back."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanPair:
    """Two scans to be registered.

    Attributes:
        i: The scan that stays,
        j: the one that is moved onto it.
        diameter: Of the scans or of their object, in the scans' unit.
    """

    i: PreparedScan
    j: PreparedScan
    diameter: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Answer:
    """What a method says of a pair.

    Attributes:
        i_from_j: The pose between the sensor frames; None where the method finds none.
        score: The method's own confidence, finite and at least 0 but for the default's, higher is
            better; 0 where there is no pose.
        reason: Why there is no pose, or what else the method says; empty where nothing.
        accepted: Whether the method vouches for the pose; None where it does not judge its own.
    """

    i_from_j: Pose | None
    score: float
    reason: str = ""
    accepted: bool | None = None

    def __post_init__(self) -> None:
        if not np.isfinite(self.score):
            raise ValueError("a score is a finite number")


def closeness(distance: float, diameter: float) -> float:
    """A score of methods that minimise a distance: 1 at none, a half at 1 % of the diameter."""
    return 1.0 / (1.0 + 100.0 * distance / diameter)


Method = Callable[[ScanPair, Pose, int], Answer]
"""A pair, the pose i_from_j to start at, a seed; the answer is the same for the same three."""
