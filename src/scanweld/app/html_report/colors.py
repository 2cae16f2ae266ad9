"""The page's colours: one for each scan, and the scales of residual and support."""

import colorsys
from collections.abc import Sequence

import numpy as np

from scanweld.app.html_report.style import STYLE
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray

RESIDUAL_STOPS = ("#3b4cc0", "#6f9bd8", "#c9d7d9", "#f2c46d", "#e2703a", "#a50f26")
"""From no residual to the largest shown."""
SUPPORT_STOPS = ("#b5179e", "#f0a03c", "#b9cf8b", "#5fae9b", "#2d7f9d", "#27548a")
"""Seen by at most 1, by 2, 3, 4, 5 and by 6 scans or more."""
BORDER = "#ff2d2d"
"""Open borders."""
UNKNOWN = "#9a9a95"
"""Where nothing was measured."""


def scan_colors(count: int) -> list[str]:
    """A colour for each scan, ``#rrggbb``; few scans get hues far apart, many differ in light."""
    step = 1 / count if 0 < count <= 12 else STYLE.hue_step
    colors = []
    for k in range(count):
        level = STYLE.scan_levels[k % (1 if count <= 5 else 3)]
        rgb = colorsys.hls_to_rgb((0.57 + k * step) % 1.0, level, 0.62)
        colors.append("#" + "".join(f"{round(255 * part):02x}" for part in rgb))
    return colors


def rgb(color: str) -> tuple[int, int, int]:
    """``#rrggbb`` as three bytes."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue


def along(stops: Sequence[str], shares: FloatArray) -> ByteArray:
    """Colours (N, 3) on a scale, mixed between its stops; grey where the share is NaN."""
    table = np.array([rgb(stop) for stop in stops], dtype=np.float64)
    place = np.clip(np.nan_to_num(shares), 0, 1) * (len(stops) - 1)
    columns = [np.interp(place, np.arange(len(stops)), table[:, c]) for c in range(3)]
    colors = np.rint(np.stack(columns, axis=1)).astype(np.uint8)
    colors[~np.isfinite(shares)] = rgb(UNKNOWN)
    return colors


def support_colors(support: IntArray) -> ByteArray:
    """Colours (N, 3) of numbers of scans."""
    table = np.array([rgb(stop) for stop in SUPPORT_STOPS], dtype=np.uint8)
    return table[np.clip(support, 1, len(table)) - 1]
