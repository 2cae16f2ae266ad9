"""Cameras around an object, and how much of its surface two of them share."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import principal_diameter

Axis = Literal["x", "y", "z"]

_MARGIN_PIXELS = 4
"""Empty pixels around the object in a view's image."""


@dataclass(frozen=True, kw_only=True, slots=True)
class View:
    """A camera and where it stands in the object's frame."""

    camera: Camera
    world_from_sensor: Pose


def view_of(
    mesh: TriangleMesh,
    azimuth_deg: float,
    elevation_deg: float = 0.0,
    roll_deg: float = 0.0,
    *,
    pixels: float = 300.0,
    model: CameraModel = CameraModel.PINHOLE,
    up: Axis = "z",
) -> View:
    """A camera that looks at the middle of an object from three diameters away, all of it in view.

    Args:
        mesh: The object.
        azimuth_deg: Turn of the camera about the up axis.
        elevation_deg: Angle of the camera above the plane across the up axis.
        roll_deg: Turn about the viewing axis; 0 keeps up at the top of the image.
        pixels: Pixels across the object's diameter, at the distance of its middle.
        model: Pinhole or orthographic.
        up: The axis of the object's frame about which the azimuth turns.
    """
    axes = camera_axes(azimuth_deg, elevation_deg, roll_deg, up)
    return view_along(mesh, axes, pixels=pixels, model=model)


def view_along(
    mesh: TriangleMesh,
    axes: FloatArray,
    *,
    pixels: float = 300.0,
    model: CameraModel = CameraModel.PINHOLE,
    distance_diameters: float = 3.0,
) -> View:
    """A camera with given axes that looks at the middle of an object, with all of it in view.

    Args:
        mesh: The object.
        axes: (3, 3), columns are the camera's x (right), y (down) and z (away) in the object's
            frame.
        pixels: Pixels across the object's diameter, at the distance of its middle.
        model: Pinhole or orthographic.
        distance_diameters: From the middle of the object to the sensor.

    Raises:
        ValueError: If the sensor would stand inside the object.
    """
    diameter = principal_diameter(mesh.vertices)
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    distance = distance_diameters * diameter
    pose = Pose(rotation=axes, translation=middle - distance * axes[:, 2])
    focal = pixels / diameter * (distance if model is CameraModel.PINHOLE else 1.0)
    centred = Camera(model=model, width=1, height=1, fx=focal, fy=focal, cx=0.0, cy=0.0)
    seen, _ = centred.project(pose.inverse().apply(mesh.vertices))
    if not np.isfinite(seen).all():
        raise ValueError("the sensor stands inside the object: give a larger distance")
    half = int(np.ceil(np.abs(seen).max())) + _MARGIN_PIXELS
    size, centre = 2 * half + 1, float(half)
    camera = Camera(model=model, width=size, height=size, fx=focal, fy=focal, cx=centre, cy=centre)
    return View(camera=camera, world_from_sensor=pose)


def overlap(mesh: TriangleMesh, i: View, j: View) -> float:
    """The smaller of the two shares of one view's visible surface that the other one sees too."""
    return min(seen_share(mesh, i, j), seen_share(mesh, j, i))


def seen_share(mesh: TriangleMesh, i: View, j: View) -> float:
    """Share, by area, of the surface seen by view i that view j sees too.

    Every pixel of i is a sample of the surface, weighted with the area it stands for. It is seen
    by j where it faces j and lies, to within a pixel's footprint, on the surface that j has there.
    """
    points, normals, areas = _surface_of(mesh, i)
    if not len(points):
        return 0.0
    depth, face_of = _render(mesh, j)
    j_from_world = j.world_from_sensor.inverse()
    local, facing = j_from_world.apply(points), j_from_world.turn(normals)
    pixels, z = j.camera.project(local)
    column, row = np.rint(pixels).astype(np.int64).T
    inside = (column >= 0) & (column < j.camera.width) & (row >= 0) & (row < j.camera.height)
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    surface = j.camera.unproject(np.stack([column, row], axis=-1), depth[row, column])
    plane = _unit_normals(mesh)[face_of[row, column]] @ j_from_world.rotation.T
    away = np.abs(np.einsum("nk,nk->n", plane, local - surface))
    footprint = j.camera.footprint(float(np.median(z)))
    towards = np.einsum("nk,nk->n", facing, j.camera.view_directions(local)) < 0
    seen = inside & towards & (face_of[row, column] >= 0) & (away < footprint)
    return float(areas[seen].sum() / areas.sum())


def camera_axes(
    azimuth_deg: float, elevation_deg: float, roll_deg: float, up: Axis = "z"
) -> FloatArray:
    """Axes (columns x right, y down, z away) of a camera in the object's frame; see ``view_of``."""
    azimuth, elevation, roll = np.radians([azimuth_deg, elevation_deg, roll_deg])
    flat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    top = np.array([0.0, 0.0, 1.0])
    away = -(np.cos(elevation) * flat + np.sin(elevation) * top)
    down = np.sin(elevation) * flat - np.cos(elevation) * top
    right = np.cross(down, away)
    x = np.cos(roll) * right + np.sin(roll) * down
    y = np.cos(roll) * down - np.sin(roll) * right
    shift = {"z": 0, "x": 1, "y": 2}[up]
    return np.roll(np.stack([x, y, away], axis=1), shift, axis=0)


def _render(mesh: TriangleMesh, view: View) -> tuple[FloatArray, IntArray]:
    vertices = view.world_from_sensor.inverse().apply(mesh.vertices)
    return render_depth(vertices, mesh.faces, view.camera)


def _unit_normals(mesh: TriangleMesh) -> FloatArray:
    normals = face_normals(mesh.vertices, mesh.faces)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def _surface_of(mesh: TriangleMesh, view: View) -> tuple[FloatArray, FloatArray, FloatArray]:
    """World points, normals and areas of a view's surface pixels that are not on edge."""
    depth, face_of = _render(mesh, view)
    seen = face_of >= 0
    local = view.camera.unproject_image(depth)[seen]
    normals = _unit_normals(mesh)[face_of[seen]]
    directions = view.camera.view_directions(local)
    cosine = -np.einsum("nk,nk->n", view.world_from_sensor.inverse().turn(normals), directions)
    scale = depth[seen] if view.camera.model is CameraModel.PINHOLE else np.ones(len(local))
    areas = scale**2 / np.maximum(cosine, 0.05)
    facing = cosine > 0
    points = view.world_from_sensor.apply(local)
    return points[facing], normals[facing], areas[facing]
