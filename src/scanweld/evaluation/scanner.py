"""A virtual range scanner: what a sensor would have measured of a mesh."""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseModel:
    """What a sensor does to depth. The default does nothing.

    Attributes:
        depth_diameters: Standard deviation of the depth of a surface that faces the sensor, in
            diameters of the object; it grows with 1 / cos(incidence).
        max_growth: The growth stops at this factor.
        dropout: Share of pixels that are lost, anywhere.
        grazing_dropout: Share that is lost besides where the surface is edge-on to the ray; it
            falls off with (1 - cos(incidence))^2.
        quantum_diameters: Step of the stored depth, in diameters of the object; 0 for none.
    """

    depth_diameters: float = 0.0
    max_growth: float = 5.0
    dropout: float = 0.0
    grazing_dropout: float = 0.0
    quantum_diameters: float = 0.0

    def __post_init__(self) -> None:
        if min(self.depth_diameters, self.quantum_diameters) < 0 or self.max_growth < 1:
            raise ValueError("noise is never negative, and its growth at least 1")
        if not (0 <= self.dropout < 1 and 0 <= self.grazing_dropout <= 1):
            raise ValueError("dropouts are shares, from 0 to 1")


def scan_mesh(
    mesh: TriangleMesh,
    camera: Camera,
    world_from_sensor: Pose,
    noise: NoiseModel | None = None,
    seed: int = 0,
    *,
    scan_from_sensor: Pose | None = None,
    name: str = "scan",
) -> RangeScan:
    """Scan a mesh with a pinhole or orthographic camera.

    Args:
        mesh: The object, in the world frame, faces counter-clockwise seen from outside.
        camera: Pinhole or orthographic.
        world_from_sensor: Where the sensor stands.
        noise: What the sensor does to depth; nothing if not given.
        seed: Of the noise.
        scan_from_sensor: The frame that the points are given in; the sensor's if not given.
        name: Of the scan.

    Returns:
        The scan with its grid, camera and viewpoint, colours interpolated from the mesh.
        ``world_from_sensor @ scan_from_sensor.inverse()`` is its true pose.

    Raises:
        ValueError: If the camera is spherical, or sees nothing of the mesh.
    """
    noise = noise or NoiseModel()
    scan_from_sensor = scan_from_sensor or Pose.identity()
    vertices = world_from_sensor.inverse().apply(mesh.vertices)
    depth, face_of = render_depth(vertices, mesh.faces, camera)
    if not (face_of >= 0).any():
        raise ValueError(f"{name}: the camera sees nothing of the mesh")
    hits = camera.unproject_image(depth)
    cosine = _cosine_of_incidence(vertices, mesh.faces, camera, hits, face_of)
    rng = np.random.default_rng(seed)
    kept = (face_of >= 0) & ~_dropped(noise, cosine, rng)
    measured = _disturbed(noise, depth, cosine, principal_diameter(mesh.vertices), rng)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[kept] = np.arange(kept.sum())
    colors = None
    if mesh.colors is not None:
        colors = _interpolated(mesh.colors, vertices, mesh.faces, hits[kept], face_of[kept])
    return RangeScan(
        name=name,
        points=scan_from_sensor.apply(camera.unproject_image(measured)[kept]),
        grid=grid,
        colors=colors,
        camera=camera,
        scan_from_sensor=scan_from_sensor,
        viewpoint=Viewpoint.GIVEN,
    )


def _cosine_of_incidence(
    vertices: FloatArray, faces: IntArray, camera: Camera, hits: FloatArray, face_of: IntArray
) -> FloatArray:
    """Cosine (H, W) between a pixel's ray and the normal of the face that it hit, 1 elsewhere."""
    seen = face_of >= 0
    normals = face_normals(vertices, faces[face_of[seen]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine = np.ones(face_of.shape)
    cosine[seen] = np.abs(np.einsum("nk,nk->n", normals, camera.view_directions(hits[seen])))
    return cosine


def _dropped(noise: NoiseModel, cosine: FloatArray, rng: np.random.Generator) -> BoolArray:
    chance = noise.dropout + noise.grazing_dropout * (1.0 - cosine) ** 2
    return rng.random(cosine.shape) < chance


def _disturbed(
    noise: NoiseModel,
    depth: FloatArray,
    cosine: FloatArray,
    diameter: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Depth with noise and in steps; untouched where the model says so."""
    growth = 1.0 / np.maximum(cosine, 1.0 / noise.max_growth)
    sigma = noise.depth_diameters * diameter * growth
    disturbed = depth + sigma * rng.normal(size=depth.shape)
    step = noise.quantum_diameters * diameter
    return step * np.round(disturbed / step) if step > 0 else disturbed


def _interpolated(
    colors: ByteArray, vertices: FloatArray, faces: IntArray, hits: FloatArray, face_of: IntArray
) -> ByteArray:
    """Vertex colours (N, 3) at points (N, 3) on faces (N,), by areas of the opposite triangles."""
    corners = vertices[faces[face_of]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    blended = np.zeros((len(hits), 3))
    for k in range(3):
        b, c = corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        part = np.einsum("nk,nk->n", np.cross(b - hits, c - hits), normal)
        weight = part / np.einsum("nk,nk->n", normal, normal)
        blended += weight[:, None] * colors[faces[face_of, k]]
    return np.clip(np.rint(blended), 0, 255).astype(np.uint8)
