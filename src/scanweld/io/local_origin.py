"""A local origin for what lies far from the world's, as in map coordinates.

Many programs hold coordinates in single precision, which at 5,400,000 has steps of 0.5. Files of a
model there are written about a round point nearby, the *shift*: world = shift + what is written.
They say so (a comment, a key of JSON, the node of a GLB), and scanweld adds it on reading.
"""

import re
from collections.abc import Sequence

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose

SHIFT_KEY = "scanweld_shift"
"""Before the three numbers of a shift in comments."""
_MAX_ERROR_SIZES = 1e-5
"""Error of single precision, as a share of the size, from which on a shift is needed."""
_HEAD = 4096
"""Bytes at the begin of a file within which its shift stands."""
_TOLD = re.compile(
    rf"^(?:comment |# |binary STL, ){SHIFT_KEY} (\S+) (\S+) (\S+)\s".encode(), re.MULTILINE
)


def find_shift(points: FloatArray) -> FloatArray | None:
    """A round point near points (N, 3) that lie far off; None where single precision holds them.

    Along axes where they are near the origin it is zero. That, and its few digits, let the
    difference and the sum be exact.
    """
    if not len(points):
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    half_step = 0.5 * float(np.finfo(np.float32).eps)
    is_far = half_step * np.maximum(-low, high) > _MAX_ERROR_SIZES * size
    if size == 0.0 or not is_far.any():
        return None
    digits = -int(np.ceil(np.log10(size)))
    rounded = [round(float(x), digits) for x in 0.5 * (low + high)]
    return np.where(is_far, rounded, 0.0)


def shift_text(shift: FloatArray) -> str:
    """The shift as comments tell it."""
    return f"{SHIFT_KEY} {shift_numbers(shift)}"


def shift_numbers(shift: FloatArray) -> str:
    """The three numbers of a shift, as short as they can be."""
    return " ".join(repr(float(x) + 0.0).removesuffix(".0") for x in shift)


def told_shift(data: bytes) -> FloatArray | None:
    """The shift of which a file tells at its begin, None where it does not.

    Raises:
        ValueError: If that is no three numbers.
    """
    found = _TOLD.search(data[:_HEAD])
    if found is None:
        return None
    shift = np.array([float(word) for word in found.groups()])
    if not np.isfinite(shift).all():
        raise ValueError("not finite")
    return shift


def shifted(pose: Pose, shift: FloatArray) -> Pose:
    """A pose world_from_x, x moved on by a shift of the world."""
    return Pose(rotation=pose.rotation, translation=pose.translation + shift)


def about_note(names: Sequence[str], shift: FloatArray) -> str:
    """What is said of files that are written about a local origin."""
    verb = "is" if len(names) == 1 else "are"
    return (
        f"note: {', '.join(names)} {verb} about a local origin, for the world lies far off: add "
        f"{shift_numbers(shift)}"
    )
