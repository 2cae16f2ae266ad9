"""FPFH features of Open3D with RANSAC or fast global registration, refined by ICP."""

import os
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.paper.baselines.clouds import Cloud, CloudPair, cloud_pair
from benchmarks.paper.baselines.records import Answer, ScanPair
from benchmarks.paper.optional import need
from scanweld.geometry.pose import Pose

VOXEL = 0.01
"""In diameters; 0.015 takes less than half the time and finds fewer pairs from 90 degrees on."""
NORMAL_VOXELS = 2.0
FEATURE_VOXELS = 5.0
"""Radii of normals and features, as in the library's tutorial."""
MATCH_VOXELS = 1.5
"""Farthest inlier, likewise."""
NUM_ITERATIONS = 200_000
CONFIDENCE = 0.999
EDGE_RATIO = 0.9
FGR_MATCH_VOXELS = 1.5
FGR_NUM_TUPLES = 1000
"""The library's default; neither more tuples nor nearer matches find other pairs."""
ICP_LEVELS = ((0.015, 0.03), (0.005, 0.01))
"""Voxel and farthest match of each level of the final point-to-plane ICP, in diameters."""
ICP_ITERATIONS = 50


def fpfh_ransac(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """FPFH (Rusu et al. 2009), RANSAC over mutual matches, ICP; its score is the ICP's fitness."""
    library = _open3d()
    registration = library.pipelines.registration
    clouds = cloud_pair(pair)
    (i, features_i), (j, features_j) = (_described(c, library) for c in (clouds.i, clouds.j))
    reach = MATCH_VOXELS * VOXEL
    library.utility.random.seed(seed)
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
    library = _open3d()
    registration = library.pipelines.registration
    clouds = cloud_pair(pair)
    (i, features_i), (j, features_j) = (_described(c, library) for c in (clouds.i, clouds.j))
    library.utility.random.seed(seed)
    found = registration.registration_fgr_based_on_feature_matching(
        *(j, i, features_j, features_i),
        registration.FastGlobalRegistrationOption(
            use_absolute_scale=True,
            maximum_correspondence_distance=FGR_MATCH_VOXELS * VOXEL,
            maximum_tuple_count=FGR_NUM_TUPLES,
        ),
    )
    return _refined(clouds, found.transformation, library)


def _open3d() -> ModuleType:
    """Open3D on one thread: with more its RANSAC is not repeatable, whatever the seed."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    library = need("open3d")
    library.utility.set_verbosity_level(library.utility.VerbosityLevel.Error)
    return library


def _cloud(cloud: Cloud, voxel: float, library: ModuleType) -> Any:
    """A thinned cloud with normals towards the sensor."""
    made = library.geometry.PointCloud(library.utility.Vector3dVector(cloud.points))
    made = made.voxel_down_sample(voxel)
    made.estimate_normals(
        library.geometry.KDTreeSearchParamHybrid(radius=NORMAL_VOXELS * voxel, max_nn=30)
    )
    made.orient_normals_towards_camera_location(cloud.sensor)
    return made


def _described(cloud: Cloud, library: ModuleType) -> tuple[Any, Any]:
    thinned = _cloud(cloud, VOXEL, library)
    radius = library.geometry.KDTreeSearchParamHybrid(radius=FEATURE_VOXELS * VOXEL, max_nn=100)
    return thinned, library.pipelines.registration.compute_fpfh_feature(thinned, radius)


def _refined(clouds: CloudPair, matrix: np.ndarray, library: ModuleType) -> Answer:
    registration = library.pipelines.registration
    if np.array_equal(matrix, np.eye(4)):
        return Answer(i_from_j=None, score=0.0, reason="no sample of matches fits")
    fitness = 0.0
    for voxel, reach in ICP_LEVELS:
        found = registration.registration_icp(
            *(_cloud(clouds.j, voxel, library), _cloud(clouds.i, voxel, library), reach, matrix),
            registration.TransformationEstimationPointToPlane(),
            registration.ICPConvergenceCriteria(max_iteration=ICP_ITERATIONS),
        )
        matrix, fitness = found.transformation, found.fitness
    return Answer(i_from_j=clouds.pose_of(matrix), score=fitness)
