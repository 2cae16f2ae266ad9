"""The three prunings that leave contours which two views can share (paper eqs 4-6).

All points are in the sensor frame of j, the camera that observes.
"""

import numpy as np
from scipy.spatial import KDTree

from scanweld.contours.contour_sets import ContourPoints, ObservedContours
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose

SAME_PLACE_PIXELS = 1.5
"""Contours no farther apart than this are at the same place: next to each other in the grid."""


def prune_self_occlusion(corners: IntArray, is_border: BoolArray) -> BoolArray:
    """First pruning (eq. 4): keep predicted points that are not where scan i itself ends.

    There the predicted image stops because scan i saw no farther, not because the object does.

    Args:
        corners: (N, 3) vertices of the triangles of scan i on which the points were seen.
        is_border: (V,) vertices on C_i, O_i or the open border.
    """
    return np.logical_not(is_border[corners].any(axis=1))


def prune_same_place(predicted: ContourPoints, i: ObservedContours, j_from_i: Pose) -> BoolArray:
    """First pruning read by place: keep predicted points that lie on no point of C_i or O_i."""
    if not len(i.jumps):
        return np.ones(len(predicted), dtype=bool)
    reach = SAME_PLACE_PIXELS * i.scan.image.pixel
    distances, _ = KDTree(i.jumps).query(
        j_from_i.inverse().apply(predicted.points), distance_upper_bound=reach
    )
    return np.isinf(distances)


def prune_invisible_observed(
    observed: ContourPoints, camera_i: Camera, j_from_i: Pose
) -> BoolArray:
    """Second pruning (eq. 5): keep observed points whose surface looks towards camera i."""
    return _faces_camera(observed.points, observed.normals, camera_i, j_from_i)


def prune_invisible_predicted(predicted: ContourPoints, camera_j: Camera) -> BoolArray:
    """Third pruning (eq. 6): keep predicted points whose surface looks towards camera j.

    The others are the inside of scan i's half shell, seen through its open back.
    """
    return _faces_camera(predicted.points, predicted.normals, camera_j, Pose.identity())


def prune_behind(predicted: ContourPoints, j: ObservedContours) -> BoolArray:
    """Third pruning by depth: keep predicted points that are not behind what camera j saw."""
    _, depth = j.scan.image.camera.project(predicted.points)
    seen = j.scan.image.depth[predicted.pixels[:, 1], predicted.pixels[:, 0]]
    # A comparison with NaN is false: where j saw nothing, nothing hides the point.
    return np.logical_not(depth > seen + j.jump)


def prune_by_observed_normal(
    predicted: ContourPoints, j: ObservedContours, camera: Camera, j_from_camera: Pose
) -> BoolArray:
    """Third pruning with N_j, as printed: the surface that j saw in the pixel faces a camera.

    Points in pixels without a surface stay: the equation does not speak of them.
    """
    normals = j.scan.image.normals[predicted.pixels[:, 1], predicted.pixels[:, 0]]
    unknown = np.isnan(normals[:, 0])
    return unknown | _faces_camera(predicted.points, normals, camera, j_from_camera)


def _faces_camera(
    points: FloatArray, normals: FloatArray, camera: Camera, frame_from_camera: Pose
) -> BoolArray:
    towards = _towards_camera(points, camera, frame_from_camera)
    return np.einsum("nk,nk->n", normals, towards) > 0


def _towards_camera(points: FloatArray, camera: Camera, frame_from_camera: Pose) -> FloatArray:
    """From points to the camera's centre; an orthographic camera has none, but a direction."""
    if camera.model is CameraModel.ORTHOGRAPHIC:
        return np.broadcast_to(-frame_from_camera.rotation[:, 2], points.shape)
    return frame_from_camera.translation - points
