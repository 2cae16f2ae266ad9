"""On which side of the surface the sensor stood, where the line of sight is known.

Each cue is a number from -1 (the sensor looks along -axis) to 1 (along +axis). The first one, in
the order below, that is strong enough decides; if strong ones contradict it, this is reported. If
none is strong, the strongest decides and the side is reported as uncertain.

1. winding: counter-clockwise faces turn their front to the sensor.
2. normals of the file turn towards the sensor.
3. fall-off: surfaces curve away, so that depth grows towards the silhouette.

How a grid fans out is better than all of these and known before (``camera_fit``, ``line_scanner``).
"""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import face_normals
from scanweld.geometry.scan import RangeScan

STRONG = 0.3
"""Strength from which a cue decides."""


@dataclass(frozen=True, kw_only=True, slots=True)
class _FallOff:
    """How fall-off is measured.

    Attributes:
        max_pixels: Across the image that it is measured on, at most.
        rim_pixels: Width of the rim along the silhouette.
        step_pixels: How far inside the rim the depth is that the rim's is compared with.
        max_slope: A depth step steeper than this is a jump, not a surface.
    """

    max_pixels: int = 250
    rim_pixels: int = 4
    step_pixels: int = 3
    max_slope: float = 4.0


_FALL_OFF = _FallOff()


@dataclass(frozen=True, kw_only=True, slots=True)
class Side:
    """Where the sensor looks: along +axis (sign 1) or -axis (sign -1), and by which cue.

    Attributes:
        sign: 1 or -1.
        cue: Name of the cue that decided.
        strength: Of that cue, 0 to 1.
        contradicts: Names of strong cues for the other side.
    """

    sign: int
    cue: str
    strength: float
    contradicts: tuple[str, ...]

    def note(self) -> str | None:
        """What to tell the user about it, or None if nothing is in doubt."""
        if self.strength < STRONG:
            return (
                f"the side from which the sensor looked is a guess (by {self.cue}); if the "
                "scan comes out inside out, give its normals or its sensor pose"
            )
        if self.contradicts:
            other = " and ".join(self.contradicts)
            return f"the sensor's side is taken from {self.cue}, which {other} contradict"
        return None


def find_side(scan: RangeScan, axis: FloatArray, depth: FloatArray, pixel: float) -> Side:
    """The side of a scan whose line of sight is axis (3,), up to its sign.

    Args:
        scan: Its faces and normals are looked at, if it has any.
        axis: (3,) unit, scan frame.
        depth: (H, W) image of the points' coordinates along the axis, NaN where there is none.
        pixel: Size of the image's pixels on the object.
    """
    cues: list[tuple[str, float]] = []
    if scan.faces is not None and len(scan.faces):
        cues.append(("the faces' winding", -_balance(face_normals(scan.points, scan.faces) @ axis)))
    if scan.normals is not None:
        cues.append(("the normals", -_balance(scan.normals @ axis)))
    cues.append(("depth falling off towards the silhouette", fall_off(depth, pixel)))
    strong = [cue for cue in cues if abs(cue[1]) >= STRONG]
    name, value = strong[0] if strong else max(cues, key=lambda cue: abs(cue[1]))
    sign = -1 if value < 0 else 1
    contradicts = tuple(other for other, v in strong if v * sign < 0)
    return Side(sign=sign, cue=name, strength=abs(value), contradicts=contradicts)


def fall_off(depth: FloatArray, pixel: float) -> float:
    """How far depth (H, W) grows towards the silhouette: 1 everywhere, -1 if it shrinks everywhere.

    Pixels on the outer rim are compared with those a few pixels further inside. Jumps and holes
    do not count, slopes count up to 1.
    """
    from scipy import ndimage

    how = _FALL_OFF
    stride = max(1, -(-max(depth.shape) // how.max_pixels))
    margin = 2 * how.rim_pixels
    image = np.pad(depth[::stride, ::stride], margin, constant_values=np.nan)
    seen = np.isfinite(image)
    disk = ndimage.iterate_structure(ndimage.generate_binary_structure(2, 1), how.rim_pixels)
    inside = ndimage.binary_fill_holes(ndimage.binary_closing(seen, disk))
    outside = np.asarray(
        ndimage.distance_transform_edt(inside, return_distances=False, return_indices=True)
    )
    rows, columns = np.nonzero(seen)
    inward = np.stack([rows, columns]) - outside[:, rows, columns]
    is_rim = (inward**2).sum(axis=0) <= how.rim_pixels**2
    rows, columns, inward = rows[is_rim], columns[is_rim], inward[:, is_rim]
    inward = inward / np.linalg.norm(inward, axis=0)
    deeper_rows, deeper_columns = np.rint([rows, columns] + how.step_pixels * inward).astype(int)
    rise = image[rows, columns] - image[deeper_rows, deeper_columns]
    slope = rise / (how.step_pixels * stride * pixel)
    slope = slope[np.isfinite(slope) & (np.abs(slope) <= how.max_slope)]
    return _balance(np.clip(slope, -1, 1))


def _balance(values: FloatArray) -> float:
    """Sum of the values over the sum of their magnitudes; 0 if there are none."""
    total = float(np.abs(values).sum())
    return float(values.sum()) / total if total > 0 else 0.0
