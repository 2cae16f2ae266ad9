"""FPFH features of Open3D with RANSAC or fast global registration, refined by ICP."""

import os
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from benchmarks.paper.baselines.records import Answer, CloudPair, ScanPair, cloud_pair
from benchmarks.study.optional import need
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose

VOXEL = 0.01
"""In diameters; 0.015 takes less than half the time and finds fewer pairs from 90 degrees on."""
NORMAL_VOXELS = 2.0
FEATURE_VOXELS = 5.0
"""Radii of normals and features, as in the library's tutorial."""
MATCH_VOXELS = 1.5
"""Farthest inlier, likewise; nearer matches find no other pairs by FGR."""
NUM_ITERATIONS = 200_000
CONFIDENCE = 0.999
EDGE_RATIO = 0.9
FGR_NUM_TUPLES = 1000
"""The library's default; more find no other pairs."""
ICP_LEVELS = ((0.015, 0.03), (0.005, 0.01))
"""Voxel and farthest match of each level of the final point-to-plane ICP, in diameters."""
ICP_ITERATIONS = 50
Described = tuple[Any, Any]
"""A cloud of Open3D and its features."""


def fpfh_ransac(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """FPFH (Rusu et al. 2009), RANSAC over mutual matches, ICP; its score is the ICP's fitness."""
    library, clouds = open3d(seed), cloud_pair(pair)
    i, j = _described(library, clouds)
    matrix = ransac(library, i, j, MATCH_VOXELS * VOXEL)
    return _refined(library, clouds, matrix)


def fgr(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """FPFH, fast global registration (Zhou et al. 2016), ICP; its score is the ICP's fitness."""
    library, clouds = open3d(seed), cloud_pair(pair)
    registration = library.pipelines.registration
    i, j = _described(library, clouds)
    found = registration.registration_fgr_based_on_feature_matching(
        *(j[0], i[0], j[1], i[1]),
        registration.FastGlobalRegistrationOption(
            use_absolute_scale=True,
            maximum_correspondence_distance=MATCH_VOXELS * VOXEL,
            maximum_tuple_count=FGR_NUM_TUPLES,
        ),
    )
    return _refined(library, clouds, found.transformation)


def fpfh(points: FloatArray, normals: FloatArray | None, at: FloatArray) -> FloatArray:
    """FPFH (M, 33) of a surface (N, 3), in diameters, at the nearest voxels to points (M, 3)."""
    library = need("open3d")
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector(points))
    cloud.normals = library.utility.Vector3dVector(np.array(normals))
    cloud = cloud.voxel_down_sample(VOXEL)
    _, nearest = KDTree(np.asarray(cloud.points)).query(at)
    return np.asarray(features(library, cloud, VOXEL).data).T[nearest]


def open3d(seed: int) -> ModuleType:
    """Open3D on one thread: with more its RANSAC is not repeatable, whatever the seed."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    library = need("open3d")
    library.utility.set_verbosity_level(library.utility.VerbosityLevel.Error)
    library.utility.random.seed(seed)
    return library


def thinned(library: ModuleType, points: FloatArray, voxel: float) -> Any:
    """A cloud of Open3D with a point a voxel, and normals of either side."""
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector(np.array(points)))
    cloud, near = cloud.voxel_down_sample(voxel), library.geometry.KDTreeSearchParamHybrid
    cloud.estimate_normals(near(radius=NORMAL_VOXELS * voxel, max_nn=30))
    return cloud


def features(library: ModuleType, cloud: Any, voxel: float) -> Any:
    """FPFH of a thinned cloud."""
    near = library.geometry.KDTreeSearchParamHybrid(radius=FEATURE_VOXELS * voxel, max_nn=100)
    return library.pipelines.registration.compute_fpfh_feature(cloud, near)


def ransac(library: ModuleType, to: Described, moving: Described, reach: float) -> FloatArray:
    """The (4, 4) matrix that most mutual matches of features agree on."""
    registration = library.pipelines.registration
    return registration.registration_ransac_based_on_feature_matching(
        *(moving[0], to[0], moving[1], to[1]),
        mutual_filter=True,
        max_correspondence_distance=reach,
        estimation_method=registration.TransformationEstimationPointToPoint(False),
        ransac_n=3,
        checkers=[
            registration.CorrespondenceCheckerBasedOnEdgeLength(EDGE_RATIO),
            registration.CorrespondenceCheckerBasedOnDistance(reach),
        ],
        criteria=registration.RANSACConvergenceCriteria(NUM_ITERATIONS, CONFIDENCE),
    ).transformation


def icp(
    library: ModuleType, to: Any, moving: Any, reach: float, matrix: FloatArray, **how: Any
) -> Any:
    """What point-to-plane ICP makes of two clouds with normals, from a (4, 4) matrix."""
    registration = library.pipelines.registration
    plane = registration.TransformationEstimationPointToPlane()
    return registration.registration_icp(moving, to, reach, matrix, plane, **how)


def _clouds(library: ModuleType, clouds: CloudPair, voxel: float) -> list[Any]:
    """Both clouds, thinned, with normals towards the sensors."""
    made = [thinned(library, points, voxel) for points in clouds.points]
    for cloud, middle in zip(made, clouds.middles, strict=True):
        cloud.orient_normals_towards_camera_location(-middle / clouds.diameter)
    return made


def _described(library: ModuleType, clouds: CloudPair) -> Sequence[Described]:
    both = _clouds(library, clouds, VOXEL)
    return [(cloud, features(library, cloud, VOXEL)) for cloud in both]


def _refined(library: ModuleType, clouds: CloudPair, matrix: FloatArray) -> Answer:
    if np.array_equal(matrix, np.eye(4)):
        return Answer(i_from_j=None, score=0.0, reason="no sample of matches fits")
    fitness = 0.0
    steps = library.pipelines.registration.ICPConvergenceCriteria(max_iteration=ICP_ITERATIONS)
    for voxel, reach in ICP_LEVELS:
        i, j = _clouds(library, clouds, voxel)
        found = icp(library, i, j, reach, matrix, criteria=steps)
        matrix, fitness = found.transformation, found.fitness
    return Answer(i_from_j=clouds.pose_of(matrix), score=fitness)
