"""Pose hypotheses from oriented points: any start pose, every pair of anchors, every turn.

An anchor of j is laid onto one of i, normal on normal, in a number of turns about it. A hypothesis
is scored by a few samples of each scan in a coarse copy of the other's range image, and given up as
soon as they speak clearly against it. The scores rank; what is kept is judged anew.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanweld.evidence.evidence import CONTRADICT_WEIGHT, GRAZING_WEIGHT, VIOLATION_WEIGHT
from scanweld.evidence.field import (
    RASTER_DEPTH,
    RASTER_KIND,
    RASTER_NORMAL,
    RASTER_OUTSIDE,
    ScanField,
)
from scanweld.evidence.visibility import AGREE, CONTRADICT, FREE, FRONT, GRAZING, UNKNOWN
from scanweld.geometry.arrays import FloatArray, frozen
from scanweld.geometry.prepared import PixelKind
from scanweld.pairs.hypothesis_scores import score_all

Single = NDArray[np.float32]

NUM_LOOKS = 64
"""Samples of each scan that the score of a hypothesis rests on."""
LOOK_AFTER = (4, 8, 16, 32)
LOOK_FLOORS = (-0.6, -0.4, -0.33, -0.25)
"""After so many samples of each scan, a hypothesis scored below is given up. Of the real pairs that
overlap by 5 %, the good hypotheses near the truth score at least -0.47, -0.25, -0.27, -0.12."""
CELL_DIAMETERS = 0.01
"""Edge of a pixel of the coarse range image: a quarter of the tolerance by which it is asked."""
SEARCH_FREE_WEIGHT = 1.0
"""The silhouette guides the search more than it speaks against an answer: real ones have gaps."""
SWEEP_VIOLATION_WEIGHT = 2.5
"""Violations count a little less in the sweep: hypotheses near the right one still violate."""


def search_weights(violation: float) -> FloatArray:
    """Weights (8,) of the kinds of evidence while searching; read-only, as kernels take them."""
    weights = np.zeros(8)
    weights[AGREE] = 1.0
    weights[FRONT] = -violation
    weights[CONTRADICT] = -violation * CONTRADICT_WEIGHT / VIOLATION_WEIGHT
    weights[FREE] = -SEARCH_FREE_WEIGHT
    weights[GRAZING] = -GRAZING_WEIGHT
    weights.flags.writeable = False
    return weights


SWEEP_WEIGHTS = search_weights(SWEEP_VIOLATION_WEIGHT)[
    [AGREE, FRONT, CONTRADICT, FREE, UNKNOWN]
].astype(np.float32)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Anchors:
    """Oriented points (K, 3), with unit normals (K, 3), on which hypotheses are hung."""

    points: FloatArray
    normals: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, np.float64, (None, 3)))
        object.__setattr__(self, "normals", frozen(self.normals, np.float64, (len(self.points), 3)))

    def first(self, number: int) -> "Anchors":
        """The first of them."""
        return Anchors(points=self.points[:number], normals=self.normals[:number])

    def rotations(self) -> FloatArray:
        """(K, 3, 3): for each anchor a rotation whose third column is the normal."""
        n = self.normals
        least = np.eye(3)[np.argmin(np.abs(n), axis=1)]
        x = np.cross(least, n).astype(np.float64)
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        y = np.cross(n, x).astype(np.float64)
        return np.stack([x, y, n], axis=2)


def sweep(
    i: ScanField,
    j: ScanField,
    anchors_i: Anchors,
    anchors_j: Anchors,
    num_turns: int,
    tolerance: float,
    max_count: int,
) -> tuple[FloatArray, FloatArray]:
    """The best-scored hypotheses that lay an anchor of j onto one of i.

    Args:
        i: First scan.
        j: Second scan.
        anchors_i: Anchors of i.
        anchors_j: Anchors of j.
        num_turns: Turns about the normal tried for each pair of anchors.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        max_count: How many are kept.

    Returns:
        Pose rows (K, 12) of i_from_j, best first, and their scores (K,).
    """
    if len(anchors_i.points) == 0 or len(anchors_j.points) == 0:
        return np.zeros((0, 12)), np.zeros(0)
    hung_i, hung_j = _hung(anchors_i, num_turns, 1.0), _hung(anchors_j, num_turns, -1.0)
    scores = np.full((len(anchors_i.points), len(anchors_j.points), num_turns), -np.inf, np.float32)
    score_all(
        *_coarse_image(i), *_seen_from(anchors_i, i), hung_i, anchors_i.points.astype(np.float32),
        *_coarse_image(j), *_seen_from(anchors_j, j), hung_j, anchors_j.points.astype(np.float32),
        SWEEP_WEIGHTS, _looks(i, j), np.float32(tolerance), scores,
    )  # fmt: skip
    left = np.flatnonzero(scores.ravel() > -np.inf)
    left = left[np.argsort(-scores.ravel()[left], kind="stable")[:max_count]]
    a, b, turn = np.unravel_index(left, scores.shape)
    rotations = _turned(anchors_i, num_turns, 1.0)[a, turn] @ anchors_j.rotations()[b].mT
    shifts = anchors_i.points[a] - np.einsum("nrk,nk->nr", rotations, anchors_j.points[b])
    rows = np.column_stack([rotations.reshape(-1, 9), shifts])
    return rows, scores.ravel()[left].astype(np.float64)


def _turned(anchors: Anchors, num_turns: int, sense: float) -> FloatArray:
    """(K, T, 3, 3) the anchors' rotations turned about their normals."""
    angles = sense * 2 * np.pi * np.arange(num_turns) / num_turns
    turns = np.zeros((num_turns, 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0], turns[:, 0, 1] = np.sin(angles), -np.sin(angles)
    turns[:, 2, 2] = 1.0
    return anchors.rotations()[:, None] @ turns


def _hung(anchors: Anchors, num_turns: int, sense: float) -> Single:
    return _turned(anchors, num_turns, sense).astype(np.float32)


def _looks(i: ScanField, j: ScanField) -> FloatArray:
    """(L, 2) samples of each scan and the least sum of weights after so many; last all of them."""
    num = min(NUM_LOOKS, len(i.points), len(j.points))
    floors = [(n, 2 * n * f) for n, f in zip(LOOK_AFTER, LOOK_FLOORS, strict=True) if n < num]
    return np.array([*floors, (num, -np.inf)])


def _seen_from(anchors: Anchors, scan: ScanField) -> tuple[Single, Single]:
    """(K, 3, S) the scan's first samples, and their normals, in the frame of each anchor."""
    rotations = anchors.rotations()
    apart = scan.points[None, :NUM_LOOKS] - anchors.points[:, None]
    normals = np.broadcast_to(scan.normals[None, :NUM_LOOKS], apart.shape)
    both = ((vectors @ rotations).astype(np.float32).mT for vectors in (apart, normals))
    points, turned = map(np.ascontiguousarray, both)
    return points, turned


def _coarse_image(scan: ScanField) -> tuple[Single, Single]:
    """The range image at a coarser pixel: (H, W, 4) cells, and (5,) its camera.

    A cell is depth and normal; off the surface an infinite depth, and how far it lies outside the
    silhouette, which is minus infinity where it is unknown what the sensor sees.
    """
    is_pinhole = scan.camera[0] == 0.0
    footprint = (scan.centre[2] if is_pinhole else 1.0) / scan.camera[1]
    stride = max(1, int(CELL_DIAMETERS * scan.diameter / footprint))
    first = stride // 2
    raster = scan.raster[first::stride, first::stride]
    cells = np.empty((*raster.shape[:2], 4), np.float32)
    cells[..., 0] = raster[..., RASTER_DEPTH]
    cells[..., 1:] = raster[..., RASTER_NORMAL : RASTER_NORMAL + 3]
    off = raster[..., RASTER_KIND] != PixelKind.SURFACE
    is_free = raster[..., RASTER_KIND] == PixelKind.FREE
    cells[off, 0] = np.inf
    cells[off, 1] = np.where(is_free, raster[..., RASTER_OUTSIDE], -np.inf)[off]
    model, focal, centre = scan.camera[:1], scan.camera[1:3] / stride, scan.camera[3:5] - first
    return cells, np.concatenate([model, focal, centre / stride]).astype(np.float32)
