"""Two scans -> distinct relative poses with their evidence, from any start pose."""

from collections.abc import Callable

import numpy as np

from scanweld.config import PairsConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.field import ScanField
from scanweld.pairs.hypotheses import Anchors, search_weights, sweep
from scanweld.pairs.icp import IcpSchedule, information_of, refine_poses
from scanweld.pairs.result import VIOLATION_WEIGHT, Alternative, PairResult
from scanweld.pairs.verdict import judge_pair
from scanweld.pairs.visibility import count_evidence, judge, kernel_view, mean_evidence, pose_rows

SAME_ANGLE_DEG = 8.0
SAME_SHIFT_DIAMETERS = 0.04
RIVAL_ANGLE_DEG = 12.0
RIVAL_SHIFT_DIAMETERS = 0.06
MAX_SWEPT = 4000
NUM_COARSE_SAMPLES = 200
NUM_FINE_SAMPLES = 400
RANKING_WEIGHTS = search_weights(VIOLATION_WEIGHT)
NUM_POLISHED = 2
"""Alternatives that are refined with all points and contours, at most."""
MIN_POLISHED_SCORE = -0.1
"""Score below which an alternative is not worth it."""
MAX_POLISHING_LOSS = 0.04
"""Score that a refinement may cost: the search has looked for samples that agree by chance."""

Polish = Callable[[Pose], Pose]
"""A refinement of i_from_j for the two scans at hand, sensor frames."""


def register_pair(
    i: int,
    j: int,
    field_i: ScanField,
    field_j: ScanField,
    anchors: list[tuple[Anchors, Anchors]],
    diameter: float,
    config: PairsConfig,
    polish: Polish | None = None,
) -> PairResult:
    """Find the poses that explain two scans best, coarse to fine, whatever their frames are.

    Args:
        i: Index of the first scan,
        j: of the second, i < j.
        field_i: The first scan, laid out.
        field_j: The second.
        anchors: Sets of anchors of i and j; all pairs within a set are tried.
        diameter: Diameter of the run.
        config: Settings.
        polish: Refines the best poses once more; what makes the evidence worse is not taken.

    Returns:
        The result, with pose i_from_j between the sensor frames.
    """
    coarse, middle, fine = (t * diameter for t in config.tolerance_diameters)
    swept = [sweep(field_i, field_j, a, b, config.num_turns, coarse, MAX_SWEPT) for a, b in anchors]
    poses = np.concatenate([p for p, _ in swept])
    scores = np.concatenate([s for _, s in swept])
    order = np.argsort(-scores, kind="stable")
    poses = _distinct(poses[order], field_j, diameter, config.num_survivors[0])

    far = IcpSchedule(
        num_rounds=8,
        first_radius=0.08 * diameter,
        last_radius=0.03 * diameter,
        num_samples=NUM_COARSE_SAMPLES,
    )
    near = IcpSchedule(
        num_rounds=15,
        first_radius=0.05 * diameter,
        last_radius=0.01 * diameter,
        num_samples=NUM_FINE_SAMPLES,
    )
    for schedule, tolerance, count in (
        (far, middle, config.num_survivors[1]),
        (near, fine, config.num_alternatives),
    ):
        poses = refine_poses(field_i, field_j, poses, schedule, diameter)
        scores = score_poses(field_i, field_j, poses, schedule.num_samples, tolerance)
        poses = poses[np.argsort(-scores, kind="stable")]
        is_last = schedule is near
        poses = _distinct(poses, field_j, diameter, count, rivals=is_last)
    alternatives = [alternative_at(field_i, field_j, to_pose(row), fine) for row in poses]
    alternatives.sort(key=lambda alternative: -alternative.score)
    for k, alternative in enumerate(alternatives[:NUM_POLISHED]):
        if polish is not None and alternative.score > MIN_POLISHED_SCORE:
            polished = alternative_at(field_i, field_j, polish(alternative.i_from_j), fine)
            if polished.score > alternative.score - MAX_POLISHING_LOSS:
                alternatives[k] = polished
    alternatives.sort(key=lambda alternative: -alternative.score)
    return _result(i, j, field_i, field_j, tuple(alternatives), diameter, config)


def score_poses(
    i: ScanField, j: ScanField, poses: FloatArray, num_samples: int, tolerance: float
) -> FloatArray:
    """Scores (N,) of pose rows (N, 12) by the first samples of each scan."""
    counts = count_evidence(*kernel_view(i), *kernel_view(j), poses, num_samples, tolerance)
    total = np.maximum(counts.sum(axis=2), 1)
    return ((counts @ RANKING_WEIGHTS) / total).mean(axis=1)


def _distinct(
    poses: FloatArray, j: ScanField, diameter: float, count: int, *, rivals: bool = False
) -> FloatArray:
    angle = np.radians(RIVAL_ANGLE_DEG if rivals else SAME_ANGLE_DEG)
    shift = (RIVAL_SHIFT_DIAMETERS if rivals else SAME_SHIFT_DIAMETERS) * diameter
    return poses[distinct_poses(poses, j.centre, angle, shift, count)]


def _result(
    i: int,
    j: int,
    field_i: ScanField,
    field_j: ScanField,
    alternatives: tuple[Alternative, ...],
    diameter: float,
    config: PairsConfig,
) -> PairResult:
    information, rms = np.zeros((6, 6)), float("nan")
    if alternatives:
        radius = config.tolerance_diameters[2] * diameter
        (row,) = pose_rows([alternatives[0].i_from_j])
        information, rms, _ = information_of(field_i, field_j, row, radius, diameter)
    return judge_pair(i, j, alternatives, information, rms, config)


def alternative_at(i: ScanField, j: ScanField, i_from_j: Pose, tolerance: float) -> Alternative:
    """A pose with its full evidence."""
    evidence = mean_evidence(*judge(i, j, i_from_j, tolerance))
    return Alternative(i_from_j=i_from_j, evidence=evidence, overlap=evidence.agree)


def to_pose(row: FloatArray) -> Pose:
    """The pose of a kernel's row (12,)."""
    return Pose(rotation=nearest_rotation(row[:9].reshape(3, 3)), translation=row[9:])
