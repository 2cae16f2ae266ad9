"""Depth frames as pictures: what was cut off them, and the colours that they have."""

from collections.abc import Collection, Mapping

import numpy as np

from scanweld.app.html_report.stills import Still, still_of
from scanweld.app.html_report.style import STYLE
from scanweld.cut import mask_of
from scanweld.cut.frames import depth_image
from scanweld.geometry.arrays import BoolArray, ByteArray
from scanweld.geometry.scan import RangeScan
from scanweld.io import natural_key
from scanweld.reconstruction import ScanReport


def cut_pictures(
    reports: Mapping[str, ScanReport], scans: Mapping[str, RangeScan]
) -> dict[str, Still]:
    """A picture of each scan that something was cut off, by name.

    Args:
        reports: What became of the scans.
        scans: As they were read; those that are missing have no picture.
    """
    return {
        name: depth_picture(scans[name], mask_of(kept), f"What was kept of {name}")
        for name in sorted(reports, key=natural_key)
        if (kept := reports[name].kept) is not None and name in scans
    }


def color_pictures(names: Collection[str], scans: Mapping[str, RangeScan]) -> dict[str, Still]:
    """The colours that depth frames have, as pictures by name.

    Args:
        names: Of the scans that are shown.
        scans: As they were read; those without a camera, a grid or colours have no picture.
    """
    return {
        name: still_of(_colors(scans[name]), f"Colours of {name}")
        for name in sorted(names, key=natural_key)
        if name in scans and _is_colored(scans[name])
    }


def _is_colored(scan: RangeScan) -> bool:
    return scan.camera is not None and scan.grid is not None and scan.colors is not None


def _colors(scan: RangeScan) -> ByteArray:
    assert scan.grid is not None and scan.colors is not None
    step = -(-scan.grid.shape[1] // STYLE.frame_pixels)
    grid, nothing = scan.grid[::step, ::step], np.array(STYLE.nothing, dtype=np.uint8)
    return np.where((grid >= 0)[..., None], scan.colors[grid], nothing)


def depth_picture(scan: RangeScan, kept: BoolArray | None, alt: str) -> Still:
    """The depths of a scan with a grid in grey, those of some pixels (H, W) in colour."""
    return still_of(picture_of(scan, kept), alt)


def picture_of(scan: RangeScan, kept: BoolArray | None = None) -> ByteArray:
    """The same as pixels (h, w, 3)."""
    depth = depth_image(scan)
    kept = np.zeros(depth.shape, dtype=bool) if kept is None else kept
    step = -(-depth.shape[1] // STYLE.frame_pixels)
    depth, kept = depth[::step, ::step], kept[::step, ::step]
    has = np.isfinite(depth)
    near, far = np.quantile(depth[has], [0.02, 0.98]) if has.any() else (0.0, 1.0)
    with np.errstate(invalid="ignore"):
        share = np.clip((depth - near) / max(far - near, np.finfo(float).tiny), 0.0, 1.0)
    bright, dark = STYLE.frame_greys
    grey = np.where(has, bright + (dark - bright) * share, 0.0)[..., None]
    color = np.where(kept[..., None], grey * STYLE.kept_tint, grey)
    return np.rint(np.where(has[..., None], color, STYLE.nothing)).astype(np.uint8)
