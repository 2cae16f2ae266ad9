"""Predicted contours: the surface of one scan as the camera of another would see it."""

import numpy as np

from scanweld.contours.contour_sets import ContourPoints, ObservedContours, near_side
from scanweld.geometry.arrays import IntArray
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.rasterize import render_depth


def predict_contours(
    i: ObservedContours, j: ObservedContours, j_from_i: Pose
) -> tuple[ContourPoints, IntArray]:
    """Contours C_{i->j} of scan i in the predicted range image R_{i->j} of camera j.

    Returns:
        The contour points in the sensor frame of j, with normals that look to the sensor of i;
        and the vertices (N, 3) of the triangles of scan i on which they are seen.
    """
    mesh, camera = i.scan.mesh, j.scan.image.camera
    vertices = j_from_i.apply(mesh.vertices)
    depth, face_of = render_depth(vertices, mesh.faces, camera)
    near = near_side(depth, face_of < 0, j.jump)
    rows, columns = np.nonzero(near)
    pixels = np.stack([columns, rows], axis=1)
    corners = mesh.faces[face_of[near]]
    normals = face_normals(vertices, corners)
    contour = ContourPoints(
        pixels=pixels,
        points=camera.unproject(pixels.astype(np.float64), depth[near]),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
    )
    return contour, corners
