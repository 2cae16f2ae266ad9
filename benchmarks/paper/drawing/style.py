"""Colours of the figures; everything is sRGB from 0 to 1."""

from collections.abc import Sequence

import numpy as np

from scanweld.geometry.arrays import FloatArray


def _srgb(code: str) -> FloatArray:
    return np.array([int(code[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


PAPER = _srgb("#FBFAF7")
INK = _srgb("#23272F")
QUIET = _srgb("#737880")
SCANS = tuple(_srgb(code) for code in ("#D9734E", "#3E82B0", "#E3B04B", "#62A07E"))
"""One a scan, in the order of the scans."""
CLAY = _srgb("#D3CCC0")
"""A scan that steps back behind what is drawn on it."""
WALL = _srgb("#E6D3A8")
BACK_PLANE = _srgb("#DCE4EE")
ACCENT = _srgb("#C2274B")
SECOND = _srgb("#7A4FA3")
"""Beside the accent, where two things are left out for two reasons."""
_HEAT = tuple(
    _srgb(code)
    for code in ("#27416B", "#4C86B8", "#A9CBD9", "#F3EBD7", "#F2BE62", "#E0703E", "#A31B36")
)


def heat_colors(values: FloatArray, low: float, high: float) -> FloatArray:
    """Colours (N, 3) of values (N,), cold at ``low`` and below, hot at ``high`` and above."""
    return _between(_HEAT, (values - low) / (high - low))


def _between(stops: Sequence[FloatArray], shares: FloatArray) -> FloatArray:
    at = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(shares, at, [stop[k] for stop in stops]) for k in range(3)], axis=-1)
