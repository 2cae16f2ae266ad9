"""Two scans whose relative pose is asked for, and what can be asked of a pose of theirs."""

from collections.abc import Sequence
from dataclasses import dataclass

from scanweld.config import PairsConfig
from scanweld.evidence.field import ScanField
from scanweld.evidence.icp import IcpSchedule, icp
from scanweld.evidence.information import TwoWayMatches, two_way_matches
from scanweld.evidence.pixels import TwoWay, see
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.evidence.sample_patches import violating_patches, with_patches
from scanweld.evidence.visibility import mean_evidence, pose_rows, two_way_evidence
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.result import Alternative

NUM_COARSE_SAMPLES = 200
"""Samples of a scan that take part while many poses are looked at roughly,"""
NUM_FINE_SAMPLES = 400
"""and while those that are left are looked at closely."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairProblem:
    """Two scans, and the settings by which poses are judged.

    Nothing here depends on the rest of the set, so that a pair is worked on once whatever it is in.

    Attributes:
        edge: Indices (i, j) of the scans, i < j.
        i: The first scan, laid out.
        j: The second.
        config: Settings.
    """

    edge: tuple[int, int]
    i: ScanField
    j: ScanField
    config: PairsConfig

    @property
    def diameter(self) -> float:
        """Diameter of the object as these two scans show it, in their unit: the mean of theirs."""
        return 0.5 * (self.i.diameter + self.j.diameter)

    @property
    def tolerance(self) -> float:
        """Depth tolerance of the evidence on answers, in the scans' unit."""
        return self.config.fine_tolerance_diameters * self.diameter

    @property
    def rival_tolerance(self) -> PoseTolerance:
        """Poses that differ by less are the same answer, not rivals."""
        shift = RIVAL_SHIFT_DIAMETERS * self.diameter
        return PoseTolerance(angle_deg=RIVAL_ANGLE_DEG, shift=shift)

    def evaluate(self, i_from_j: Pose) -> Alternative:
        """A pose between the sensor frames with its evidence, by all samples."""
        evidence = mean_evidence(*two_way_evidence(self.i, self.j, i_from_j, self.tolerance))
        (patches,) = violating_patches(self.i, self.j, [i_from_j], self.tolerance)
        return Alternative(i_from_j=i_from_j, evidence=with_patches(evidence, patches))

    def refine(self, poses: Sequence[Pose]) -> list[Alternative]:
        """Poses i_from_j after a close ICP, each with its evidence, in the order given."""
        _, near = schedules(self.diameter)
        rows = icp(self.i, self.j, pose_rows(poses), near, self.diameter)
        return [self.evaluate(to_pose(row)) for row in rows]

    def is_same(self, a: Alternative, b: Alternative) -> bool:
        """Whether two poses are the same answer, not rivals."""
        return self.rival_tolerance.covers(a.i_from_j, b.i_from_j, self.j.centre)

    def distinct(self, poses: FloatArray, tolerance: PoseTolerance, max_count: int) -> IntArray:
        """Indices of pose rows (N, 12), best first, of which none is near one chosen before."""
        return distinct_poses(poses, self.j.centre, tolerance.angle, tolerance.shift, max_count)

    def pixels(self, i_from_j: Pose) -> TwoWay:
        """What the two sensors say of all pixels of each other's scan."""
        return see(self.i, self.j, i_from_j, self.diameter)

    def matches(self, i_from_j: Pose) -> TwoWayMatches:
        """Samples of each scan matched to the other within the tolerance, in the frame of i."""
        return two_way_matches(self.i, self.j, i_from_j, self.tolerance)


def schedules(diameter: float) -> tuple[IcpSchedule, IcpSchedule]:
    """ICP of many poses roughly, and of those that are left closely."""
    far = IcpSchedule(
        num_rounds=8,
        first_radius=0.08 * diameter,
        last_radius=0.03 * diameter,
        num_samples=NUM_COARSE_SAMPLES,
    )
    near = IcpSchedule(
        num_rounds=15,
        first_radius=0.05 * diameter,
        last_radius=0.01 * diameter,
        num_samples=NUM_FINE_SAMPLES,
    )
    return far, near


def to_pose(row: FloatArray) -> Pose:
    """The pose of a kernel's row (12,)."""
    return Pose(rotation=nearest_rotation(row[:9].reshape(3, 3)), translation=row[9:])
