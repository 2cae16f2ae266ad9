"""Scans of a mesh from views around it, prepared, with their true poses: what is to be fused."""

from collections.abc import Sequence

import numpy as np

from scanweld.config import PrepareConfig
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.preparation import prepare

RADIUS = 50.0
SIX_SIDES = [(0, 0), (90, 0), (180, 0), (270, 0), (0, 89), (0, -89)]
"""Azimuths and elevations, degrees."""
Posed = tuple[list[PreparedScan], list[Pose]]


def views_of(
    mesh: TriangleMesh,
    angles: Sequence[tuple[float, float]] = SIX_SIDES,
    pixels: float = 110.0,
    model: CameraModel = CameraModel.ORTHOGRAPHIC,
) -> list[View]:
    """Views of a mesh from azimuths and elevations, in degrees."""
    return [view_of(mesh, *angle, pixels=pixels, model=model) for angle in angles]


def one_scan(mesh: TriangleMesh, view: View, k: int, noise: NoiseModel | float = 0.0) -> RangeScan:
    """The k-th scan; noise of the depth alone is a share of the diameter."""
    model = noise if isinstance(noise, NoiseModel) else NoiseModel(depth_diameters=noise)
    return scan_mesh(mesh, view.camera, view.world_from_sensor, model, seed=k, name=f"scan_{k}")


def scanned(
    mesh: TriangleMesh,
    views: Sequence[View] | None = None,
    noise: NoiseModel | float | Sequence[float] = 0.0,
) -> Posed:
    """Scans from views, or else from six sides; noise of all, or of each."""
    views = views_of(mesh) if views is None else views
    noises = noise if isinstance(noise, Sequence) else [noise] * len(views)
    scans = [one_scan(mesh, view, k, noises[k]) for k, view in enumerate(views)]
    prepared = [prepare(scan, PrepareConfig()) for scan in scans]
    return prepared, [view.world_from_sensor for view in views]


def off_sphere(points: np.ndarray) -> np.ndarray:
    """How far points lie outside the sphere about the origin."""
    return np.linalg.norm(points, axis=1) - RADIUS
