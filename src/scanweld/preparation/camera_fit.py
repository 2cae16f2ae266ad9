"""The frame camera behind an organised grid: pinhole or orthographic, if one explains it."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose, nearest_rotation, rotation_exp

MAX_RMS_PIXELS = 0.25
"""Root mean square distance between projected points and their cells up to which a camera fits."""
MIN_RELIEF = 1e-3
"""Thickness of the points, as a share of their extent, below which they count as flat."""
MIN_EIGENVALUE_RATIO = 100.0
"""Second smallest over smallest eigenvalue of a homogeneous fit that is well determined."""
NUM_STEPS = 10
"""Gauss-Newton steps from the linear to the least-squares pinhole."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CameraFit:
    """A camera whose pixels are the grid's cells.

    Attributes:
        camera: Its pixels (u, v) are (column, row) of the grid.
        sensor_from_scan: Points of the scan frame -> sensor frame.
        is_mirrored: Whether the camera belongs to the grid with its rows reversed.
        rms: Residual in pixels.
    """

    camera: Camera
    sensor_from_scan: Pose
    is_mirrored: bool
    rms: float


def affine_fit(points: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least-squares values = points @ gradient + offset, of least norm where the points are flat.

    Args:
        points: (N, 3).
        values: (N, K), such as columns and rows.

    Returns:
        The gradient (3, K), the offset (K,) and the residuals (N, K).
    """
    centre, mean = points.mean(axis=0), values.mean(axis=0)
    spread, axes = np.linalg.eigh((points - centre).T @ (points - centre))
    axes = axes[:, spread > MIN_RELIEF**2 * spread[-1]]
    along = (points - centre) @ axes
    slopes = np.linalg.solve(along.T @ along, along.T @ (values - mean))
    gradient = axes @ slopes
    return gradient, mean - centre @ gradient, values - mean - along @ slopes


def homogeneous_fit(design: FloatArray) -> FloatArray | None:
    """The unit vector q that minimises |design @ q|; None if it is not well determined."""
    eigenvalues, vectors = np.linalg.eigh(design.T @ design)
    noise = max(eigenvalues[0], 1e-14 * eigenvalues[-1])
    return vectors[:, 0] if eigenvalues[1] > MIN_EIGENVALUE_RATIO * noise else None


def fit_orthographic(
    points: FloatArray, pixels: FloatArray, shape: tuple[int, int], viewing: FloatArray
) -> CameraFit | None:
    """The orthographic camera that sees points (N, 3) at pixels (N, 2), or None.

    Args:
        points: (N, 3), scan frame.
        pixels: (N, 2) column and row.
        shape: Rows and columns of the grid.
        viewing: (3,) the side from which it looks; only the sign along the fitted axis counts.
    """
    gradient, _, _ = affine_fit(points, pixels)
    right, down = gradient.T / np.linalg.norm(gradient, axis=0)[:, None]
    is_mirrored = bool(np.cross(right, down) @ viewing < 0)
    if is_mirrored:
        down = -down
        pixels = np.stack([pixels[:, 0], shape[0] - 1 - pixels[:, 1]], axis=1)
    rotation = nearest_rotation(np.stack([right, down, np.cross(right, down)]))
    centre = points.mean(axis=0)
    plane = (points - centre) @ rotation[:2].T
    fx, fy = (plane * pixels).sum(axis=0) / (plane**2).sum(axis=0)
    cx, cy = pixels.mean(axis=0)
    residuals = plane * (fx, fy) + (cx, cy) - pixels
    rms = float(np.sqrt((residuals**2).sum(axis=1).mean()))
    if rms > MAX_RMS_PIXELS or fx <= 0 or fy <= 0:
        return None
    camera = Camera(
        model=CameraModel.ORTHOGRAPHIC,
        height=shape[0],
        width=shape[1],
        fx=float(fx),
        fy=float(fy),
        cx=float(cx),
        cy=float(cy),
    )
    pose = Pose(rotation=rotation, translation=-rotation @ centre)
    return CameraFit(camera=camera, sensor_from_scan=pose, is_mirrored=is_mirrored, rms=rms)


def fit_pinhole(points: FloatArray, pixels: FloatArray, shape: tuple[int, int]) -> CameraFit | None:
    """The pinhole camera without skew that sees points (N, 3) at pixels (N, 2), or None.

    Direct linear transform on normalised coordinates, then least squares of the reprojection.
    """
    centre = points.mean(axis=0)
    scale = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))
    unit = (points - centre) / scale
    matrix = _linear_pinhole(unit, pixels)
    if matrix is None:
        return None
    is_mirrored = bool(np.linalg.det(matrix[:, :3]) < 0)
    if is_mirrored:
        matrix = np.array([[1.0, 0, 0], [0, -1, shape[0] - 1], [0, 0, 1]]) @ matrix
        pixels = np.stack([pixels[:, 0], shape[0] - 1 - pixels[:, 1]], axis=1)
    intrinsics, rotation, shift = _decompose(matrix)
    intrinsics, rotation, shift, rms = _polish(unit, pixels, intrinsics, rotation, shift)
    if not rms <= MAX_RMS_PIXELS or intrinsics[:2].min() <= 0:
        return None
    fx, fy, cx, cy = (float(value) for value in intrinsics)
    camera = Camera(
        model=CameraModel.PINHOLE, height=shape[0], width=shape[1], fx=fx, fy=fy, cx=cx, cy=cy
    )
    pose = Pose(rotation=rotation, translation=scale * shift - rotation @ centre)
    return CameraFit(camera=camera, sensor_from_scan=pose, is_mirrored=is_mirrored, rms=rms)


def _linear_pinhole(unit: FloatArray, pixels: FloatArray) -> FloatArray | None:
    """The projection matrix (3, 4) by direct linear transform, all points before the camera."""
    mean = pixels.mean(axis=0)
    spread = float(np.sqrt(((pixels - mean) ** 2).sum(axis=1).mean()))
    normal = (pixels - mean) / spread
    lifted = np.column_stack([unit, np.ones(len(unit))])
    zero = np.zeros_like(lifted)
    design = np.concatenate(
        [
            np.column_stack([lifted, zero, -normal[:, :1] * lifted]),
            np.column_stack([zero, lifted, -normal[:, 1:] * lifted]),
        ]
    )
    solution = homogeneous_fit(design)
    if solution is None:
        return None
    matrix = np.array([[spread, 0, mean[0]], [0, spread, mean[1]], [0, 0, 1]]) @ solution.reshape(
        3, 4
    )
    depth = lifted @ matrix[2]
    matrix = matrix * np.sign(depth.mean())
    return matrix if depth.min() * depth.max() > 0 else None


def _decompose(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Intrinsics fx, fy, cx, cy, rotation and shift of a (3, 4) with positive determinant."""
    # The QR decomposition, with rows and columns reversed: SciPy's RQ takes long to import.
    turned, lower = np.linalg.qr(matrix[::-1, :3].T)
    upper, rotation = lower.T[::-1, ::-1], turned.T[::-1]
    signs = np.sign(np.diag(upper))
    upper, rotation = upper * signs, signs[:, None] * rotation
    shift: FloatArray = np.linalg.solve(upper, matrix[:, 3]).astype(np.float64)
    upper = upper / upper[2, 2]
    return np.array([upper[0, 0], upper[1, 1], upper[0, 2], upper[1, 2]]), rotation, shift


def _polish(
    points: FloatArray,
    pixels: FloatArray,
    intrinsics: FloatArray,
    rotation: FloatArray,
    shift: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Levenberg-Marquardt on the reprojection error; skew stays zero."""
    damping = 1e-6
    residuals, jacobian = _reprojection(points, pixels, intrinsics, rotation, shift)
    for _ in range(NUM_STEPS):
        normal = jacobian.T @ jacobian
        normal[np.diag_indices(10)] *= 1 + damping
        step = -np.asarray(np.linalg.lstsq(normal, jacobian.T @ residuals)[0], dtype=np.float64)
        candidate = (
            intrinsics + step[:4],
            nearest_rotation(rotation_exp(step[4:7]) @ rotation),
            shift + step[7:],
        )
        new_residuals, new_jacobian = _reprojection(points, pixels, *candidate)
        if not new_residuals @ new_residuals < residuals @ residuals:
            damping *= 100
            continue
        has_converged = new_residuals @ new_residuals > (1 - 1e-6) * (residuals @ residuals)
        (intrinsics, rotation, shift), damping = candidate, damping / 10
        residuals, jacobian = new_residuals, new_jacobian
        if has_converged:
            break
    rms = float(np.sqrt(residuals @ residuals / len(points)))
    return intrinsics, rotation, shift, rms


def _reprojection(
    points: FloatArray,
    pixels: FloatArray,
    intrinsics: FloatArray,
    rotation: FloatArray,
    shift: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Residuals (2N,) in pixels and their derivative (2N, 10): intrinsics, turn, shift."""
    fx, fy, cx, cy = intrinsics
    turned = points @ rotation.T
    x, y, z = (turned + shift).T
    u, v = x / z, y / z
    one, zero = np.ones_like(z), np.zeros_like(z)
    by_point = np.stack(
        [
            np.stack([fx / z, zero, -fx * u / z], axis=1),
            np.stack([zero, fy / z, -fy * v / z], axis=1),
        ]
    )
    by_intrinsics = np.stack(
        [np.stack([u, zero, one, zero], axis=1), np.stack([zero, v, zero, one], axis=1)]
    )
    by_turn = np.cross(turned[None], by_point)
    jacobian = np.concatenate([by_intrinsics, by_turn, by_point], axis=2).reshape(-1, 10)
    residuals = np.concatenate([fx * u + cx - pixels[:, 0], fy * v + cy - pixels[:, 1]])
    return residuals, jacobian
