"""Reading scans, meshes and poses; writing models and poses."""

from scanweld.io.atomic import write_whole
from scanweld.io.collect import ScanFile, collect
from scanweld.io.names import natural_key, path_from, printable
from scanweld.io.ply_write import write_mesh_ply, write_scan_ply
from scanweld.io.poses import PoseSet, read_poses, write_poses
from scanweld.io.read import read_mesh, read_scan

__all__ = [
    "PoseSet",
    "ScanFile",
    "collect",
    "natural_key",
    "path_from",
    "printable",
    "read_mesh",
    "read_poses",
    "read_scan",
    "write_mesh_ply",
    "write_poses",
    "write_scan_ply",
    "write_whole",
]
