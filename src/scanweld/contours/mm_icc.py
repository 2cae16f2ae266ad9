"""MM-ICC: views aligned by the coherence of their contours (paper 3.2)."""

from collections.abc import Mapping, Sequence

from scanweld.config import ContoursConfig
from scanweld.contours.outer_loop import ContourAlignment, align_contours
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan


def mm_icc(
    scans: Sequence[PreparedScan],
    poses: Mapping[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> ContourAlignment:
    """Refine the poses of two or more views by MM-ICC.

    As published with the residual ``"point"``: three prunings, trimmed ICP in 3D over all adjacent
    views. That gets in from far but is off by half a pixel or so, as contour points slide along
    the surface; with ``"normal"`` a few rounds follow that count only the distance across the
    outline. All other settings are readings of the paper, or parts of it left out.

    Args:
        scans: All scans.
        poses: ``world_from_sensor`` at the start, of every scan that an edge names.
        edges: Adjacent views, as indices of scans. Two views are one edge.
        config: Contour sets, prunings, matching and residual.

    Raises:
        ValueError: If an edge names a scan without a pose, or one scan twice.
    """
    return align_contours(scans, poses, edges, config)
