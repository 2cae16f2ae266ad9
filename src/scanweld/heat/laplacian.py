"""Laplace-Beltrami operator of a triangle mesh and its first eigenpairs."""

import numpy as np
import robust_laplacian
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from scanweld.geometry.arrays import FloatArray, IntArray


def eigenpairs(
    vertices: FloatArray, faces: IntArray, num_modes: int, cold: IntArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Smallest eigenvalues (K,) of -Laplace phi = lambda phi and functions (V, K), ascending.

    The functions have unit norm under the mesh's area; nothing flows over open borders (Neumann).
    Shift-invert Lanczos from a fixed start.

    Args:
        vertices: (V, 3), scaled to about unit size.
        faces: (F, 3).
        num_modes: K, constant modes included.
        cold: Vertices (R,) at which all functions are zero (Dirichlet); none if not given.

    Raises:
        scipy.sparse.linalg.ArpackError: If the iteration fails or does not converge.
    """
    stiffness, mass = robust_laplacian.mesh_laplacian(vertices, faces)
    weight = diags_array(1.0 / np.sqrt(mass.diagonal()))
    operator = csc_array(weight @ stiffness @ weight)
    if cold is None or len(cold) == 0:
        values, vectors = _smallest(operator, num_modes)
        return values, weight @ vectors
    warm = np.setdiff1d(np.arange(len(vertices)), cold)
    values, vectors = _smallest(csc_array(operator[warm][:, warm]), num_modes)
    everywhere = np.zeros((len(vertices), num_modes))
    everywhere[warm] = vectors
    return values, weight @ everywhere


def _smallest(operator: csc_array, num_modes: int) -> tuple[FloatArray, FloatArray]:
    """Smallest eigenvalues (K,) and orthonormal vectors (N, K) of a symmetric operator (N, N)."""
    n = operator.diagonal().size
    shift = 1.0  # of the spectrum, for a mesh of unit size: makes the operator definite
    factors = splu(
        csc_array(operator + shift * eye_array(n)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    # scipy's stubs know only the base class's constructor.
    inverse = LinearOperator((n, n), matvec=factors.solve, dtype=np.float64)  # pyright: ignore[reportCallIssue]
    # Any seed does, but it must be the same in every run.
    start = np.random.default_rng(20).standard_normal(n)
    values, vectors = eigsh(operator, k=num_modes, sigma=-shift, v0=start, OPinv=inverse)
    return np.maximum(values, 0.0), vectors
