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

    As published by default: three prunings and trimmed matches in 3D, over all adjacent views
    together. What is minimised the paper does not say; as MM-ICC changes the prunings and the
    matching of M-ICC and nothing else, it is taken to be M-ICC's distance in the image. The
    distance in 3D (residual ``"point"``) is the other reading: contour points slide along the
    surface, and their depth on an outline is nearly undetermined, so that it gets in from less far
    and comes to rest half a pixel or more off. All other settings are readings of the paper too,
    or leave parts of it out; ``"normal"`` is ours.

    Args:
        scans: All scans.
        poses: ``world_from_sensor`` at the start, of every scan that an edge names.
        edges: Adjacent views, as indices of scans. Two views are one edge.
        config: Contour sets, prunings, matching and residual.

    Raises:
        ValueError: If an edge names a scan without a pose, or one scan twice.
    """
    return align_contours(scans, poses, edges, config)
