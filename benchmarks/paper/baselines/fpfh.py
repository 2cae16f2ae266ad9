"""FPFH features of Open3D with RANSAC or fast global registration, refined by ICP."""

import os
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


def fpfh_ransac(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """FPFH (Rusu et al. 2009), RANSAC over mutual matches, ICP; its score is the ICP's fitness."""
    library = _open3d(seed)
    registration = library.pipelines.registration
    clouds, reach = cloud_pair(pair), MATCH_VOXELS * VOXEL
    (i, features_i), (j, features_j) = (_described(clouds, k, library) for k in (0, 1))
    found = registration.registration_ransac_based_on_feature_matching(
        *(j, i, features_j, features_i),
        mutual_filter=True,
        max_correspondence_distance=reach,
        estimation_method=registration.TransformationEstimationPointToPoint(False),
        ransac_n=3,
        checkers=[
            registration.CorrespondenceCheckerBasedOnEdgeLength(EDGE_RATIO),
            registration.CorrespondenceCheckerBasedOnDistance(reach),
        ],
        criteria=registration.RANSACConvergenceCriteria(NUM_ITERATIONS, CONFIDENCE),
    )
    return _refined(clouds, found.transformation, library)


def fgr(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """FPFH, fast global registration (Zhou et al. 2016), ICP; its score is the ICP's fitness."""
    library = _open3d(seed)
    registration = library.pipelines.registration
    clouds = cloud_pair(pair)
    (i, features_i), (j, features_j) = (_described(clouds, k, library) for k in (0, 1))
    found = registration.registration_fgr_based_on_feature_matching(
        *(j, i, features_j, features_i),
        registration.FastGlobalRegistrationOption(
            use_absolute_scale=True,
            maximum_correspondence_distance=MATCH_VOXELS * VOXEL,
            maximum_tuple_count=FGR_NUM_TUPLES,
        ),
    )
    return _refined(clouds, found.transformation, library)


def fpfh(points: FloatArray, normals: FloatArray | None, at: FloatArray) -> FloatArray:
    """FPFH (M, 33) of a surface (N, 3), in diameters, at the nearest voxels to points (M, 3)."""
    library = need("open3d")
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector(points))
    cloud.normals = library.utility.Vector3dVector(np.array(normals))
    cloud = cloud.voxel_down_sample(VOXEL)
    _, nearest = KDTree(np.asarray(cloud.points)).query(at)
    return np.asarray(_features(cloud, library).data).T[nearest]


def _open3d(seed: int) -> ModuleType:
    """Open3D on one thread: with more its RANSAC is not repeatable, whatever the seed."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    library = need("open3d")
    library.utility.set_verbosity_level(library.utility.VerbosityLevel.Error)
    library.utility.random.seed(seed)
    return library


def _cloud(clouds: CloudPair, k: int, voxel: float, library: ModuleType) -> Any:
    """One of the clouds, thinned, with normals towards the sensor."""
    made = library.geometry.PointCloud(library.utility.Vector3dVector(clouds.points[k]))
    made = made.voxel_down_sample(voxel)
    made.estimate_normals(
        library.geometry.KDTreeSearchParamHybrid(radius=NORMAL_VOXELS * voxel, max_nn=30)
    )
    made.orient_normals_towards_camera_location(-clouds.middles[k] / clouds.diameter)
    return made


def _features(cloud: Any, library: ModuleType) -> Any:
    around = library.geometry.KDTreeSearchParamHybrid(radius=FEATURE_VOXELS * VOXEL, max_nn=100)
    return library.pipelines.registration.compute_fpfh_feature(cloud, around)


def _described(clouds: CloudPair, k: int, library: ModuleType) -> tuple[Any, Any]:
    thinned = _cloud(clouds, k, VOXEL, library)
    return thinned, _features(thinned, library)


def _refined(clouds: CloudPair, matrix: FloatArray, library: ModuleType) -> Answer:
    registration = library.pipelines.registration
    if np.array_equal(matrix, np.eye(4)):
        return Answer(i_from_j=None, score=0.0, reason="no sample of matches fits")
    fitness = 0.0
    for voxel, reach in ICP_LEVELS:
        i, j = (_cloud(clouds, k, voxel, library) for k in (0, 1))
        found = registration.registration_icp(
            *(j, i, reach, matrix),
            registration.TransformationEstimationPointToPlane(),
            registration.ICPConvergenceCriteria(max_iteration=ICP_ITERATIONS),
        )
        matrix, fitness = found.transformation, found.fitness
    return Answer(i_from_j=clouds.pose_of(matrix), score=fitness)
