"""Posed scans -> one surface."""

from scanweld.fusion.fuse import fuse, voxel_edge

__all__ = ["fuse", "voxel_edge"]
