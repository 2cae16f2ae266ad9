"""Open3D's ways from posed range images to a mesh, given the same scans, poses and voxels."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.study.optional import need
from scanweld.config import PrepareConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.rasterize import render_depth
from scanweld.preparation.prepare import surface_points
from scanweld.preparation.range_image import render_surface

TRUNCATION_VOXELS = 4.0
MAX_BLOCKS = 100_000
FAR_DIAMETERS = 20.0
"""An orthographic sensor is a pinhole so far away."""
POISSON_REACH_VOXELS = 2.0
"""Poisson's surface closes everything; what lies farther from all points is cut off."""


class Shape(NamedTuple):
    """A scan's surface at full resolution, as image and as mesh with normals, sensor frame."""

    camera: Camera
    depth: FloatArray
    mesh: TriangleMesh
    world_from_sensor: Pose

    @property
    def world_points(self) -> FloatArray:
        """(N, 3)."""
        return self.world_from_sensor.apply(self.mesh.vertices)


def shape_of(scan: PreparedScan, world_from_sensor: Pose) -> Shape:
    """A scan's surface, one pixel a point."""
    kept, points = surface_points(scan)
    pixel = scan.resolution
    camera, depth, mesh = render_surface(kept, points, pixel, pixel, 2.0 * pixel, PrepareConfig())
    return Shape(camera, depth, mesh, world_from_sensor)


def tsdf(shapes: Sequence[Shape], voxel: float) -> TriangleMesh:
    """Open3D's truncated signed distances, in its grid of voxel blocks; one scan is enough."""
    library = need("open3d")
    core, geometry = library.core, library.t.geometry
    kinds = (("tsdf", "weight"), (core.float32, core.float32), ((1), (1)))
    grid = geometry.VoxelBlockGrid(*kinds, voxel, block_resolution=8, block_count=MAX_BLOCKS)
    for shape in shapes:
        seen = _as_pinhole(shape)
        c = seen.camera
        depth = np.where(np.isfinite(seen.depth), seen.depth, 0.0).astype(np.float32)
        lens = core.Tensor(np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1.0]]))
        pose = core.Tensor(seen.world_from_sensor.inverse().matrix())
        image = geometry.Image(depth)
        how = (image, lens, pose, 1.0, 2.0 * float(depth.max()), TRUNCATION_VOXELS)
        grid.integrate(grid.compute_unique_block_coordinates(*how), *how)
    return converted(grid.extract_triangle_mesh(weight_threshold=0.0).to_legacy())


def poisson(shapes: Sequence[Shape], voxel: float) -> TriangleMesh:
    """Open3D's screened Poisson reconstruction, cut off where there are no points."""
    o3d = need("open3d")
    points = np.concatenate([shape.world_points for shape in shapes])
    normals = [s.world_from_sensor.turn(np.asarray(s.mesh.normals)) for s in shapes]
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(np.concatenate(normals))
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud, depth=0, width=voxel, n_threads=1
    )
    apart = o3d.geometry.PointCloud(mesh.vertices).compute_point_cloud_distance(cloud)
    mesh.remove_vertices_by_mask(np.asarray(apart) > POISSON_REACH_VOXELS * voxel)
    return converted(mesh)


def _as_pinhole(shape: Shape) -> Shape:
    """The same surface as a pinhole sees it; from far away, if the sensor is none."""
    if shape.camera.model is CameraModel.PINHOLE:
        return shape
    points = shape.mesh.vertices
    far = FAR_DIAMETERS * float(np.linalg.norm(np.ptp(points, axis=0)))
    back = np.array([0.0, 0.0, far - float(np.median(points[:, 2]))])
    c = shape.camera
    camera = replace(c, model=CameraModel.PINHOLE, fx=far * c.fx, fy=far * c.fy)
    depth, _ = render_depth(points + back, shape.mesh.faces, camera)
    moved = shape.world_from_sensor @ Pose(rotation=np.eye(3), translation=-back)
    return shape._replace(camera=camera, depth=depth, world_from_sensor=moved)


def converted(mesh: Any) -> TriangleMesh:
    """A mesh of Open3D as one of ours, every vertex once."""
    mesh.remove_duplicated_vertices()
    mesh.remove_unreferenced_vertices()
    return TriangleMesh(vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.triangles))
