"""The heat signature over a scan, and what becomes of its maxima until they are keypoints."""

from dataclasses import dataclass
from functools import lru_cache

from scipy.spatial import KDTree

from benchmarks.features.spectral import Spectrum, spectrum_of
from scanweld.config import HeatConfig
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.artificial_mesh import ArtificialMesh, close_front
from scanweld.heat.features import move_off_rims
from scanweld.heat.front import FrontMesh, thin_front
from scanweld.heat.keypoints import group, persistent_maxima
from scanweld.heat.signature import diffusion_times, heat_signature

_NEIGHBOURS = 4


@dataclass(frozen=True, slots=True, eq=False)
class HeatField:
    """What ``scanweld.heat.describe`` goes through on its way to the keypoints of a scan."""

    front: FrontMesh  # The thinned measured surface
    mesh: ArtificialMesh  # Closed by walls and a back plane
    spectrum: Spectrum  # Eigenpairs of the closed mesh, on the front's points
    times: FloatArray  # (T,) in squared diameters
    signature: FloatArray  # (N, T) on the front's points
    found: IntArray  # (K,) front vertices of persistent maxima that have an anchor off the rims
    moved: IntArray  # (K,) the anchors
    grouped: IntArray  # (G,) front vertices of the keypoints, strongest first

    @property
    def keypoints(self) -> FloatArray:
        """(G, 3), sensor frame."""
        return self.front.points[self.grouped]

    def on_mesh(self, scan: PreparedScan, time: int) -> FloatArray:
        """The signature at a time on the vertices (V,) of the scan's own, finer mesh."""
        away, near = KDTree(self.front.points).query(scan.mesh.vertices, k=_NEIGHBOURS)
        weight = 1.0 / (away**2 + (0.5 * scan.image.pixel) ** 2)
        return (weight * self.signature[near, time]).sum(axis=1) / weight.sum(axis=1)


@lru_cache(maxsize=16)
def heat_field(scan: PreparedScan) -> HeatField:
    """The heat of a scan, stage by stage, under the default settings."""
    config = HeatConfig()
    front = thin_front(scan.image, config.max_front_vertices)
    mesh = close_front(front, scan.image.camera, scan.diameter)
    whole = spectrum_of(mesh.vertices, mesh.faces, scan.diameter, config.num_modes)
    functions = whole.functions[: mesh.num_front]
    spectrum = whole._replace(points=front.points, functions=functions)
    times = diffusion_times(whole.eigenvalues, config.num_times, config.longest_time_diameters2)
    signature = heat_signature(spectrum.eigenvalues, spectrum.functions, times)
    maxima = persistent_maxima(
        signature, front.points / scan.diameter, front.faces, config.group_diameters
    )
    reach = config.group_diameters * scan.diameter
    moved, is_kept = move_off_rims(front, scan.image, maxima.vertices, reach)
    leaders = group(front.points[moved], signature[moved], maxima.strengths[is_kept], reach)
    found, grouped = maxima.vertices[is_kept], moved[leaders]
    return HeatField(front, mesh, spectrum, times, signature, found, moved, grouped)
