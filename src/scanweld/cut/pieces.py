"""A frame in pieces at depth jumps, and which of them are the object."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.cut.smoothing import Noise
from scanweld.cut.standing import SURE_SIGMAS
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.grid import GAP_ROUNDS
from scanweld.geometry.mesh import connected

JUMP_PIXELS = 6.0
"""Depth step between neighbours, in footprints of a pixel, above which they are of two pieces."""
MIN_MOVED = 0.05
"""Least share of a piece that must be seen to have moved."""
MIN_PIXELS = 30
"""Least pixels of a piece of the object."""
RIVAL = 0.1
"""Size, as a share of the largest, of what may be the object instead: pieces, and moved patches."""
NEAR_SIZES = 0.4
"""Distance from a piece of the object, in sizes of the main one, of what hangs together with it."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pieces:
    """Pieces of a frame that moved.

    Attributes:
        masks: Flat pixel indices (P,) of each, the largest first.
        points: (P, 3) of each, in the camera's frame.
    """

    masks: tuple[IntArray, ...]
    points: tuple[FloatArray, ...]


def moving_pieces(
    depth: FloatArray, is_above: BoolArray, revealed: BoolArray, noise: Noise, camera: Camera
) -> Pieces:
    """Pieces of what stands above the table that are seen to have moved.

    Args:
        depth: (H, W) of the frame.
        is_above: (H, W) pixels above the table.
        revealed: (H, W) pixels in front of what other frames saw there.
        noise: Of single pixels.
        camera: Of the frames.
    """
    piece = pieces_of(depth, is_above, noise, camera)
    flat = np.flatnonzero(is_above)
    number = piece.ravel()[flat]
    size = np.bincount(number) if len(number) else np.zeros(0, dtype=np.int64)
    moved = np.bincount(number, weights=revealed.ravel()[flat], minlength=len(size))
    chosen = np.flatnonzero((size >= MIN_PIXELS) & (moved >= MIN_MOVED * size))
    chosen = chosen[np.argsort(-size[chosen], kind="stable")]
    points = camera.unproject_image(depth).reshape(-1, 3)
    masks = tuple(flat[number == k] for k in chosen)
    return Pieces(masks=masks, points=tuple(points[mask] for mask in masks))


def pieces_of(depth: FloatArray, is_used: BoolArray, noise: Noise, camera: Camera) -> IntArray:
    """Number (H, W) of the piece of each pixel that is used, across gaps of lost returns too."""
    pixel = np.arange(depth.size).reshape(depth.shape)
    jump = JUMP_PIXELS * depth / camera.fx + SURE_SIGMAS * noise.at(depth)
    first, second = [], []
    for gap in range(1, GAP_ROUNDS + 2):
        for one, other in (
            (np.s_[:, :-gap], np.s_[:, gap:]),
            (np.s_[:-gap], np.s_[gap:]),
        ):
            step = np.abs(depth[one] - depth[other])
            linked = is_used[one] & is_used[other]
            linked &= step <= np.minimum(jump[one], jump[other])
            first.append(pixel[one][linked])
            second.append(pixel[other][linked])
    links = np.concatenate(first), np.concatenate(second)
    return connected(*links, depth.size).reshape(depth.shape)


def piece_around(
    place: FloatArray, radius: float, depth: FloatArray, numbers: IntArray, camera: Camera
) -> IntArray:
    """Flat pixel indices of the piece with most pixels near a place, and what hangs with it.

    Args:
        place: (3,) in the camera's frame.
        radius: Up to where a point is near; pieces that lie elsewhere for the most part are
            other things.
        depth: (H, W) of the frame.
        numbers: (H, W) of the pieces, -1 where there is none.
        camera: Of the frames.
    """
    flat = np.flatnonzero(numbers >= 0)
    points = camera.unproject_image(depth).reshape(-1, 3)
    number = numbers.ravel()[flat]
    near = np.linalg.norm(points[flat] - place, axis=1) <= radius
    size = np.bincount(number) if len(number) else np.zeros(0, dtype=np.int64)
    inside = np.bincount(number, weights=near, minlength=len(size))
    chosen = np.flatnonzero((size >= MIN_PIXELS) & (2 * inside >= size))
    chosen = chosen[np.argsort(-inside[chosen], kind="stable")]
    masks = tuple(flat[number == k] for k in chosen)
    if not masks:
        return np.empty(0, dtype=np.int64)
    pieces = Pieces(masks=masks, points=tuple(points[mask] for mask in masks))
    return np.sort(np.concatenate([masks[k] for k in _together_with(0, pieces)]))


def objects_of(frames: Sequence[Pieces]) -> list[IntArray]:
    """Flat pixel indices of the object in each frame, empty where it is not seen.

    The object is what moves at the same place in most frames; a hand is not. What moves near its
    main piece hangs together with it.
    """
    middles = [np.median(frame.points[0], axis=0) for frame in frames if frame.masks]
    if not middles:
        return [np.empty(0, dtype=np.int64) for _ in frames]
    middle = np.median(middles, axis=0)
    return [_object_of(frame, middle) for frame in frames]


def _object_of(frame: Pieces, middle: FloatArray) -> IntArray:
    if not frame.masks:
        return np.empty(0, dtype=np.int64)
    rivals = [k for k, mask in enumerate(frame.masks) if len(mask) >= RIVAL * len(frame.masks[0])]
    # A part of the object may be nearer to the middle than all of it: whole groups are compared.
    groups = [_together_with(k, frame) for k in rivals]
    middles = [np.median(np.concatenate([frame.points[k] for k in g]), axis=0) for g in groups]
    kept = groups[int(np.argmin([np.linalg.norm(own - middle) for own in middles]))]
    return np.sort(np.concatenate([frame.masks[k] for k in kept]))


def _together_with(main: int, frame: Pieces) -> list[int]:
    """A piece, and those that hang together with it."""
    from scipy.spatial import KDTree

    size = float(np.linalg.norm(np.ptp(frame.points[main], axis=0)))
    kept, rest = [main], [k for k in range(len(frame.masks)) if k != main]
    for k in kept:  # grows as it is read
        tree = KDTree(frame.points[k])
        near = [m for m in rest if tree.query(frame.points[m])[0].min() <= NEAR_SIZES * size]
        kept += near
        rest = [m for m in rest if m not in near]
    return kept
