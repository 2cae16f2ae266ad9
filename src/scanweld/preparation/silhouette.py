"""What the empty pixels of a range image say: free space, or nothing."""

import numpy as np

from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray
from scanweld.geometry.prepared import PixelKind


def classify_pixels(
    is_surface: BoolArray, in_view: BoolArray, blind: BoolArray, closing_pixels: float
) -> tuple[ByteArray, FloatArray]:
    """Kinds of the pixels, and how far the free ones lie from the closed silhouette.

    Only pixels outside the closed and filled silhouette are free: gaps in it may be dropouts or
    shadows as well as air. Nothing is free beyond the field of view, nor in gaps that its border
    cuts off. Where it is known that nothing came back the outline may lie anywhere: what is free
    there has no distance from it, and what is free beyond has the distance from all of this.

    Args:
        is_surface: (H, W) pixels with a depth; the border, as wide as the closing, is empty.
        in_view: (H, W) pixels that the sensor could see at all.
        blind: (H, W) pixels off the surface of which it is known that nothing came back.
        closing_pixels: Radius of the closing.

    Returns:
        Kinds (H, W) and distances (H, W) in pixels, 0 inside the silhouette and where blind.
    """
    silhouette = close(is_surface, closing_pixels)
    is_free = _surroundings(in_view & ~silhouette, in_view)
    kind = np.full(is_surface.shape, PixelKind.UNKNOWN, dtype=np.uint8)
    kind[is_free] = PixelKind.FREE
    kind[is_surface] = PixelKind.SURFACE
    grown = _joined(silhouette, blind & is_free)
    outside = distance_to(grown | (in_view & ~is_free))
    return kind, np.where(is_free & ~blind, outside, 0.0)


def _joined(silhouette: BoolArray, blind: BoolArray) -> BoolArray:
    """A silhouette (H, W) with the blind regions (H, W) that touch it."""
    from scipy import ndimage

    if not blind.any():
        return silhouette
    region = np.zeros(blind.shape, dtype=np.int64)
    ndimage.label(blind, np.ones((3, 3)), output=region)
    beside = np.asarray(ndimage.binary_dilation(silhouette, np.ones((3, 3))), dtype=np.bool_)
    touches = np.bincount(region[beside], minlength=int(region.max()) + 1) > 0
    touches[0] = False
    return silhouette | touches[region]


def _surroundings(empty: BoolArray, in_view: BoolArray) -> BoolArray:
    """Of the connected empty regions (H, W), the one with most of the field of view's border."""
    from scipy import ndimage

    region = np.zeros(empty.shape, dtype=np.int64)
    ndimage.label(empty, output=region)
    border = empty & ~np.asarray(ndimage.binary_erosion(in_view), dtype=np.bool_)
    length = np.bincount(region[border])
    return region == np.argmax(length) if border.any() else np.zeros_like(empty)


def close(mask: BoolArray, radius: float) -> BoolArray:
    """Morphological closing (H, W) by a disc: grown by the radius, then shrunk by it."""
    if radius <= 0 or not mask.any():
        return mask.copy()
    grown = distance_to(mask) <= radius
    return (distance_to(~grown) > radius) | mask


def distance_to(mask: BoolArray) -> FloatArray:
    """Distance (H, W) in pixels to the nearest pixel of a mask."""
    from scipy import ndimage

    return np.asarray(ndimage.distance_transform_edt(~mask), dtype=np.float64)
