"""A sensor of which a file gives the place alone."""

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.scan import MOST_BEHIND


def viewpoint_told(
    points: FloatArray, place: FloatArray, is_unturned: bool, what: str
) -> tuple[Pose | None, tuple[str, ...]]:
    """The sensor where a file says that it stood, if the points lie before it, and notes on it.

    Args:
        points: (N, 3).
        place: (3,) in the points' frame.
        is_unturned: Whether its axes are those of the frame: at the origin this is what programs
            write that do not know.
        what: Where in the file it is told, for the note.
    """
    if not np.isfinite(place).all() or (is_unturned and not place.any()):
        return None, ()
    pose = seen_from(points, place)
    if pose is None:
        return None, (f"the place of its {what} lies among the points, so it was left out",)
    return pose, (f"seen from the place of its {what}, in the direction of the points",)


def seen_from(points: FloatArray, place: FloatArray) -> Pose | None:
    """A sensor at a place (3,) that looks to the middle of points (N, 3); None if it cannot.

    Args:
        points: Those that are not finite are left out.
        place: In the points' frame.

    Returns:
        scan_from_sensor, x to the right and z to the points; None if points lie all around.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return None
    rays = finite - place
    axis = rays.mean(axis=0)
    length = float(np.linalg.norm(axis))
    if not np.isfinite(length) or not length > 0 or (rays @ axis <= 0).mean() > MOST_BEHIND:
        return None
    axis = axis / length
    right = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    rotation = nearest_rotation(np.stack([right, np.cross(axis, right), axis], axis=1))
    return Pose(rotation=rotation, translation=place)
