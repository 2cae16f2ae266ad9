"""Pose hypotheses from oriented points: any start pose, every pair of anchors, every turn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.evidence.evidence import CONTRADICT_WEIGHT, VIOLATION_WEIGHT
from scanweld.evidence.field import ScanField
from scanweld.evidence.visibility import (
    AGREE,
    CONTRADICT,
    FREE,
    FRONT,
    ask_backward,
    ask_forward,
    kernel_view,
)
from scanweld.geometry.arrays import FloatArray, frozen

NUM_FIRST_LOOK = 8
"""Samples of each scan that decide whether a hypothesis is looked at again,"""
NUM_SECOND_LOOK = 64
"""and that its score rests on."""
FIRST_LOOK_FLOOR = -0.35
"""Score of the first few samples below which a hypothesis is not looked at again."""

MIN_SWEPT_AGREE = 0.05
"""Share of samples that must agree: else poses that touch nothing, and so violate nothing, crowd
out those near the right one, where a thin object violates more than it agrees."""

SEARCH_FREE_WEIGHT = 1.0
"""The silhouette guides the search more than it speaks against an answer: real ones have gaps."""
SWEEP_VIOLATION_WEIGHT = 2.5
"""Violations count a little less in the sweep: hypotheses near the right one still violate."""


def search_weights(violation: float) -> FloatArray:
    """Weights (7,) of the kinds of evidence while searching; read-only, as kernels take them."""
    weights = np.zeros(7)
    weights[AGREE] = 1.0
    weights[FRONT] = -violation
    weights[CONTRADICT] = -violation * CONTRADICT_WEIGHT / VIOLATION_WEIGHT
    weights[FREE] = -SEARCH_FREE_WEIGHT
    weights.flags.writeable = False
    return weights


SWEEP_WEIGHTS = search_weights(SWEEP_VIOLATION_WEIGHT)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Anchors:
    """Oriented points (K, 3), with unit normals (K, 3), on which hypotheses are hung."""

    points: FloatArray
    normals: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, np.float64, (None, 3)))
        object.__setattr__(self, "normals", frozen(self.normals, np.float64, (len(self.points), 3)))

    def frames(self) -> FloatArray:
        """(K, 12): for each anchor a rotation whose third column is the normal, then the point."""
        n = self.normals
        least = np.eye(3)[np.argmin(np.abs(n), axis=1)]
        x = np.cross(least, n).astype(np.float64)
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        rotation = np.stack([x, np.cross(n, x), n], axis=2)
        rows = np.column_stack([rotation.reshape(-1, 9), self.points])
        return np.ascontiguousarray(rows, dtype=np.float64)


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
    angles = 2 * np.pi * np.arange(num_turns) / num_turns
    turns = np.column_stack([np.cos(angles), np.sin(angles)])
    frames_i, frames_j = anchors_i.frames(), anchors_j.frames()
    scores = _score_all(
        *kernel_view(i), *kernel_view(j), frames_i, frames_j, turns, SWEEP_WEIGHTS, tolerance
    )
    flat = scores.ravel()
    order = np.argsort(-flat, kind="stable")[:max_count]
    order = order[flat[order] > FIRST_LOOK_FLOOR]
    a, b, turn = np.unravel_index(order, scores.shape)
    poses = np.zeros((len(order), 12))
    for row in range(len(order)):
        _hang(frames_i[a[row]], frames_j[b[row]], turns[turn[row]], poses[row])
    return poses, flat[order]


@njit(cache=True, nogil=True)
def _hang(frame_i: FloatArray, frame_j: FloatArray, turn: FloatArray, pose: FloatArray) -> None:
    """i_from_j = frame_i turned about its normal, after the inverse of frame_j."""
    c, s = turn[0], turn[1]
    for r in range(3):
        x, y, n = frame_i[3 * r], frame_i[3 * r + 1], frame_i[3 * r + 2]
        x, y = c * x + s * y, c * y - s * x
        for k in range(3):
            pose[3 * r + k] = x * frame_j[3 * k] + y * frame_j[3 * k + 1] + n * frame_j[3 * k + 2]
    for r in range(3):
        pose[9 + r] = frame_i[9 + r] - (
            pose[3 * r] * frame_j[9] + pose[3 * r + 1] * frame_j[10] + pose[3 * r + 2] * frame_j[11]
        )


@njit(cache=True, nogil=True)
def _score_all(
    camera_i: FloatArray,
    raster_i: NDArray[np.float32],
    points_i: FloatArray,
    normals_i: FloatArray,
    camera_j: FloatArray,
    raster_j: NDArray[np.float32],
    points_j: FloatArray,
    normals_j: FloatArray,
    frames_i: FloatArray,
    frames_j: FloatArray,
    turns: FloatArray,
    weights: FloatArray,
    tolerance: float,
) -> FloatArray:
    """Scores (A, B, T) of all anchors of i, anchors of j and turns; -inf for what was given up.

    The first looks decide about most; the samples come in an order in which few are spread evenly.
    """
    scores = np.full((frames_i.shape[0], frames_j.shape[0], turns.shape[0]), -np.inf)
    num = min(NUM_SECOND_LOOK, points_i.shape[0], points_j.shape[0])
    pose = np.empty(12)
    for a in range(frames_i.shape[0]):
        for b in range(frames_j.shape[0]):
            for t in range(turns.shape[0]):
                _hang(frames_i[a], frames_j[b], turns[t], pose)
                total, agreed = 0.0, 0
                for s in range(num):
                    if s == NUM_FIRST_LOOK and total < 2 * NUM_FIRST_LOOK * FIRST_LOOK_FLOOR:
                        break
                    there = ask_backward(
                        camera_j, raster_j, points_i[s], normals_i[s], pose, tolerance
                    )
                    back = ask_forward(
                        camera_i, raster_i, points_j[s], normals_j[s], pose, tolerance
                    )
                    total += weights[there] + weights[back]
                    agreed += int(there == AGREE) + int(back == AGREE)
                else:
                    if agreed >= MIN_SWEPT_AGREE * 2 * num:
                        scores[a, b, t] = total / (2 * num)
    return scores
