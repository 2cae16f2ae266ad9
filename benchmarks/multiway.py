"""Open3D's multiway registration of a folder of scans: poses, and CPU seconds without reading.

    python -m benchmarks.multiway SCANS TOLD.json

FPFH, RANSAC and ICP of every pair, with the settings of the paper's comparison. The pairs with the
most matches make a tree that is taken for certain; all others are closures of loops that the
global optimisation may prune.
"""

import json
import sys
import time
from itertools import combinations
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.paper.baselines import fpfh
from benchmarks.results import write_file
from benchmarks.study.optional import need
from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.scan import principal_diameter
from scanweld.io import read_scan

LIKELY_CLOSURE = 0.25
"""Open3D prunes closures that are less likely than this, the value of its tutorial."""


def main() -> int:
    """Write poses and CPU seconds, or why there are none."""
    folder, out = map(Path, sys.argv[1:])
    try:
        told = multiway(need("open3d"), folder)
    except InputError as error:
        told = {"error": str(error)}
    write_file(out, json.dumps(told))
    return 0


def multiway(o3d: ModuleType, folder: Path) -> dict[str, Any]:
    """Poses of all scans of a folder, and what they cost."""
    o3d.utility.random.seed(0)
    scans = [read_scan(path) for path in sorted(folder.glob("*.ply"))]
    start = time.process_time()
    voxel = fpfh.VOXEL * median(principal_diameter(scan.points) for scan in scans)
    clouds = [_described(o3d, scan.points, voxel) for scan in scans]
    edges = {
        (i, j): _pairwise(o3d, clouds[i], clouds[j], fpfh.MATCH_VOXELS * voxel)
        for i, j in combinations(range(len(scans)), 2)
    }
    registration = o3d.pipelines.registration
    graph, world = registration.PoseGraph(), {0: np.eye(4)}
    tree = set()
    while len(world) < len(scans):
        # The strongest pair from what is placed to what is not, after Prim.
        i, j = max(
            (edge for edge in edges if (edge[0] in world) != (edge[1] in world)),
            key=lambda edge: edges[edge][1][5, 5],
        )
        tree.add((i, j))
        if i in world:
            world[j] = world[i] @ np.linalg.inv(edges[i, j][0])
        else:
            world[i] = world[j] @ edges[i, j][0]
    for k in range(len(scans)):
        graph.nodes.append(registration.PoseGraphNode(world[k]))
    for (i, j), (j_from_i, information) in edges.items():
        graph.edges.append(
            registration.PoseGraphEdge(i, j, j_from_i, information, uncertain=(i, j) not in tree)
        )
    registration.global_optimization(
        graph,
        registration.GlobalOptimizationLevenbergMarquardt(),
        registration.GlobalOptimizationConvergenceCriteria(),
        registration.GlobalOptimizationOption(
            max_correspondence_distance=fpfh.MATCH_VOXELS * voxel,
            edge_prune_threshold=LIKELY_CLOSURE,
            reference_node=0,
        ),
    )
    poses = {s.name: n.pose.tolist() for s, n in zip(scans, graph.nodes, strict=True)}
    return {"cpu": time.process_time() - start, "poses": poses}


def _described(o3d: ModuleType, points: FloatArray, voxel: float) -> fpfh.Described:
    """A thinned cloud with normals, and its features."""
    cloud = fpfh.thinned(o3d, points, voxel)
    cloud.orient_normals_to_align_with_direction([0.0, 0.0, 1.0])  # the sensors look along -z
    return cloud, fpfh.features(o3d, cloud, voxel)


def _pairwise(
    o3d: ModuleType, i: fpfh.Described, j: fpfh.Described, reach: float
) -> tuple[FloatArray, FloatArray]:
    """j_from_i by FPFH, RANSAC and ICP, and its information."""
    matrix = fpfh.icp(o3d, j[0], i[0], reach, fpfh.ransac(o3d, j, i, reach)).transformation
    information = o3d.pipelines.registration.get_information_matrix_from_point_clouds
    return matrix, information(i[0], j[0], reach, matrix)


if __name__ == "__main__":
    sys.exit(main())
