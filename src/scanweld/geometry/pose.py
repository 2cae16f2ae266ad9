"""Rigid motions with frames in their names: ``b_from_c = b_from_a @ a_from_c``."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from scanweld.geometry.arrays import FloatArray, frozen


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pose:
    """A rigid motion x -> rotation @ x + translation.

    Attributes:
        rotation: (3, 3), orthonormal with determinant +1.
        translation: (3,), in the unit of the scans.

    Raises:
        ValueError: If it is not finite, or the matrix no rotation.
    """

    rotation: FloatArray
    translation: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen(self.rotation, np.float64, (3, 3)))
        object.__setattr__(self, "translation", frozen(self.translation, np.float64, (3,)))
        if not np.isfinite(self.translation).all():
            raise ValueError("a pose needs a finite translation")
        if not _is_rotation(self.rotation):
            raise ValueError("a pose needs a rotation: orthonormal, with determinant +1")

    @staticmethod
    def identity() -> "Pose":
        """The motion that moves nothing."""
        return Pose(rotation=np.eye(3), translation=np.zeros(3))

    @staticmethod
    def from_matrix(matrix: ArrayLike) -> "Pose":
        """The pose of a homogeneous (4, 4) matrix; its rotation is made orthonormal.

        Raises:
            ValueError: If the matrix is not a rigid motion to three digits.
        """
        m = np.asarray(matrix, dtype=np.float64)
        if m.shape != (4, 4) or not np.allclose(m[3], [0, 0, 0, 1]):
            raise ValueError("a rigid motion is a 4x4 matrix with last row 0 0 0 1")
        if not np.isfinite(m).all() or not np.allclose(
            m[:3, :3] @ m[:3, :3].T, np.eye(3), atol=1e-3
        ):
            raise ValueError("the 4x4 matrix is not a rigid motion")
        if np.linalg.det(m[:3, :3]) < 0:
            raise ValueError("the 4x4 matrix is not a rigid motion: it mirrors")
        return Pose(rotation=nearest_rotation(m[:3, :3]), translation=m[:3, 3])

    @staticmethod
    def exp(twist: ArrayLike) -> "Pose":
        """The motion of a twist (6,): rotation vector in radians, then the shift's generator."""
        xi = np.asarray(twist, dtype=np.float64)
        w, v = xi[:3], xi[3:]
        return Pose(rotation=rotation_exp(w), translation=_left_jacobian(w) @ v)

    def log(self) -> FloatArray:
        """The twist (6,) whose ``exp`` this is; rotation angle in [0, pi]."""
        w = rotation_log(self.rotation)
        generator = np.linalg.solve(_left_jacobian(w), self.translation).astype(np.float64)
        return np.concatenate([w, generator])

    def __matmul__(self, other: "Pose") -> "Pose":
        return _made_of_poses(
            _straightened(self.rotation @ other.rotation),
            self.rotation @ other.translation + self.translation,
        )

    def inverse(self) -> "Pose":
        """The motion back."""
        back = np.ascontiguousarray(self.rotation.T)
        return _made_of_poses(back, -self.rotation.T @ self.translation)

    def apply(self, points: FloatArray) -> FloatArray:
        """Move points (..., 3)."""
        return points @ self.rotation.T + self.translation

    def turn(self, directions: FloatArray) -> FloatArray:
        """Turn directions (..., 3), without the shift."""
        return directions @ self.rotation.T

    def matrix(self) -> FloatArray:
        """The homogeneous (4, 4) matrix."""
        m = np.eye(4)
        m[:3, :3] = self.rotation
        m[:3, 3] = self.translation
        return m

    def angle_deg(self) -> float:
        """Angle of the rotation in degrees, in [0, 180]."""
        return float(np.degrees(np.linalg.norm(rotation_log(self.rotation))))

    def shift_at(self, point: FloatArray) -> float:
        """How far the motion moves a point (3,)."""
        return float(np.linalg.norm(self.apply(point) - point))


def _made_of_poses(rotation: FloatArray, translation: FloatArray) -> Pose:
    """A pose of arrays of its own, not looked at again: to check them takes longer than a product.

    What is made of rotations is one; and poses are made by the hundred thousand.
    """
    pose = object.__new__(Pose)
    for name, values in (("rotation", rotation), ("translation", translation)):
        values.flags.writeable = False
        object.__setattr__(pose, name, values)
    return pose


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """The rotation closest to a (3, 3) matrix (Kabsch)."""
    u, _, vt = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def rotation_exp(vector: FloatArray) -> FloatArray:
    """The rotation matrix of a rotation vector (3,) in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    k = _cross(vector)
    if angle < 1e-6:
        return np.eye(3) + k + 0.5 * k @ k
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k


def rotation_log(rotation: FloatArray) -> FloatArray:
    """The rotation vector (3,) of a rotation matrix, stable near 0 and 180 degrees."""
    skew = 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    sine = float(np.linalg.norm(skew))
    cosine = 0.5 * (float(np.trace(rotation)) - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if sine > 1e-6:
        return skew * (angle / sine)
    if cosine > 0:
        return skew
    # Half a turn: the axis is the largest column of the symmetric part of R + I, its sign is free.
    columns = 0.5 * (rotation + rotation.T) + np.eye(3)
    axis = columns[:, int(np.argmax(np.diag(columns)))]
    axis = axis / np.linalg.norm(axis)
    sign = -1.0 if float(axis @ skew) < 0 else 1.0
    return sign * axis * angle


def random_rotation(rng: np.random.Generator) -> FloatArray:
    """A rotation drawn evenly from SO(3), by a random unit quaternion."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return nearest_rotation(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
    )


def _is_rotation(matrix: FloatArray) -> bool:
    # The determinant is written out: poses are made by the ten thousand while components grow.
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return det > 0 and float(np.abs(matrix @ matrix.T - np.eye(3)).max()) < 1e-6


def _straightened(matrix: FloatArray) -> FloatArray:
    """One Newton step to the nearest rotation: keeps products orthonormal to rounding."""
    return 1.5 * matrix - 0.5 * matrix @ (matrix.T @ matrix)


def _cross(v: FloatArray) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _left_jacobian(w: FloatArray) -> FloatArray:
    angle = float(np.linalg.norm(w))
    k = _cross(w)
    if angle < 1e-4:
        return np.eye(3) + 0.5 * k + k @ k / 6
    a = (1 - np.cos(angle)) / angle**2
    b = (angle - np.sin(angle)) / angle**3
    return np.eye(3) + a * k + b * k @ k
