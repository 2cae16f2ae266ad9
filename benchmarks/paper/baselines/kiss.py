"""KISS-Matcher, refined by GICP."""

import numpy as np

from benchmarks.paper.baselines.gicp import refine
from benchmarks.paper.baselines.records import Answer, ScanPair, cloud_pair
from benchmarks.study.optional import need
from scanweld.geometry.pose import Pose

VOXEL = 0.01
"""In diameters; 0.015 finds fewer pairs. The library derives radii and noise bounds from it."""
NEEDS = ("kiss_matcher", "small_gicp")
GICP_LEVELS = ((0.01, 0.03), (0.005, 0.015))


def kiss_gicp(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """KISS-Matcher (Lim et al. 2025) and GICP; its score is the number of inliers it ends with."""
    library = need("kiss_matcher")
    clouds = cloud_pair(pair)
    matcher = library.KISSMatcher(library.KISSMatcherConfig(voxel_size=VOXEL))
    target, source = (points.astype(np.float32) for points in clouds.points)
    found = matcher.estimate(source, target)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = found.rotation, found.translation
    num_inliers = matcher.get_num_final_inliers()
    if not found.valid:
        return Answer(i_from_j=None, score=0.0, reason="KISS-Matcher finds no valid pose")
    matrix, _ = refine(clouds, matrix, levels=GICP_LEVELS)
    return Answer(i_from_j=clouds.pose_of(matrix), score=float(num_inliers))
