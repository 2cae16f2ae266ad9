"""Descriptors of the eigenpairs of a mesh: HKS of a complete mesh, SI-HKS and WKS."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, compact
from scanweld.geometry.scan import principal_diameter
from scanweld.heat.keypoints import group, persistent_maxima
from scanweld.heat.laplacian import eigenpairs
from scanweld.heat.signature import diffusion_times, heat_signature
from scanweld.preparation.sampling import farthest_points

_NUM_NEAREST = 3
_NUM_TIMES = 10
_LONGEST_DIAMETERS2 = 2e-2
_GROUP_DIAMETERS = 0.05
_STEPS_PER_OCTAVE = 16
"""Bronstein & Kokkinos sample tau at 1/16."""
_CONSTANT = 1e-6
"""Eigenvalues below this, for a mesh of unit size, belong to functions constant on each piece."""
_WIDTH_STEPS = 7
"""Width of the energy bands, in steps from one to the next (Aubry et al. 2011)."""


class Spectrum(NamedTuple):
    """The first eigenpairs of -Laplace phi = lambda phi on a mesh."""

    points: FloatArray  # (V, 3) vertices, in the mesh's frame and unit
    eigenvalues: FloatArray  # (K,) ascending, per squared diameter
    functions: FloatArray  # (V, K) of unit norm under the mesh's area in squared diameters


def spectrum_of(vertices: FloatArray, faces: IntArray, diameter: float, num_modes: int) -> Spectrum:
    """The eigenpairs of a mesh (more vertices than modes), its lengths measured in diameters.

    Raises:
        scipy.sparse.linalg.ArpackError: If the eigenproblem is not solved.
    """
    unit = (vertices - vertices.mean(axis=0)) / diameter
    eigenvalues, functions = eigenpairs(unit, faces, num_modes)
    return Spectrum(points=vertices, eigenvalues=eigenvalues, functions=functions)


def values_at(values: FloatArray, vertices: FloatArray, points: FloatArray) -> FloatArray:
    """Values (N, C) at points: means of the nearest three vertices, by the inverse distance."""
    distance, nearest = KDTree(vertices).query(points, k=_NUM_NEAREST)
    weights = 1.0 / np.maximum(distance, 1e-9 * np.ptp(vertices, axis=0).max())
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("nk,nkc->nc", weights, values[nearest])


def thin_mesh(mesh: TriangleMesh, max_vertices: int) -> TriangleMesh:
    """A mesh on evenly spread vertices of another: every vertex goes to the nearest kept one.

    The kept vertices are chosen by farthest points, so a moved mesh is thinned alike. Faces whose
    corners meet vanish; the result need not be manifold.
    """
    used, faces, _ = compact(mesh.vertices, mesh.faces)
    if len(used) <= max_vertices:
        return TriangleMesh(vertices=used, faces=faces)
    kept = used[farthest_points(used, max_vertices)]
    _, nearest = KDTree(kept).query(used)
    merged = np.asarray(nearest, dtype=np.int64)[faces]
    a, b, c = merged.T
    merged = merged[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(merged, axis=1), axis=0, return_index=True)
    vertices, faces, _ = compact(kept, merged[np.sort(first)])
    return TriangleMesh(vertices=vertices, faces=faces)


def full_mesh_spectrum(
    mesh: TriangleMesh, *, max_vertices: int = 3000, num_modes: int = 150
) -> tuple[Spectrum, IntArray]:
    """Eigenpairs of a complete mesh, thinned first, and the faces (F, 3) of the thinned mesh.

    Raises:
        scipy.sparse.linalg.ArpackError: If the eigenproblem is not solved.
    """
    thin = thin_mesh(mesh, max_vertices)
    diameter = principal_diameter(mesh.vertices)
    return spectrum_of(thin.vertices, thin.faces, diameter, num_modes), thin.faces


def full_mesh_hks(spectrum: Spectrum) -> FloatArray:
    """Log heat signature (V, T) of a complete mesh's vertices, at the times that PA-HKS uses."""
    times = diffusion_times(spectrum.eigenvalues, _NUM_TIMES, _LONGEST_DIAMETERS2)
    return heat_signature(spectrum.eigenvalues, spectrum.functions, times)


def full_mesh_keypoints(
    spectrum: Spectrum, faces: IntArray, signature: FloatArray, diameter: float
) -> IntArray:
    """Vertices (K,) where the signature has persistent maxima, grouped as PA-HKS's are."""
    unit = spectrum.points / diameter
    maxima = persistent_maxima(signature, unit, faces, _GROUP_DIAMETERS)
    at = maxima.vertices
    return at[group(unit[at], signature[at], maxima.strengths, _GROUP_DIAMETERS)]


def octave_times(shortest: float, longest: float) -> FloatArray:
    """Times 2^tau (T,) from the shortest to the longest at most, with tau in steps of 1/16."""
    num_steps = int(_STEPS_PER_OCTAVE * np.log2(longest / shortest) + 1e-9)
    return shortest * 2.0 ** (np.arange(num_steps + 1) / _STEPS_PER_OCTAVE)


def si_heat_signature(
    eigenvalues: FloatArray, functions: FloatArray, times: FloatArray, num_frequencies: int = 6
) -> FloatArray:
    """Magnitudes |F_w d/dtau log h(x, 2^tau)| of the lowest frequencies w: (V, F).

    h(x, t) = sum_i exp(-lambda_i t) phi_i(x)^2, constant modes included. An object that is b times
    as large has h'(x, t) = h(x, t / b^2) / b^2: the logarithm turns the factor into a summand, the
    derivative removes it, and the magnitude of the Fourier transform over tau = log2 t removes the
    shift (Bronstein & Kokkinos 2010, section 3). The window of times must be wide enough for the
    derivative to vanish at its ends.
    """
    rate = np.outer(eigenvalues, times)
    decay = np.exp(-rate)
    squares = functions**2
    heat = squares @ decay
    slope = -np.log(2.0) * (squares @ (rate * decay)) / np.maximum(heat, np.finfo(float).tiny)
    return np.abs(np.fft.rfft(slope, axis=1))[:, :num_frequencies] / len(times)


def energy_bands(eigenvalues: FloatArray, num_bands: int = 100) -> tuple[FloatArray, float]:
    """Logarithms of energies (E,), evenly spaced, and the width sigma of the bands around them.

    The bands keep 2 sigma from both ends of the spectrum, with sigma = 7 steps (Aubry et al. 2011).
    """
    varying = eigenvalues[eigenvalues > _CONSTANT]
    low, high = np.log(varying[0]), np.log(varying[-1])
    step = (high - low) / (num_bands - 1 + 4 * _WIDTH_STEPS)
    width = _WIDTH_STEPS * step
    return low + 2 * width + step * np.arange(num_bands), float(width)


def wave_signature(
    eigenvalues: FloatArray, functions: FloatArray, log_energies: FloatArray, width: float
) -> FloatArray:
    """WKS(x, e) = C_e sum_k phi_k(x)^2 exp(-(e - log lambda_k)^2 / (2 sigma^2)): (V, E).

    C_e = 1 / sum_k exp(-(e - log lambda_k)^2 / (2 sigma^2)), so that the signature at every energy
    integrates to one over the surface (Aubry et al. 2011). Constant modes are skipped.
    """
    varies = eigenvalues > _CONSTANT
    apart = (log_energies - np.log(eigenvalues[varies])[:, None]) / width
    weights = np.exp(-0.5 * apart**2)
    return functions[:, varies] ** 2 @ (weights / weights.sum(axis=0))


def wave_distances(one: FloatArray, other: FloatArray) -> FloatArray:
    """Sums (N, M) of |a - b| / (a + b) over the energies, as Aubry et al. compare signatures."""
    distances = np.empty((len(one), len(other)))
    for row, a in enumerate(one):
        total = np.maximum(a + other, np.finfo(float).tiny)
        distances[row] = (np.abs(a - other) / total).sum(axis=1)
    return distances
