"""The best poses of a pair refined once more, by all their points and contours."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from scanweld.config import RefineConfig
from scanweld.contours.coherence import ContourMatcher
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import Alternative
from scanweld.refinement.refine import refined_poses

NUM_POLISHED = 2
"""Alternatives that are refined with all points and contours, at most."""
MIN_POLISHED_SCORE = -0.1
"""Score below which an alternative is not worth it."""
MAX_POLISHING_LOSS = 0.04
"""Score that a refinement may cost: the search has looked for samples that agree by chance."""
MAX_POLISHES = 3
"""Refinements of a pair's pose, one after the other: where overlap is thin, one does not arrive."""
CONVERGED_DEG, CONVERGED_DIAMETERS = 0.5, 0.005
"""A refinement that turns and shifts a pose by less has arrived."""


class Polish(Protocol):
    """A refinement of the pose of the two scans at hand."""

    def refine(self, i_from_j: Pose) -> Pose:
        """The refined pose between the sensor frames."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class JointPolish:
    """The joint refinement of two of a run's scans.

    Attributes:
        scans: All scans of the run.
        edge: Indices (i, j) of the two.
        centre_j: (3,) middle of j's samples, its sensor frame.
        diameter: Diameter of the object, in the scans' unit.
        contours: Finds contour matches between scans.
        config: Settings of the refinement.
    """

    scans: Sequence[PreparedScan]
    edge: tuple[int, int]
    centre_j: FloatArray
    diameter: float
    contours: ContourMatcher
    config: RefineConfig

    def refine(self, i_from_j: Pose) -> Pose:
        """The pose between the sensor frames, refined until it arrives or a few times."""
        i, j = self.edge
        for _ in range(MAX_POLISHES):
            start = {i: Pose.identity(), j: i_from_j}
            refined = refined_poses(self.scans, start, [self.edge], self.config, self.contours)
            i_from_j = refined[j]
            moved = start[j].inverse() @ i_from_j
            shift = moved.shift_at(self.centre_j) / self.diameter
            if moved.angle_deg() < CONVERGED_DEG and shift < CONVERGED_DIAMETERS:
                break
        return i_from_j


def polished(
    problem: PairProblem, alternatives: Sequence[Alternative], polish: Polish
) -> list[Alternative]:
    """The alternatives, the best of them refined once more where the evidence bears it out."""
    refined = list(alternatives)
    for k, alternative in enumerate(alternatives[:NUM_POLISHED]):
        if alternative.score > MIN_POLISHED_SCORE:
            option = problem.evaluate(polish.refine(alternative.i_from_j))
            if option.score > alternative.score - MAX_POLISHING_LOSS:
                refined[k] = option
    return refined
