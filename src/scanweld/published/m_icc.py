"""M-ICC: multi-view iterative contour coherence, as MM-ICC found it (Wang et al., CVPR 2014)."""

from collections.abc import Mapping, Sequence

from scanweld.config import ContoursConfig
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.published.outer_loop import ContourAlignment, align_contours


def m_icc(
    scans: Sequence[PreparedScan],
    poses: Mapping[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> ContourAlignment:
    """Refine the poses of two or more views by M-ICC.

    The contours are those of MM-ICC after the first and the second pruning. Matched are mutual
    closest ("bijective") points in 3D; Levenberg-Marquardt minimises their distances in the images
    of the observing cameras, over all adjacent views together.

    Args:
        scans: All scans.
        poses: ``world_from_sensor`` at the start, of every scan that an edge names.
        edges: Adjacent views, as indices of scans. Two views are one edge.
        config: Contour sets, reading of eq. 4 and iterations; the rest is M-ICC's own.

    Raises:
        ValueError: If an edge names a scan without a pose, or one scan twice.
    """
    published = {
        "prunings": ("self-occlusion", "observed"),
        "matching": "mutual",
        "residual": "image",
    }
    return align_contours(scans, poses, edges, config.model_copy(update=published))
