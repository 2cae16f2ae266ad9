"""Evidence that forgives edges.

Noise of one sensor's depth shifts a sample sideways in another view. At the edge of something thin
it then falls on a pixel that sees far behind it, and lies before that surface, at the right pose.
"""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from scanweld.evidence.evidence import Evidence
from scanweld.evidence.field import RASTER_DEPTH, RASTER_KIND, ScanField
from scanweld.evidence.sample_patches import violating_patches, with_patches
from scanweld.evidence.visibility import mean_evidence, two_way_evidence
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind


def with_wide_edges(field: ScanField, reach: float) -> ScanField:
    """The scan as if each pixel saw the nearest edge that lies within reach of it, sideways.

    A pixel lies on an edge if one beside it is deeper by a depth jump, or no surface.

    Args:
        field: The scan.
        reach: How far aside, at the middle of the scan, in its unit.
    """
    depth = field.raster[..., RASTER_DEPTH]
    is_surface = field.raster[..., RASTER_KIND] == float(PixelKind.SURFACE)
    if not is_surface.any():
        return field
    footprint = _footprint(field, float(np.median(depth[is_surface])))
    solid = np.where(is_surface, depth, np.inf)
    jump = field.jump_pixels * footprint
    is_edge = is_surface & (ndimage.maximum_filter(solid, 3) > depth + jump)
    radius = round(reach / footprint)
    offsets = np.arange(-radius, radius + 1)
    disk = np.add.outer(offsets**2, offsets**2) <= radius**2
    nearest = ndimage.minimum_filter(np.where(is_edge, depth, np.inf), footprint=disk)
    raster = field.raster.copy()
    raster[..., RASTER_DEPTH] = np.where(is_surface, np.minimum(depth, nearest), depth)
    return replace(field, raster=raster)


def evidence_off_edges(
    i: tuple[ScanField, ScanField],
    j: tuple[ScanField, ScanField],
    i_from_j: Pose,
    tolerance: float,
    max_samples: int = 10**9,
) -> Evidence:
    """Mean evidence of both directions, samples before an edge being unknown.

    Args:
        i: First scan, as it is and with wide edges.
        j: Second scan, likewise.
        i_from_j: The pose to judge, sensor frames.
        tolerance: Depth tolerance, in the scans' unit.
        max_samples: Samples of each scan that are asked about, at most.
    """
    strict, off_edges = (
        mean_evidence(*two_way_evidence(i[k], j[k], i_from_j, tolerance, max_samples))
        for k in (0, 1)
    )
    forgiven = strict.front - off_edges.front
    (patches,) = violating_patches(i[1], j[1], [i_from_j], tolerance)
    unknown = strict.unknown + forgiven
    return with_patches(replace(strict, front=off_edges.front, unknown=unknown), patches)


def _footprint(field: ScanField, depth: float) -> float:
    """Size of a pixel at a depth, in the scan's unit."""
    model, fx, fy, _, _ = field.camera
    size = 2.0 / (fx + fy)
    return size if model == CameraModel.ORTHOGRAPHIC else size * depth
