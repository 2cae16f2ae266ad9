"""The heat kernel signature on a complete mesh: what PA-HKS would be if a scan saw everything."""

import numpy as np
from scipy.spatial import KDTree

from benchmarks.features.spectrum import Spectrum, spectrum_of
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, compact
from scanweld.geometry.scan import principal_diameter
from scanweld.heat.keypoints import group, persistent_maxima
from scanweld.heat.signature import diffusion_times, heat_signature
from scanweld.preparation.sampling import farthest_points

_NUM_TIMES = 10
_LONGEST_DIAMETERS2 = 2e-2
_GROUP_DIAMETERS = 0.05


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
