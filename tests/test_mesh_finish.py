"""How a fused mesh is finished: corners split, pinholes closed, faces thinned."""

import numpy as np

from scanweld.evaluation.primitives import sphere
from scanweld.fusion.finish import close_pinholes, decimated, smoothed, split_fans
from scanweld.geometry.mesh import NoEdge, border_edges, face_normals, opposite_edges
from tests.meshes import is_closed


def test_sheets_that_touch_come_apart():
    """Two tetrahedra that share an edge, and two that share a vertex."""
    tetra = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    by_edge = np.concatenate([tetra, [[0, 1, 4], [0, 5, 1], [1, 5, 4], [4, 5, 0]]])
    by_vertex = np.concatenate([tetra, [[0, 5, 4], [0, 4, 6], [4, 5, 6], [5, 0, 6]]])
    for faces, num_vertices in ((by_edge, 8), (by_vertex, 8)):
        apart, parts = split_fans(faces)
        assert len(parts) == num_vertices
        np.testing.assert_array_equal(parts[apart], faces)
        assert is_closed(apart)
    back_to_back = np.concatenate([tetra, [[7, 8, 9], [7, 9, 8]]])
    assert len(split_fans(back_to_back)[0]) == len(tetra)


def test_only_small_holes_are_pinholes():
    body = sphere(1.0)
    faces = body.faces[~np.isin(body.faces, [100]).any(axis=1)]
    faces = faces[~(body.vertices[faces][:, :, 2] > 0.8).any(axis=1)]
    flags = np.zeros(len(body.vertices), dtype=bool)
    vertices, closed, _ = close_pinholes(body.vertices, faces, flags, 0.5)
    start, _ = border_edges(closed, len(vertices))
    assert len(vertices) == len(body.vertices) + 1
    assert (vertices[start, 2] > 0.7).all()
    outward = np.einsum("fk,fk->f", face_normals(vertices, closed), vertices[closed[:, 0]])
    assert outward.min() > 0


def test_decimation_of_few_faces_changes_nothing():
    body = sphere(1.0)
    flags = np.zeros(len(body.vertices), dtype=bool)
    vertices, faces, _ = decimated(body.vertices, body.faces, flags, len(body.faces))
    assert vertices is body.vertices and faces is body.faces
    assert smoothed(body.vertices, body.faces, 0) is body.vertices


def test_an_edge_knows_the_other_face_or_why_there_is_none():
    """Two faces that share an edge, a third on the same edge, and one that faces the other way."""
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    np.testing.assert_array_equal(opposite_edges(faces, 4), [3, -1, -1, 0, -1, -1])
    fin = np.concatenate([faces, [[0, 1, 4]]])
    np.testing.assert_array_equal(opposite_edges(fin, 5)[[0, 3, 6]], [NoEdge.IN_CONFLICT] * 3)
    turned = np.array([[0, 1, 2], [0, 1, 3]])
    np.testing.assert_array_equal(opposite_edges(turned, 4)[[0, 3]], [NoEdge.IN_CONFLICT] * 2)
    assert len(border_edges(turned, 4)[0]) == 4


def test_slits_are_closed_though_they_are_longer_than_pinholes():
    """A plane of squares without a row of triangles, and without a square of the same border."""
    side = np.arange(21)
    x, y = (part.ravel() for part in np.meshgrid(side, side))
    corner = (x + 21 * y)[(x < 20) & (y < 20)]
    squares = [[corner, corner + 1, corner + 22], [corner, corner + 22, corner + 21]]
    faces = np.stack([np.stack(part, axis=1) for part in squares], axis=1).reshape(-1, 3)
    vertices = np.stack([x, 0.3 * y, np.zeros(len(x))], axis=1).astype(np.float64)
    middle = vertices[faces].mean(axis=1)
    flags = np.zeros(len(vertices), dtype=bool)
    slit = (np.abs(middle[:, 0] - 10.0) < 4) & (np.abs(middle[:, 1] - 3.15) < 0.1)
    square = (np.abs(middle[:, 0] - 10.0) < 2) & (np.abs(middle[:, 1] - 3.0) < 2)
    for hole, is_closed_by in ((slit, True), (square, False)):
        _, closed, _ = close_pinholes(vertices, faces[~hole], flags, 10.0)
        assert (len(closed) > len(faces) - hole.sum()) == is_closed_by
