"""What several sensors say together of the pixels of a scan, and when that refutes poses.

A pixel that lies before what another sensor saw, or where it looked past the object, contradicts
the pose. One is noise; a whole patch is not. Of poses that tie, one refutes another if patches
contradict that and next to none the one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scanweld.evidence.pixels import Seen
from scanweld.geometry.arrays import BoolArray

AGREE_TOLERANCES = 0.5
"""Farthest that a pixel lies from the other scan's surface where it agrees with it."""
MIN_PATCH_PIXELS = 8
"""Pixels that hang together and all say the same, at least, to be told from chance."""
MAJORITY = 0.6
"""Share of the 3 x 3 pixels around one that must say the same: strips along edges are too thin."""
MIN_FEATURE_PIXELS = 10
"""Pixels in such patches that refute a pose, or make a mark, at least."""
MAX_REVERSE = 0.1
"""Share of them that may speak against the other pose; share of a mark that a rival may show."""
MIN_FREE_SPACE_PIXELS = 30
"""Pixels in patches that sensors look past refute a pose: outlines err by more than surfaces."""
MAX_FREE_SPACE_REVERSE = 0.3
"""Share of them that sensors may look past in the other pose."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PixelConsensus:
    """What the sensors of several scans say of all pixels of another one.

    Attributes:
        agrees: (H, W) pixels that lie on the surface that any of them saw, and before none.
        violates: (H, W) pixels of patches that lie before the surface that any of them saw.
        in_free_space: (H, W) pixels of patches where any of them looked past the object.
        max_pixels: So many may a mark and what it comes to lie on have.
    """

    agrees: BoolArray
    violates: BoolArray
    in_free_space: BoolArray
    max_pixels: float


def pixel_consensus(seen: Sequence[Seen], tolerance: float) -> PixelConsensus:
    """Sum up what several sensors say of the pixels of one scan."""
    violates = np.any([one.behind < -tolerance for one in seen], axis=0)
    agree = np.any([agrees(one.behind, tolerance) for one in seen], axis=0)
    return PixelConsensus(
        agrees=agree & ~violates,
        violates=coherent(violates),
        in_free_space=coherent(np.any([one.in_free_space for one in seen], axis=0)),
        max_pixels=seen[0].max_pixels,
    )


def agrees(behind: NDArray[np.float32], tolerance: float) -> BoolArray:
    """Which pixels lie on the surface that the other scan saw."""
    return np.abs(behind) < AGREE_TOLERANCES * tolerance


def coherent(said: BoolArray) -> BoolArray:
    """Those pixels of a mask that hang together in sufficient numbers."""
    if np.count_nonzero(said) < MIN_PATCH_PIXELS:
        return np.zeros_like(said)
    most = ndimage.uniform_filter(said.astype(np.float32), 3, mode="constant") > MAJORITY
    labels = np.zeros(said.shape, dtype=np.int32)
    ndimage.label(most & said, output=labels)
    is_large = np.bincount(labels.ravel()) >= MIN_PATCH_PIXELS
    is_large[0] = False
    return is_large[labels]


def is_refuted_jointly(rival: Sequence[PixelConsensus], pose: Sequence[PixelConsensus]) -> bool:
    """Whether patches of pixels of any scans speak for their poses and against rival ones."""
    against = _against(rival, pose)
    if against < MIN_FEATURE_PIXELS:
        return False
    return reverse(rival, pose) <= MAX_REVERSE * against


def violates_free_space(rival: Sequence[PixelConsensus], pose: Sequence[PixelConsensus]) -> bool:
    """Whether sensors look past pixels of any scans in rival poses, and far fewer in a pose."""
    against = _num_in_free_space(rival, pose)
    return (
        against >= MIN_FREE_SPACE_PIXELS
        and _num_in_free_space(pose, rival) <= MAX_FREE_SPACE_REVERSE * against
    )


def _against(rival: Sequence[PixelConsensus], pose: Sequence[PixelConsensus]) -> int:
    """Pixels of patches that are contradicted in a rival and agreed with in a pose.

    They must be few enough, in each scan, to be a mark: else the poses differ all over.
    """
    counts = [
        int(np.count_nonzero(b.violates & a.agrees)) for b, a in zip(rival, pose, strict=True)
    ]
    is_small = all(n <= one.max_pixels for n, one in zip(counts, pose, strict=True))
    return sum(counts) if is_small else 0


def reverse(rival: Sequence[PixelConsensus], pose: Sequence[PixelConsensus]) -> int:
    """Pixels of patches that are contradicted in a pose and not in its rival."""
    return sum(
        int(np.count_nonzero(a.violates & ~b.violates)) for b, a in zip(rival, pose, strict=True)
    )


def _num_in_free_space(pose: Sequence[PixelConsensus], other: Sequence[PixelConsensus]) -> int:
    """Pixels of patches that sensors look past in a pose and not in the other."""
    return sum(
        int(np.count_nonzero(a.in_free_space & ~b.in_free_space))
        for a, b in zip(pose, other, strict=True)
    )
