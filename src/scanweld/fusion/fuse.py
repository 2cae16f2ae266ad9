"""Posed scans -> one mesh."""

import logging
from collections.abc import Sequence

import numpy as np

from scanweld.config import FusionConfig
from scanweld.errors import InputError
from scanweld.fusion.color import blend_colors
from scanweld.fusion.posed_image import PosedImage, pose_images
from scanweld.fusion.surface import drop_small_pieces, extract_surface
from scanweld.fusion.volume import integrate
from scanweld.geometry.mesh import TriangleMesh, vertex_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import principal_diameter

logger = logging.getLogger(__name__)

_MIN_PIXELS = 10
"""Surface pixels of all scans together, at least."""


def fuse(
    scans: Sequence[PreparedScan], world_from_sensor: Sequence[Pose], config: FusionConfig
) -> TriangleMesh:
    """Fuse posed scans into one mesh, trimmed to what they saw.

    Args:
        scans: Prepared scans of one object; their order matters to the last bits only.
        world_from_sensor: A pose for each.
        config: Settings.

    Returns:
        The mesh in the world frame with unit normals that point out, and with colours if one of the
        scans has them. Parts that no scan saw are left open.

    Raises:
        InputError: If the scans hold no surface to fuse, or lie too far apart.
        ValueError: If there are not as many poses as scans.
    """
    if len(scans) != len(world_from_sensor):
        raise ValueError(f"{len(scans)} scans, but {len(world_from_sensor)} poses")
    images = pose_images(scans, world_from_sensor)
    voxel = _voxel_size(scans, images, config)
    volume = integrate(images, voxel, config.truncation_voxels * voxel)
    logger.debug("%d blocks of voxels of %.4g", len(volume.blocks), voxel)
    vertices, faces = drop_small_pieces(*extract_surface(volume), voxel)
    if not len(faces):
        raise InputError("the posed scans hold no surface that could be fused; see their poses")
    normals = vertex_normals(vertices, faces)
    reach = max(2.0 * voxel, *(2.0 * scan.resolution for scan in scans))
    colors = blend_colors(vertices, normals, scans, images, reach)
    logger.debug("fused %d scans into %d faces", len(scans), len(faces))
    return TriangleMesh(vertices=vertices, faces=faces, normals=normals, colors=colors)


def _voxel_size(
    scans: Sequence[PreparedScan], images: Sequence[PosedImage], config: FusionConfig
) -> float:
    surfaces = [image.points[image.weight > 0] for image in images]
    if sum(map(len, surfaces)) < _MIN_PIXELS:
        raise InputError("the scans hold no surface that could be fused")
    diameter = principal_diameter(np.concatenate(surfaces))
    resolution = float(np.median([scan.resolution for scan in scans]))
    return max(config.voxel_resolutions * resolution, diameter / config.max_voxels_across)
