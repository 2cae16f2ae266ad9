"""What is known of a capture before it is run: layout, range, noise, and what would be cut."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from scanweld.cut import Stood, cut_out
from scanweld.cut.frames import depth_image
from scanweld.errors import ReadError
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.sampling import NUM_FRAMES
from scanweld.geometry.scan import RangeScan
from scanweld.io.depth.capture import Frame, start_poses
from scanweld.preparation.denoise import noise_of

NUM_RANGES = 3
"""Ranges of depth, with as many pixels each, in which noise is measured."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CaptureInfo:
    """A capture, by some of its frames.

    Attributes:
        rows: What is told, by heading.
        scans: The frames that were looked at.
        kept: (H, W) pixels that a run would keep, by the name of each frame that would be cut.
        unread: Why some of these could not be read, by name.
    """

    rows: Mapping[str, str]
    scans: Sequence[RangeScan]
    kept: Mapping[str, BoolArray] = field(default_factory=dict)
    unread: Mapping[str, str] = field(default_factory=dict)


def capture_info(frames: Sequence[Frame]) -> CaptureInfo:
    """Look at a capture.

    Args:
        frames: All of its depth images, at least one.
    """
    chosen = np.linspace(0, len(frames) - 1, min(len(frames), NUM_FRAMES)).round().astype(int)
    scans: list[RangeScan] = []
    unread: dict[str, str] = {}
    for k in chosen:
        try:
            scans.append(frames[k].read())
        except ReadError as error:
            unread[frames[k].name] = str(error)
    rows = {"frames": _frames(frames, len(chosen)), "layout": _layout(frames)}
    rows["scale"] = "; ".join(dict.fromkeys(frame.settings.scale.notes[-1] for frame in frames))
    rows["poses"] = _poses(frames)
    rows["colours"] = _colors(frames, scans)
    if not scans:
        return CaptureInfo(rows=rows, scans=(), unread=unread)
    depths = [depth_image(scan) for scan in scans]
    rows["range"] = _range(depths)
    rows["noise"] = _noise(depths)
    start = start_poses(frames)
    stood = start and Stood(poses=start.poses, components=start.components)
    cut = cut_out(scans, "auto", stood)
    rows["object"] = _object(frames, scans, cut.kept, cut.reason)
    return CaptureInfo(rows=rows, scans=scans, kept=cut.kept, unread=unread)


def info_text(where: str, info: CaptureInfo) -> str:
    """The same as lines of text."""
    return "\n".join([where, *(f"  {key:<11}{told}" for key, told in info.rows.items())])


def _frames(frames: Sequence[Frame], looked_at: int) -> str:
    told = f"{len(frames)} depth images" if len(frames) > 1 else "one depth image"
    return told if looked_at == len(frames) else f"{told}; what follows is of {looked_at} of them"


def _layout(frames: Sequence[Frame]) -> str:
    title = frames[0].layout or "none that is known: images, and what was laid beside them"
    pinholes = {(f.settings.intrinsics.fx, f.settings.intrinsics.cx) for f in frames}
    return f"{title}; {'one camera' if len(pinholes) == 1 else 'a camera for each image'}"


def _poses(frames: Sequence[Frame]) -> str:
    count = sum(frame.world_from_scan is not None for frame in frames)
    if not count:
        return "none"
    return f"of {count} of {len(frames)}, tried as start poses and never just believed"


def _colors(frames: Sequence[Frame], scans: Sequence[RangeScan]) -> str:
    named = sum(frame.settings.color is not None for frame in frames)
    if not named:
        return "none"
    aligned = sum(scan.colors is not None for scan in scans)
    told = f"{named} of {len(frames)} frames have a colour image"
    return told if aligned else f"{told}, not aligned to depth: left out"


def _range(depths: Sequence[FloatArray]) -> str:
    seen = np.concatenate([depth[np.isfinite(depth)] for depth in depths])
    low, middle, high = np.quantile(seen, [0.01, 0.5, 0.99])
    missing = 1 - len(seen) / sum(depth.size for depth in depths)
    return (
        f"{low:.3g} to {high:.3g} m, half of it nearer than {middle:.3g} m; {missing:.0%} of the "
        "pixels without depth"
    )


def _noise(depths: Sequence[FloatArray]) -> str:
    """Noise from pixel to pixel; what neighbours share cannot be seen in single frames."""
    seen = np.concatenate([depth[np.isfinite(depth)] for depth in depths])
    ends = np.quantile(seen, np.linspace(0, 1, NUM_RANGES + 1))
    told = []
    for low, high in pairwise(ends):
        parts = [np.where((low <= depth) & (depth <= high), depth, np.nan) for depth in depths]
        own = np.unique(np.concatenate([part[np.isfinite(part)] for part in parts]))
        step = float(np.median(np.diff(own))) if len(own) > 1 else 0.0
        sigma = max(float(np.median([noise_of(part) for part in parts])), step / np.sqrt(12))
        told.append(f"{1000 * sigma:.2g} mm at {(low + high) / 2:.2g} m")
    return f"{', '.join(dict.fromkeys(told))}, from pixel to pixel"


def _object(
    frames: Sequence[Frame],
    scans: Sequence[RangeScan],
    kept: Mapping[str, BoolArray],
    reason: str,
) -> str:
    if any(frame.settings.mask is not None for frame in frames):
        return "cut to the masks"
    if not kept:
        return f"nothing would be cut: {reason}"
    shares = [100 * float(mask.mean()) for mask in kept.values()]
    told = f"{min(shares):.1f} to {max(shares):.1f} % of the pixels"
    return (
        f"{told} show the object and would be kept, of {len(kept)} of {len(scans)} frames; table "
        "and background would be cut off"
    )
