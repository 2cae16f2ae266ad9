"""Range scans: parts of them, what is known of the sensor, and connected pieces of surfaces."""

import numpy as np
import pytest

from scanweld.geometry.mesh import pieces
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint


def strip() -> RangeScan:
    """Four points in a row of five cells, with two faces and everything else a scan can have.

    0 - 1 - . - 2 - 3
    """
    return RangeScan(
        name="strip",
        points=np.arange(12.0).reshape(4, 3),
        grid=np.array([[0, 1, -1, 2, 3]]),
        faces=np.array([[0, 1, 2], [1, 2, 3]]),
        normals=np.eye(4)[:, :3],
        colors=np.arange(12).reshape(4, 3).astype(np.uint8),
        confidence=np.arange(4.0),
    )


def test_a_part_of_a_scan_keeps_what_belongs_to_its_points():
    scan = strip()
    part = scan.only(np.array([False, True, True, True]))
    assert part.grid is not None and part.faces is not None
    assert part.normals is not None and part.colors is not None and part.confidence is not None
    np.testing.assert_array_equal(part.points, scan.points[1:])
    np.testing.assert_array_equal(part.grid, [[-1, 0, -1, 1, 2]])
    np.testing.assert_array_equal(part.faces, [[0, 1, 2]])
    np.testing.assert_array_equal(part.normals, np.eye(4)[1:, :3])
    np.testing.assert_array_equal(part.colors[:, 0], [3, 6, 9])
    np.testing.assert_array_equal(part.confidence, [1, 2, 3])
    assert scan.only(np.ones(4, dtype=bool)).content_hash() == scan.content_hash()


def test_a_sensor_that_is_not_located_has_no_pose():
    with pytest.raises(ValueError, match="strip: it is unknown where the sensor stood"):
        _ = strip().sensor_pose
    located = strip().with_sensor(Pose.identity(), Viewpoint.ESTIMATED)
    assert located.sensor_pose.angle_deg() == 0.0


def test_pieces_hang_together_by_faces():
    """Two triangles that share an edge, one that shares a corner with them, one apart, a point.

    0 - 1
    | / |
    2 - 3     6 - 7
        | \\   | /
        4 - 5 8     9
    """
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 5], [6, 8, 7]])
    np.testing.assert_array_equal(pieces(faces, 10), [0, 0, 0, 0, 0, 0, 1, 1, 1, 2])
    assert len(pieces(np.zeros((0, 3), dtype=np.int64), 0)) == 0
