"""Posed scans -> one surface."""

from scanweld.fusion.fuse import fuse
from scanweld.fusion.voxels import voxel_edge

__all__ = ["fuse", "voxel_edge"]
