"""Unit quaternions in files, (x, y, z, w) of the usual (Hamilton) convention."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose

_MAX_NORM_ERROR = 0.01
"""A quaternion farther from length one is no rotation, but another column of the file."""


def quaternion(rotation: FloatArray) -> FloatArray:
    """(4,) x, y, z, w with w >= 0 of a rotation (3, 3) that turns column vectors."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(canonical=True))


def pose_from_quaternion(
    path: Path, where: str, xyzw: Sequence[float], translation: Sequence[float]
) -> Pose:
    """The pose that turns by a quaternion, then shifts.

    Raises:
        ReadError: If the quaternion is not of unit length to two digits, or not finite.
    """
    q = np.array(xyzw, dtype=np.float64)
    finite = np.isfinite(q).all() and np.isfinite(translation).all()
    if not finite or abs(float(np.linalg.norm(q)) - 1.0) > _MAX_NORM_ERROR:
        raise ReadError(
            f"{path}: {where}: not a pose (a finite shift and a unit quaternion); correct the file "
            "or write it anew"
        )
    turn = np.asarray(Rotation.from_quat(q).as_matrix())
    return Pose(rotation=turn, translation=np.array(translation, dtype=np.float64))
