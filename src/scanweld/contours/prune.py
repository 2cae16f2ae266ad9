"""The three prunings that leave contours which two views can share (paper eqs 4-6).

All points are in the sensor frame of j, the camera that observes.
"""

import numpy as np

from scanweld.contours.contour_sets import ContourPoints
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose


def prune_self_occlusion(corners: IntArray, is_border: BoolArray) -> BoolArray:
    """First pruning (eq. 4): keep predicted points that are not where scan i itself ends.

    There the predicted image stops because scan i saw no farther, not because the object does.

    Args:
        corners: (N, 3) vertices of the triangles of scan i on which the points were seen.
        is_border: (V,) vertices on C_i, O_i or the open border.
    """
    return np.logical_not(is_border[corners].any(axis=1))


def prune_invisible_observed(
    observed: ContourPoints, camera_i: Camera, j_from_i: Pose
) -> BoolArray:
    """Second pruning (eq. 5): keep observed points whose surface looks towards camera i."""
    return _faces_camera(observed, camera_i, j_from_i)


def prune_invisible_predicted(predicted: ContourPoints, camera_j: Camera) -> BoolArray:
    """Third pruning (eq. 6): keep predicted points whose surface looks towards camera j.

    The others are the inside of scan i's half shell, seen through its open back.
    """
    return _faces_camera(predicted, camera_j, Pose.identity())


def _faces_camera(contour: ContourPoints, camera: Camera, frame_from_camera: Pose) -> BoolArray:
    towards = _towards_camera(contour.points, camera, frame_from_camera)
    return np.einsum("nk,nk->n", contour.normals, towards) > 0


def _towards_camera(points: FloatArray, camera: Camera, frame_from_camera: Pose) -> FloatArray:
    """From points to the camera's centre; an orthographic camera has none, but a direction."""
    if camera.model is CameraModel.ORTHOGRAPHIC:
        return np.broadcast_to(-frame_from_camera.rotation[:, 2], points.shape)
    return frame_from_camera.translation - points
