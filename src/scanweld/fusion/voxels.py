"""How finely posed scans are fused: voxels follow what the scans resolve, not how many there are.

What N points say of a surface of area A is what A / s^2 samples say, where s = sqrt(A / N) is their
spacing along the surface. More scans of the same surface make its places better known, not its
details finer, because each point is the mean over a footprint. A surface has two triangles for each
of its vertices, so that 2 A / s^2 of them hold all of it.

The cubes that a plane with unit normal n passes through give it (|nx| + |ny| + |nz|) / h^2 vertices
for each unit of area, one for each edge that it crosses; the mean over all directions is 3 / 2. So
voxels of h = sqrt(3 / 2) s make 3 A / h^2 = 2 A / s^2 triangles.
"""

import logging
from collections.abc import Sequence

import numpy as np

from scanweld.config import FusionConfig
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.prepared import PreparedScan
from scanweld.preparation.prepare import surface_points
from scanweld.preparation.range_image import natural_pixel

logger = logging.getLogger(__name__)

_VOXEL_SPACINGS = float(np.sqrt(1.5))
"""Edge of the voxels, in spacings, whose triangles are twice as many as what the points say."""
_FINE_SHARE = 0.25
"""Quantile of the scans' spacings that sets the voxels: one fine scan is no reason for fine voxels
everywhere, but where a quarter of the scans are fine, the coarse ones must not blur them."""


def voxel_edge(scans: Sequence[PreparedScan], config: FusionConfig) -> float:
    """Edge of the voxels that scans are fused in, in their unit."""
    spacing = float(np.quantile([surface_spacing(scan) for scan in scans], _FINE_SHARE))
    resolved = config.voxel_resolutions * _VOXEL_SPACINGS * spacing
    finest = _finest(scans, config)
    if finest**2 > 2.0 * resolved**2:  # Less than half of the triangles are left.
        logger.warning(
            "the scans resolve voxels of %.3g, but the model's are %.3g, %d across: set "
            "max_voxels_across to %d for all of their detail",
            resolved,
            finest,
            config.max_voxels_across,
            int(np.ceil(config.max_voxels_across * finest / resolved)),
        )
    return max(resolved, finest)


def surface_spacing(scan: PreparedScan) -> float:
    """Spacing of a scan's points along its surface: the root of the area that each of them has."""
    kept = surface_points(scan)[1] if scan.is_without_support else scan.scan.points
    doubled = np.linalg.norm(face_normals(scan.mesh.vertices, scan.mesh.faces), axis=1)
    return float(np.sqrt(0.5 * doubled.sum() / len(kept)))


def image_pixels(scans: Sequence[PreparedScan], config: FusionConfig) -> list[float]:
    """Footprints of the images' pixels: as fine as the scans, but no finer than voxels may be."""
    finest = _finest(scans, config)
    return [max(natural_pixel(scan.scan, scan.resolution), finest) for scan in scans]


def _finest(scans: Sequence[PreparedScan], config: FusionConfig) -> float:
    return max(scan.diameter for scan in scans) / config.max_voxels_across
