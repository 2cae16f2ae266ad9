"""Poses of a pair with their evidence, as they are or after ICP."""

from collections.abc import Sequence

from scanweld.evidence.field import ScanField
from scanweld.evidence.icp import IcpSchedule, icp
from scanweld.evidence.visibility import judge, mean_evidence, pose_rows
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.pairs.result import Alternative

NUM_COARSE_SAMPLES = 200
"""Samples of a scan that take part while many poses are looked at roughly,"""
NUM_FINE_SAMPLES = 400
"""and while those that are left are looked at closely."""


def schedules(diameter: float) -> tuple[IcpSchedule, IcpSchedule]:
    """Of many poses roughly, and of those that are left closely."""
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


def alternative_at(i: ScanField, j: ScanField, i_from_j: Pose, tolerance: float) -> Alternative:
    """A pose with its full evidence."""
    evidence = mean_evidence(*judge(i, j, i_from_j, tolerance))
    return Alternative(i_from_j=i_from_j, evidence=evidence)


def to_pose(row: FloatArray) -> Pose:
    """The pose of a kernel's row (12,)."""
    return Pose(rotation=nearest_rotation(row[:9].reshape(3, 3)), translation=row[9:])


def refined_at(
    i: ScanField,
    j: ScanField,
    poses: Sequence[Pose],
    schedule: IcpSchedule,
    tolerance: float,
    diameter: float,
) -> list[Alternative]:
    """Poses i_from_j after ICP, each with its full evidence, in the order given."""
    rows = icp(i, j, pose_rows(list(poses)), schedule, diameter)
    return [alternative_at(i, j, to_pose(row), tolerance) for row in rows]
