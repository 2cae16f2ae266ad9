"""Posed scans -> one surface."""

from scanweld.fusion.fuse import fuse

__all__ = ["fuse"]
