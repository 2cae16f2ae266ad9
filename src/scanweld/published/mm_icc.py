"""MM-ICC: views aligned by the coherence of their contours (paper 3.2)."""

from collections.abc import Mapping, Sequence

from scanweld.config import ContoursConfig
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.published.outer_loop import ContourAlignment, align_contours


def mm_icc(
    scans: Sequence[PreparedScan],
    poses: Mapping[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> ContourAlignment:
    """Refine the poses of two or more views by MM-ICC.

    Three prunings, and matches in 3D that are trimmed as in trimmed ICP, all adjacent views solved
    for together. What is minimised the paper does not say. The distance in space is what trimmed
    ICP takes: it gets in from far, and comes to rest half a pixel or more off, as contour points
    slide along the surface. The distance in the image is M-ICC's, of which MM-ICC changes only the
    prunings and the matching: it lies closer. By default the one comes after the other. All other
    settings are readings of the paper too, or leave parts of it out; ``"normal"`` is ours.

    Args:
        scans: All scans.
        poses: ``world_from_sensor`` at the start, of every scan that an edge names.
        edges: Adjacent views, as indices of scans. Two views are one edge.
        config: Contour sets, prunings, matching and residual.

    Raises:
        ValueError: If an edge names a scan without a pose, or one scan twice.
    """
    return align_contours(scans, poses, edges, config)
