"""Reading scans, meshes and poses; writing models and poses."""

from scanweld.io.read import read_mesh, read_scan

__all__ = ["read_mesh", "read_scan"]
