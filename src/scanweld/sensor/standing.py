"""What stays and what moves: whether the scans of a component were laid together by the background.

A camera that stands still sees the same room in every frame, whatever the object before it does.
Laid onto each other where they are, frames agree nearly everywhere, and the part that moved is too
small to speak against it. But there nothing is hidden: whoever looks from the same place sees the
same, so that every pixel that differs tells of something that moved.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scanweld.evidence.field import RASTER_KIND, ScanField
from scanweld.evidence.pixels import Seen, see
from scanweld.evidence.visibility import IS_SURFACE
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance

STILL_ANGLE_DEG, STILL_SHIFT_DIAMETERS = 1.0, 0.01
"""A camera that turned and shifted by less between two frames stood still."""
MOVED_SIGMAS, MOVED_DIAMETERS = 8.0, 0.005
"""A pixel moved if its distance differs by so many standard deviations of all, and by this."""
MIN_MOVED_SHARE = 1e-3
"""Share of the pixels that hang together and moved, at least: repeated frames show none at all."""
MAJORITY_PIXELS = 5
"""Edge of the square of which most pixels must have moved: edges flicker, bodies do not."""
MIN_MOVED_PAIRS = 0.5
"""Share of the pairs of frames that show it, at least."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Standing:
    """Scans that a standing camera took, and how much of what they show moved.

    Attributes:
        scans: Indices, in order.
        moved: Median share of the pixels that hang together and moved.
    """

    scans: tuple[int, ...]
    moved: float

    def words(self) -> str:
        """What happened, and what to do."""
        return (
            "the camera did not move: what was laid together is what stood still, and a part of "
            f"{self.moved:.1%} of the pixels moved; cut that part out and give it alone"
        )


def standing_scans(
    fields: Sequence[ScanField],
    poses: Mapping[int, Pose],
    edges: Sequence[tuple[int, int]],
    diameter: float,
) -> Standing | None:
    """Scans of a component that were laid together by what stood still, while something moved.

    Args:
        fields: All scans, laid out.
        poses: ``component_from_sensor`` of the component's, by index.
        edges: Pairs of them that are looked at.
        diameter: Of the run, in the scans' unit.

    Returns:
        The scans, or None if the camera moved, or nothing else did.
    """
    same = PoseTolerance(angle_deg=STILL_ANGLE_DEG, shift=STILL_SHIFT_DIAMETERS * diameter)
    still = [
        (i, j)
        for i, j in edges
        if same.covers(poses[i].inverse() @ poses[j], Pose.identity(), fields[j].centre)
    ]
    shares = [
        moved_share(fields[i], fields[j], poses[i].inverse() @ poses[j], diameter) for i, j in still
    ]
    moved = [share for share in shares if share >= MIN_MOVED_SHARE]
    if not moved or len(moved) < MIN_MOVED_PAIRS * len(still):
        return None
    scans = sorted({k for edge in still for k in edge})
    return Standing(scans=tuple(scans), moved=float(np.median(moved)))


def moved_share(i: ScanField, j: ScanField, i_from_j: Pose, diameter: float) -> float:
    """Share of two frames' pixels in the largest region where they see different surfaces.

    Args:
        i: First scan.
        j: Second scan, taken from the same place.
        i_from_j: The pose, between the sensor frames.
        diameter: Of the run, in the scans' unit.
    """
    seen = see(i, j, i_from_j, diameter)
    return float(
        np.mean([_moved(one, k.raster, diameter) for one, k in zip(seen, (i, j), strict=True)])
    )


def _moved(seen: Seen, raster: NDArray[np.float32], diameter: float) -> float:
    """The same of the pixels of one frame."""
    apart = np.abs(seen.behind)
    has = np.isfinite(apart)
    if not has.any():
        return 0.0
    sigma = 1.4826 * float(np.median(apart[has]))
    limit = max(MOVED_SIGMAS * sigma, MOVED_DIAMETERS * diameter)
    with np.errstate(invalid="ignore"):
        return _largest(apart > limit) / np.count_nonzero(raster[..., RASTER_KIND] == IS_SURFACE)


def _largest(mask: BoolArray) -> int:
    """Pixels in the largest region of a mask (H, W) where most around each are in the mask too."""
    most = ndimage.uniform_filter(mask.astype(np.float32), MAJORITY_PIXELS, mode="constant") > 0.5
    labels = np.zeros(mask.shape, dtype=np.int32)
    ndimage.label(most & mask, output=labels)
    return int(np.bincount(labels.ravel())[1:].max(initial=0))
