"""Poses as numbers in files."""

from collections.abc import Sequence

import numpy as np

from scanweld.geometry.arrays import FloatArray
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


def rotation_of_quaternion(xyzw: FloatArray) -> FloatArray:
    """The rotation (3, 3) of a quaternion (4,) x y z w of any length; none if it is zero."""
    length = float(np.linalg.norm(xyzw))
    x, y, z, w = xyzw / length if 0 < length < np.inf else (0.0, 0.0, 0.0, 1.0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def from_opengl(world_from_camera: Pose) -> Pose:
    """The pose of a camera with y up and z towards the viewer, with y down and z away."""
    return Pose(
        rotation=world_from_camera.rotation * [1.0, -1.0, -1.0],
        translation=world_from_camera.translation,
    )
