"""Whole frames -> what moved in them, or what they look at; all other scans as they are."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from scanweld.choices import Shown
from scanweld.cut.carried import Stood, looked_at, meeting_of
from scanweld.cut.frames import Frames, frames_of
from scanweld.cut.masks import with_only
from scanweld.cut.pieces import RIVAL, moving_pieces, objects_of
from scanweld.cut.standing import Standing, share_of_still_pairs, standing
from scanweld.cut.table import above, supporting_planes
from scanweld.errors import InputError
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.sampling import NUM_SAMPLED
from scanweld.geometry.scan import RangeScan

logger = logging.getLogger(__name__)

MOST_PAIRS = 0.8
"""Share of the pairs of frames that must show the same in most pixels: the camera stood still."""
MAX_ELSEWHERE = 0.1
"""Share of the pixels off the object that seem to have moved, over that of the object's, above
which it is the camera that moved."""
MAX_KEPT = 0.7
"""Share of a frame's pixels above which what is kept is no cut: nothing was around the object."""
REMEDY = "--object moving needs depth frames of one camera that stood still while the object moved"


ALL = "all is to be kept"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CutSet:
    """Scans after the cut.

    Attributes:
        scans: In the order in which they came, those of which nothing is left without.
        kept: (H, W) cells of the grid that were kept, by the name of each scan that was cut.
        empty: Reason for each scan of which nothing is left, by name.
        reason: Why nothing was cut, if so.
    """

    scans: tuple[RangeScan, ...]
    kept: Mapping[str, BoolArray] = field(default_factory=dict)
    empty: Mapping[str, str] = field(default_factory=dict)
    reason: str = ""


def cut_out(scans: Sequence[RangeScan], shown: Shown, stood: Stood | None = None) -> CutSet:
    """Cut the object out of whole frames.

    Args:
        scans: Any, names unique.
        shown: "auto" cuts what moved before a camera that stood still, or what a camera that was
            carried around looked at, and leaves all other scans alone; "moving" insists that
            something moved; "all" leaves all scans alone.
        stood: Where the camera stood, as far as it is known.

    Returns:
        The scans, of frames the object; the very same ones if there was nothing to cut.

    Raises:
        InputError: If it is to be "moving", but nothing is known to have moved.
    """
    found = _kept(scans, stood if shown == "auto" else None) if shown != "all" else ALL
    if isinstance(found, str):
        if shown == "moving":
            raise InputError(f"{found}; {REMEDY}")
        logger.debug("nothing is cut: %s", found)
        return CutSet(scans=tuple(scans), reason=found)
    empty = {
        name: "the object is not seen in this frame: it shows the table and the background alone"
        for name, mask in found.items()
        if not mask.any()
    }
    cut = [
        with_only(scan, found[scan.name]) if scan.name in found else scan
        for scan in scans
        if scan.name not in empty
    ]
    return CutSet(scans=tuple(cut), kept=found, empty=empty)


def _kept(scans: Sequence[RangeScan], stood: Stood | None) -> dict[str, BoolArray] | str:
    """The cells (H, W) of each frame that show the object, by name; or why nothing is cut."""
    frames = frames_of(scans)
    if isinstance(frames, str):
        return frames
    still = share_of_still_pairs(frames)
    if still < MOST_PAIRS and stood is not None:
        return _kept_of_looked_at(frames, stood)
    if still < MOST_PAIRS:
        return (
            f"the camera moved, or the object fills the frames: {still:.0%} of the pairs of frames "
            "show the same in most pixels"
        )
    background = standing(frames)
    moved = [background.revealed(frames.depth(k)) for k in range(len(frames.scans))]
    points = _points_of_patches(frames, moved)
    if not len(points):
        return "nothing moved between the frames, as far as their noise lets one see"
    return _checked(frames, moved, _objects(frames, background, moved, points))


def _kept_of_looked_at(frames: Frames, stood: Stood) -> dict[str, BoolArray] | str:
    """The same of frames of a camera that moved."""
    meeting = meeting_of(frames, stood)
    objects = looked_at(frames, meeting) if not isinstance(meeting, str) else meeting
    if isinstance(objects, str):
        return objects
    kept, shares = {}, []
    for scan, pixels in zip(frames.scans, objects, strict=True):
        kept[scan.name] = _mask(pixels, frames)
        shares.append(len(pixels) / len(scan.points))
    if 2 * sum(map(bool, shares)) < len(shares):
        return "the camera moved, and nothing stands where it looked at in most of the frames"
    if np.median([share for share in shares if share]) > MAX_KEPT:
        return "the frames show little besides the object"
    return kept


def _mask(pixels: IntArray, frames: Frames) -> BoolArray:
    """Flat indices as a mask (H, W)."""
    own = np.zeros((frames.camera.height, frames.camera.width), dtype=bool)
    own.ravel()[pixels] = True
    return own


def _points_of_patches(frames: Frames, moved: Sequence[BoolArray]) -> FloatArray:
    """(N, 3) points in the largest patches of what moved, evenly thinned."""
    from scipy import ndimage

    found = [np.empty((0, 3))]
    for k, mask in enumerate(moved):
        patch = np.zeros(mask.shape, dtype=np.int64)
        ndimage.label(mask, np.ones((3, 3)), output=patch)
        size = np.bincount(patch.ravel())
        size[0] = 0
        large = mask & (size >= RIVAL * size.max())[patch]
        found.append(frames.camera.unproject_image(frames.depth(k))[large])
    points = np.concatenate(found)
    return points[:: max(1, len(points) // NUM_SAMPLED)]


def _objects(
    frames: Frames, background: Standing, moved: Sequence[BoolArray], points: FloatArray
) -> list[IntArray]:
    """Flat indices of the pixels of the object in each frame."""
    planes = supporting_planes(background, points, frames.camera)
    pieces = []
    for k, mask in enumerate(moved):
        depth = frames.depth(k)
        is_above = above(depth, mask, planes, background, frames.camera)
        pieces.append(moving_pieces(depth, is_above, mask, background.noise, frames.camera))
    return objects_of(pieces)


def _checked(
    frames: Frames, moved: Sequence[BoolArray], objects: Sequence[IntArray]
) -> dict[str, BoolArray] | str:
    """The objects as masks by the scans' names, or why they are none."""
    kept, shares, inside, outside = {}, [], [0, 0], [0, 0]
    for scan, mask, pixels in zip(frames.scans, moved, objects, strict=True):
        own = _mask(pixels, frames)
        assert scan.grid is not None
        rest = (scan.grid >= 0) & ~own
        kept[scan.name] = own
        shares.append(len(pixels) / max(len(pixels) + int(rest.sum()), 1))
        for count, part in ((inside, own), (outside, rest)):
            count[0] += int((mask & part).sum())
            count[1] += int(part.sum())
    if 2 * sum(map(bool, shares)) < len(shares):
        return "nothing moved that hangs together in most of the frames"
    if outside[0] * inside[1] > MAX_ELSEWHERE * inside[0] * outside[1]:
        return "what changes is spread over the frames: the camera did not quite stand still"
    if np.median([share for share in shares if share]) > MAX_KEPT:
        return "the frames show little besides the object"
    return kept
