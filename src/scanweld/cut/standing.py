"""Whether a camera stood still, and what its frames then show that moved."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from scanweld.cut.frames import Frames
from scanweld.cut.smoothing import Noise, noise_of, smooth_field
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.sampling import NUM_FRAMES

SAME_SHARE_OF_DEPTH = 0.02
"""Depths that differ by less of themselves may be the same: sensors err alike in neighbouring
pixels by up to this much, another way in each frame."""
LEFT_SHARE_OF_DEPTH = 0.01
"""What may be left of this when it is smoothed away, where the image ends or the object begins."""
STILL = 0.6
"""Share of the pixels seen by two frames that must be the same if the camera stood still."""
STRIDE = 4
"""One pixel in so many, each way, decides whether the camera stood still."""
SURE_SIGMAS = 5.0
"""Deviation in standard deviations of the noise beyond which a difference is real."""
SETTLED = 0.8
"""Share of the frames that must see the same in a pixel in which nothing moves."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Standing:
    """What a camera that stood still saw.

    Attributes:
        usual: (H, W) median depth of the frames, NaN where nothing was seen.
        far: (H, W) farthest depth that any frame saw about each pixel, -inf where none did.
        is_settled: (H, W) pixels in which most frames see the same.
        noise: Of single pixels between frames.
    """

    usual: FloatArray
    far: FloatArray
    is_settled: BoolArray
    noise: Noise

    def even(self, depth: FloatArray) -> FloatArray:
        """A frame's depth (H, W) without what it errs smoothly against the usual depth."""
        off = depth - self.usual
        reach = SAME_SHARE_OF_DEPTH * self.usual
        field = smooth_field(off, np.abs(off) <= reach)
        sure = SURE_SIGMAS * self.noise.at(self.usual)
        is_used = (np.abs(off) <= reach) & (np.abs(off - field) <= sure)
        return depth - smooth_field(off, is_used)

    def revealed(self, depth: FloatArray) -> BoolArray:
        """Pixels (H, W) of a frame in front of what another frame saw there, in coherent patches.

        Args:
            depth: (H, W) of the frame.
        """
        from scipy import ndimage

        even = self.even(depth)
        sure = SURE_SIGMAS * self.noise.at(even) + LEFT_SHARE_OF_DEPTH * even
        is_front = even + sure < self.far
        return np.asarray(ndimage.binary_opening(is_front, np.ones((3, 3))), dtype=np.bool_)


def share_of_still_pairs(frames: Frames) -> float:
    """Share of the pairs of frames in which most of the pixels saw the same."""
    depth = [frames.depth(k)[::STRIDE, ::STRIDE] for k in _chosen(frames)]
    return float(np.mean([_is_same(a, b) for a, b in combinations(depth, 2)]))


def standing(frames: Frames) -> Standing:
    """What a camera saw that stood still."""
    from scipy import ndimage

    depth = np.stack([frames.depth(k) for k in _chosen(frames)])
    usual = _median(depth)
    rough = Standing(
        usual=usual,
        far=usual,
        is_settled=np.isfinite(usual),
        noise=Noise(depth=np.array([1.0]), sigma=np.array([np.inf])),
    )
    even = np.stack([rough.even(image) for image in depth])
    off = even - usual
    is_near = np.abs(off) <= SAME_SHARE_OF_DEPTH * usual
    where = np.broadcast_to(usual, off.shape)
    noise = noise_of(off[is_near], where[is_near])
    is_same = np.abs(off) <= SURE_SIGMAS * noise.at(usual)
    seen = np.isfinite(depth).sum(axis=0)
    better = Standing(usual=usual, far=usual, is_settled=np.isfinite(usual), noise=noise)
    far = np.full(usual.shape, -np.inf)
    for image in depth:
        around = ndimage.minimum_filter(np.nan_to_num(better.even(image), nan=np.inf), 3)
        far = np.maximum(far, np.where(np.isfinite(around), around, -np.inf))
    return Standing(
        usual=usual,
        far=far,
        is_settled=(is_same.sum(axis=0) >= SETTLED * seen) & (2 * seen >= len(depth)),
        noise=noise,
    )


def _chosen(frames: Frames) -> list[int]:
    """Indices of frames that stand for all, evenly over their order."""
    count = min(len(frames.scans), NUM_FRAMES)
    return np.linspace(0, len(frames.scans) - 1, count).round().astype(int).tolist()


def _is_same(a: FloatArray, b: FloatArray) -> bool:
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both], b[both]
    return len(a) > 0 and bool(
        (np.abs(a - b) <= SAME_SHARE_OF_DEPTH * np.minimum(a, b)).mean() >= STILL
    )


def _median(depth: FloatArray) -> FloatArray:
    """Lower median (H, W) over frames (K, H, W) of what each pixel saw, NaN if nothing."""
    ordered = np.sort(depth, axis=0)  # NaN last
    seen = np.isfinite(depth).sum(axis=0)
    middle = np.maximum(seen - 1, 0) // 2
    return np.take_along_axis(ordered, middle[None], axis=0)[0]
