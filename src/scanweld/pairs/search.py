"""Search: distinct poses that explain two scans, coarse to fine, whatever their frames are."""

from collections.abc import Sequence

import numpy as np

from scanweld.evidence.evidence import VIOLATION_WEIGHT
from scanweld.evidence.field import ScanField
from scanweld.evidence.icp import IcpSchedule, icp
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.evidence.visibility import count_evidence, kernel_view
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.pairs.hypotheses import Anchors, search_weights, sweep
from scanweld.pairs.problem import PairProblem, schedules, to_pose
from scanweld.pairs.result import Alternative

HYPOTHESIS_SHARE = 2.0 / 3.0
"""Hypotheses come to the same if they differ by less than this share of what makes rivals."""
MAX_SWEPT = 4000
"""Hypotheses of each set of anchors that are kept at all."""
NUM_RIVALS = 24
"""Distinct poses among which symmetries are looked for, at most."""
RANKING_WEIGHTS = search_weights(VIOLATION_WEIGHT)


def search(
    problem: PairProblem,
    anchors: Sequence[tuple[Anchors, Anchors]],
    num_survivors: tuple[int, int],
) -> list[Alternative]:
    """Distinct poses of a pair with their evidence, in the order of the search's own score.

    Args:
        problem: The two scans.
        anchors: Sets of anchors of i and j; all pairs within a set are tried.
        num_survivors: Hypotheses that are kept for the first and for the second refinement.
    """
    config, diameter = problem.config, problem.diameter
    coarse, middle, fine = (t * diameter for t in config.tolerance_diameters)
    far, near = schedules(diameter)
    hypotheses = same_hypothesis(diameter)
    poses = _swept(problem, anchors, coarse)
    poses = poses[problem.distinct(poses, hypotheses, num_survivors[0])]
    poses = _refined(problem, poses, far, middle)
    poses = poses[problem.distinct(poses, hypotheses, num_survivors[1])]
    poses = _refined(problem, poses, near, fine)
    poses = poses[problem.distinct(poses, problem.rival_tolerance, NUM_RIVALS)]
    return [problem.evaluate(to_pose(row)) for row in poses]


def same_hypothesis(diameter: float) -> PoseTolerance:
    """Hypotheses that differ by less come to the same."""
    return PoseTolerance(
        angle_deg=HYPOTHESIS_SHARE * RIVAL_ANGLE_DEG,
        shift=HYPOTHESIS_SHARE * RIVAL_SHIFT_DIAMETERS * diameter,
    )


def score_poses(
    i: ScanField, j: ScanField, poses: FloatArray, num_samples: int, tolerance: float
) -> FloatArray:
    """Scores (N,) of pose rows (N, 12) by the first samples of each scan."""
    counts = count_evidence(*kernel_view(i), *kernel_view(j), poses, num_samples, tolerance)
    total = np.maximum(counts.sum(axis=2), 1)
    return ((counts @ RANKING_WEIGHTS) / total).mean(axis=1)


def _swept(
    problem: PairProblem, anchors: Sequence[tuple[Anchors, Anchors]], tolerance: float
) -> FloatArray:
    """The best hypotheses (N, 12) of all sets of anchors together, best first."""
    num_turns = problem.config.num_turns
    swept = [sweep(problem.i, problem.j, a, b, num_turns, tolerance, MAX_SWEPT) for a, b in anchors]
    poses = np.concatenate([poses for poses, _ in swept])
    scores = np.concatenate([scores for _, scores in swept])
    return poses[np.argsort(-scores, kind="stable")]


def _refined(
    problem: PairProblem, poses: FloatArray, schedule: IcpSchedule, tolerance: float
) -> FloatArray:
    """Poses (N, 12) after ICP, best first by the evidence at that tolerance."""
    poses = icp(problem.i, problem.j, poses, schedule, problem.diameter)
    scores = score_poses(problem.i, problem.j, poses, schedule.num_samples, tolerance)
    return poses[np.argsort(-scores, kind="stable")]
