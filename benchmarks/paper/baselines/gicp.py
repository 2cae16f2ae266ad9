"""GICP and point-to-plane ICP of small_gicp, from a start pose, coarse to fine."""

from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np

from benchmarks.paper.baselines.records import Answer, CloudPair, ScanPair, cloud_pair
from benchmarks.study.optional import need
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose

Kind = Literal["GICP", "PLANE_ICP"]

LEVELS = ((0.02, 0.2), (0.01, 0.05), (0.005, 0.015))
"""Voxel and farthest match of each level, in diameters."""
NUM_NEIGHBOURS = 20
"""Of a point, from which its normal or covariance comes: the library's own default."""
MAX_ITERATIONS = 50
EPSILON = 1e-5
"""Radians and diameters: a step below both ends a level."""


def refine(
    clouds: CloudPair,
    matrix: FloatArray,
    kind: Kind = "GICP",
    levels: Sequence[tuple[float, float]] = LEVELS,
) -> tuple[FloatArray, float]:
    """Refine a (4, 4) matrix between clouds; also the share of j that is matched in the end."""
    library = need("small_gicp")
    thinned = partial(library.preprocess_points, num_neighbors=NUM_NEIGHBOURS, num_threads=1)
    share = 0.0
    for voxel, reach in levels:
        (target, tree), (source, _) = (thinned(points, voxel) for points in clouds.points)
        found = library.align(
            target,
            source,
            tree,
            init_T_target_source=matrix,
            registration_type=kind,
            max_correspondence_distance=reach,
            num_threads=1,
            max_iterations=MAX_ITERATIONS,
            rotation_epsilon=EPSILON,
            translation_epsilon=EPSILON,
        )
        matrix = np.asarray(found.T_target_source, dtype=np.float64)
        share = found.num_inliers / source.size()
    return matrix, share


def gicp(pair: ScanPair, start: Pose, seed: int, kind: Kind = "GICP") -> Answer:
    """Generalised (Segal et al. 2009) or point-to-plane (Chen and Medioni 1992) ICP."""
    clouds = cloud_pair(pair)
    matrix, share = refine(clouds, clouds.matrix_of(start), kind)
    return Answer(i_from_j=clouds.pose_of(matrix), score=share)
