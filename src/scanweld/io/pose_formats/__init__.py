"""Poses in the formats of other tools: one module a format, each with ``read`` and ``write``."""

from scanweld.io.pose_formats.formats import FORMATS, PoseFormat, read_any_poses
from scanweld.io.pose_formats.matching import match_all_poses, match_poses
from scanweld.io.pose_formats.records import Frame, PosedScan, PoseEntries, require_pinhole

__all__ = [
    "FORMATS",
    "Frame",
    "PoseEntries",
    "PoseFormat",
    "PosedScan",
    "match_all_poses",
    "match_poses",
    "read_any_poses",
    "require_pinhole",
]
