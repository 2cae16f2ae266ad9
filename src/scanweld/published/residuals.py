"""What contour coherence minimises: distances of matched contours in space and in the image."""

from collections.abc import Mapping

import numpy as np

from scanweld.contours.coherence import outline_matches
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.published.contour_links import ContourLink, LinkMatches
from scanweld.published.joint_solve import Pulls


def point_pulls(matches: LinkMatches, poses: Mapping[int, Pose]) -> Pulls:
    """Distances in 3D (MM-ICC): three residuals a match, along the axes of the world."""
    link = matches.link
    points = poses[link.i].apply(matches.points)
    apart = points - poses[link.j].apply(link.pair.observed.points[matches.observed])
    return Pulls(
        i=link.i,
        j=link.j,
        points=np.repeat(points, 3, axis=0),
        directions=np.tile(np.eye(3), (len(points), 1)),
        residuals=apart.ravel(),
    )


def image_pulls(matches: LinkMatches, poses: Mapping[int, Pose]) -> Pulls:
    """Distances in the image of camera j, in pixels (M-ICC): two residuals a match."""
    link = matches.link
    world = poses[link.i].apply(matches.points)
    local = poses[link.j].inverse().apply(world)
    pixels, _ = link.camera.project(local)
    by_place = _projection_jacobian(link.camera, local)
    return Pulls(
        i=link.i,
        j=link.j,
        points=np.repeat(world, 2, axis=0),
        directions=poses[link.j].turn(by_place.reshape(-1, 3)),
        residuals=(pixels - link.pair.observed.pixels[matches.observed]).ravel(),
    )


def outline_pulls(link: ContourLink, poses: Mapping[int, Pose], radius: float) -> Pulls:
    """Distances across the outline in the image, at the poses at which the link was rendered."""
    matches = outline_matches(link.pair, link.camera, radius)
    return Pulls(
        i=link.i,
        j=link.j,
        points=poses[link.j].apply(matches.points),
        directions=poses[link.j].turn(matches.directions),
        residuals=matches.residuals,
    )


def _projection_jacobian(camera: Camera, points: FloatArray) -> FloatArray:
    """Change (N, 2, 3) of the pixels (u, v) of points (N, 3) by their place, sensor frame."""
    by_place = np.zeros((len(points), 2, 3))
    if camera.model is CameraModel.ORTHOGRAPHIC:
        by_place[:, 0, 0], by_place[:, 1, 1] = camera.fx, camera.fy
        return by_place
    x, y, z = points.T
    by_place[:, 0, 0], by_place[:, 1, 1] = camera.fx / z, camera.fy / z
    by_place[:, 0, 2], by_place[:, 1, 2] = -camera.fx * x / z**2, -camera.fy * y / z**2
    return by_place
