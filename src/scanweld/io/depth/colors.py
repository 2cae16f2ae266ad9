"""Colours for the pixels of a depth image, where a colour image shows the same view."""

from pathlib import Path

import numpy as np

from scanweld.geometry.arrays import ByteArray
from scanweld.io.depth.pixels import read_colors

_SAME_SHAPE = 0.01
"""Relative difference of aspect ratios above which two images do not show the same view."""


def colors_for(
    path: Path, shape: tuple[int, int], *, is_scaled: bool
) -> tuple[ByteArray | None, str]:
    """Colours (H, W, 3) for a depth image, None if the colour image is not aligned to it; a note.

    Args:
        path: Of the colour image.
        shape: (H, W) of the depth image.
        is_scaled: Whether the colour image shows the same view even if its size differs.

    Raises:
        ReadError: If the colour image cannot be read.
    """
    colors = read_colors(path)
    own = (colors.shape[0], colors.shape[1])
    if own == shape:
        return colors, f"colours of {path.name}, taken for aligned to the depths"
    size = f"{own[1]} x {own[0]} pixels"
    if not (is_scaled and is_same_view(own, shape)):
        return None, f"{path.name} has {size}: not aligned to the depths, its colours are left out"
    rows, columns = (
        np.floor((np.arange(n) + 0.5) * m / n).astype(int) for n, m in zip(shape, own, strict=True)
    )
    return colors[rows[:, None], columns], f"colours of {path.name} ({size}), of the same view"


def is_same_view(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether two images (H, W) of one camera have the same proportions."""
    return abs(one[0] * other[1] / (one[1] * other[0]) - 1) <= _SAME_SHAPE
