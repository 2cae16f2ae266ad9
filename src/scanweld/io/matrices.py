"""Poses as numbers in files."""

from collections.abc import Sequence

import numpy as np

from scanweld.geometry.pose import Pose


def pose_from_numbers(numbers: Sequence[float]) -> Pose:
    """The pose of the 16 numbers of a 4x4 matrix, row after row.

    A rotation that is orthonormal to rounding is taken as it stands, so that what was written is
    read back to the last bit; one with fewer digits is made orthonormal.

    Raises:
        ValueError: If they are not a rigid motion.
    """
    if len(numbers) != 16:
        raise ValueError(f"{len(numbers)} numbers instead of 16")
    matrix = np.array(numbers, dtype=np.float64).reshape(4, 4)
    pose = Pose.from_matrix(matrix)
    rotation = matrix[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-14:
        return pose
    return Pose(rotation=rotation, translation=matrix[:3, 3])
