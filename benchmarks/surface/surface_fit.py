"""The one rigid motion that lays a model onto a reference surface."""

import numpy as np
from scipy.spatial import KDTree

from scanweld.evaluation.surface_errors import sample_surface
from scanweld.geometry.gauss_newton import damped, jacobian, motion_of, spread_of, tukey_weights
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose

_NUM_ROUNDS = 30
_STILL = 1e-7
"""Steps shorter than this share of the reference's extent have arrived."""


def fit_surface(model: TriangleMesh, reference: TriangleMesh, *, num_samples: int) -> Pose:
    """Point-to-plane ICP of samples of a model that lies nearly right: reference_from_model."""
    rng = np.random.default_rng(0)
    moving, _ = sample_surface(model, num_samples, rng)
    target, face_of = sample_surface(reference, num_samples, rng)
    normals = face_normals(reference.vertices, reference.faces)[face_of]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centre, tree, pose = target.mean(axis=0), KDTree(target), Pose.identity()
    arm = float(np.linalg.norm(np.ptp(target, axis=0)))
    for _ in range(_NUM_ROUNDS):
        points = pose.apply(moving)
        nearest = tree.query(points)[1]
        residuals = np.einsum("nk,nk->n", points - target[nearest], normals[nearest])
        weights = tukey_weights(residuals, spread_of(residuals, 1e-9 * arm))
        rows = jacobian(points, normals[nearest], centre, arm)
        normal = damped(rows.T @ (weights[:, None] * rows))
        twist = -np.linalg.solve(normal, rows.T @ (weights * residuals))
        pose = motion_of(twist, centre, arm) @ pose
        if float(np.linalg.norm(twist)) < _STILL * arm:
            break
    return pose
