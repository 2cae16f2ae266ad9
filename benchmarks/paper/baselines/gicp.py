"""GICP and point-to-plane ICP of small_gicp, from a start pose, coarse to fine."""

from typing import Literal

import numpy as np

from benchmarks.paper.baselines.clouds import CloudPair, cloud_pair
from benchmarks.paper.baselines.records import Answer, ScanPair
from benchmarks.paper.optional import need
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


def gicp(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """Generalised ICP (Segal et al. 2009) from the start."""
    return _from_start(pair, start, "GICP")


def point_to_plane(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """Point-to-plane ICP (Chen and Medioni 1992) from the start."""
    return _from_start(pair, start, "PLANE_ICP")


def refine(
    clouds: CloudPair,
    matrix: FloatArray,
    kind: Kind,
    levels: tuple[tuple[float, float], ...] = LEVELS,
) -> tuple[FloatArray, float]:
    """Refine a (4, 4) matrix between clouds; also the share of j that is matched in the end."""
    library = need("small_gicp")
    share = 0.0
    for voxel, reach in levels:
        target, tree = library.preprocess_points(
            clouds.i.points, voxel, num_neighbors=NUM_NEIGHBOURS, num_threads=1
        )
        source, _ = library.preprocess_points(
            clouds.j.points, voxel, num_neighbors=NUM_NEIGHBOURS, num_threads=1
        )
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


def _from_start(pair: ScanPair, start: Pose, kind: Kind) -> Answer:
    clouds = cloud_pair(pair)
    matrix, share = refine(clouds, clouds.matrix_of(start), kind)
    return Answer(i_from_j=clouds.pose_of(matrix), score=share)
