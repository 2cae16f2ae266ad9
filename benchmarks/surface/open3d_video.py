"""Open3D's way from frames of a video to a mesh, as its reconstruction system goes it.

Each frame is laid onto the one before, every tenth onto others that it may share its view with; a
pose graph is optimised over all that, and the depths are integrated (Choi, Zhou & Koltun 2015). It
has no colours here, so its odometry is the one from points to planes.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from benchmarks.study.optional import need
from benchmarks.surface.open3d_fusion import MAX_BLOCKS, TRUNCATION_VOXELS, converted
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh

EVERY = 10
"""Frames from one that is laid onto others far away to the next."""
LEAST_FITNESS, MAX_APART = 0.3, 0.07
"""Share of a frame that must lie on another, and metres up to which it does; as Open3D has them."""
FAR = 10.0
"""Metres beyond which Open3D ignores depths."""
WIDE_DEG = 40.0
"""Angle between two cameras above which they are not tried."""


def reconstructed(
    depths: Sequence[FloatArray], camera: Camera, voxel: float
) -> tuple[TriangleMesh, list[FloatArray]]:
    """The mesh in the frame of the first camera, and world_from_camera (4, 4) of each frame.

    Args:
        depths: (H, W) in metres, NaN for none, in the order of time.
        camera: Of all.
        voxel: Edge of the grid's cells in metres.
    """
    o3d = need("open3d")
    c, core = camera, o3d.core
    lens = core.Tensor(np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1.0]]))
    images = [o3d.t.geometry.Image(np.nan_to_num(d).astype(np.float32)) for d in depths]
    graph = _pose_graph(o3d, images, lens)
    how = o3d.pipelines.registration
    how.global_optimization(
        graph,
        how.GlobalOptimizationLevenbergMarquardt(),
        how.GlobalOptimizationConvergenceCriteria(),
        how.GlobalOptimizationOption(
            max_correspondence_distance=MAX_APART,
            edge_prune_threshold=0.25,
            preference_loop_closure=0.1,
            reference_node=0,
        ),
    )
    poses = [np.asarray(node.pose) for node in graph.nodes]
    kinds = (("tsdf", "weight"), (core.float32, core.float32), ((1), (1)))
    grid = o3d.t.geometry.VoxelBlockGrid(*kinds, voxel, block_resolution=8, block_count=MAX_BLOCKS)
    for image, pose in zip(images, poses, strict=True):
        seen = (image, lens, core.Tensor(np.linalg.inv(pose)), 1.0, FAR, TRUNCATION_VOXELS)
        grid.integrate(grid.compute_unique_block_coordinates(*seen), *seen)
    return converted(grid.extract_triangle_mesh(weight_threshold=3.0).to_legacy()), poses


def _pose_graph(o3d: Any, images: Sequence[Any], lens: Any) -> Any:
    """Frames as nodes; each is bound to the one before, every tenth to those of like view."""
    how, graph, poses = o3d.pipelines.registration, None, [np.eye(4)]
    graph = how.PoseGraph()
    graph.nodes.append(how.PoseGraphNode(poses[0]))
    for k in range(1, len(images)):
        before_from_now, _, information = _laid(o3d, images[k], images[k - 1], lens, np.eye(4))
        poses.append(poses[-1] @ before_from_now)
        graph.nodes.append(how.PoseGraphNode(poses[-1]))
        edge = how.PoseGraphEdge(k, k - 1, before_from_now, information, uncertain=False)
        graph.edges.append(edge)
    for a, b in combinations(range(0, len(images), EVERY), 2):
        about = np.linalg.inv(poses[a]) @ poses[b]
        if about[:3, :3].trace() < 1 + 2 * np.cos(np.radians(WIDE_DEG)):
            continue
        a_from_b, fitness, information = _laid(o3d, images[b], images[a], lens, about)
        if fitness >= LEAST_FITNESS:
            graph.edges.append(how.PoseGraphEdge(b, a, a_from_b, information, uncertain=True))
    return graph


def _laid(
    o3d: Any, source: Any, target: Any, lens: Any, start: FloatArray
) -> tuple[FloatArray, float, FloatArray]:
    """target_from_source (4, 4), the share of the source that lies on it, information (6, 6)."""
    odometry, geometry = o3d.t.pipelines.odometry, o3d.t.geometry
    blank = geometry.Image(np.zeros((source.rows, source.columns, 3), np.float32))
    found = odometry.rgbd_odometry_multi_scale(
        geometry.RGBDImage(blank, source),
        geometry.RGBDImage(blank, target),
        lens,
        o3d.core.Tensor(start),
        1.0,
        FAR,
        method=odometry.Method.PointToPlane,
    )
    pose = found.transformation
    information = odometry.compute_odometry_information_matrix(
        source, target, lens, pose, MAX_APART, 1.0, FAR
    )
    return pose.numpy(), float(found.fitness), information.numpy()
