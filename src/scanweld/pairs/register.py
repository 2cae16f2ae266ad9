"""Two scans -> distinct relative poses with their evidence, from any start pose."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from scanweld.config import PairsConfig
from scanweld.evidence.evidence import VIOLATION_WEIGHT
from scanweld.evidence.field import ScanField
from scanweld.evidence.icp import IcpSchedule, icp
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.evidence.visibility import count_evidence, kernel_view, pose_rows
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.alternatives import (
    alternative_at,
    refined_at,
    schedules,
    to_pose,
)
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.hypotheses import Anchors, search_weights, sweep
from scanweld.pairs.marks import Decided, decide, ties
from scanweld.pairs.result import Alternative, PairResult
from scanweld.pairs.turning import turn_to_mark
from scanweld.pairs.verdict import result_of

SAME_ANGLE_DEG = 8.0
"""Hypotheses that differ by less than this,"""
SAME_SHIFT_DIAMETERS = 0.04
"""and put the middle of j to within this of each other, come to the same."""
MAX_SWEPT = 4000
"""Hypotheses of each set of anchors that are kept at all."""
NUM_RIVALS = 24
"""Distinct poses among which symmetries are looked for, at most."""
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
    anchors: Sequence[tuple[Anchors, Anchors]],
    diameter: float,
    config: PairsConfig,
    polish: Polish | None = None,
    start: Pose | None = None,
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
        start: A pose to be tried besides, judged like those that are found.

    Returns:
        The result, with pose i_from_j between the sensor frames.
    """
    coarse, middle, fine = (t * diameter for t in config.tolerance_diameters)
    far, near = schedules(diameter)
    poses = _swept(field_i, field_j, anchors, config.num_turns, coarse)
    poses = _distinct(poses, field_j, diameter, config.num_survivors[0])
    poses = _refined(field_i, field_j, poses, far, diameter, middle)
    poses = _distinct(poses, field_j, diameter, config.num_survivors[1])
    poses = _refined(field_i, field_j, poses, near, diameter, fine)
    poses = _distinct(poses, field_j, diameter, NUM_RIVALS, rivals=True)
    found = [alternative_at(field_i, field_j, to_pose(row), fine) for row in poses]
    alternatives = _ranked(found[: config.num_alternatives])
    decided = _by_marks(field_i, field_j, _ranked(found), near, fine, diameter, config)
    if decided is not None:
        alternatives = _as_decided(alternatives, decided, field_j, diameter)
    if polish is not None:
        alternatives = _ranked(_polished(field_i, field_j, alternatives, polish, fine))
        # Two that were distinct may have come to the same: an answer is no rival of itself.
        rows = pose_rows([option.i_from_j for option in alternatives])
        kept = _distinct_at(rows, field_j, diameter, len(rows), rivals=True)
        alternatives = [alternatives[k] for k in kept]
    if start is not None:
        given = _from_start(field_i, field_j, start, diameter, fine, polish)
        alternatives = _with_given(alternatives, given, field_j, diameter)
    result = result_of(
        i,
        j,
        field_i,
        field_j,
        tuple(alternatives),
        diameter,
        config,
        is_marked=decided is not None and decided.is_hidden_in_others,
    )
    if decided is not None:
        passed_over = _others(decided.passed_over, alternatives, field_j, diameter)
        return replace(result, passed_over=passed_over)
    tied = ties(_ranked(found), config.min_margin)
    return replace(result, tied_too=_others(tied, alternatives, field_j, diameter))


def _others(
    options: Sequence[Alternative], told: Sequence[Alternative], j: ScanField, diameter: float
) -> tuple[Alternative, ...]:
    """Options that are the same answer as none of those told already, best first."""
    left = [o for o in options if not any(is_same(o, one, j, diameter) for one in told)]
    return tuple(_ranked(left))


def _by_marks(
    i: ScanField,
    j: ScanField,
    alternatives: Sequence[Alternative],
    schedule: IcpSchedule,
    tolerance: float,
    diameter: float,
    config: PairsConfig,
) -> Decided | None:
    """What marks decide among poses that tie."""
    if not alternatives:
        return None

    def refine(poses: Sequence[Pose]) -> list[Alternative]:
        return refined_at(i, j, poses, schedule, tolerance, diameter)

    near = np.radians(RIVAL_ANGLE_DEG), RIVAL_SHIFT_DIAMETERS * diameter
    free = config.min_observability
    turned = turn_to_mark(i, j, alternatives[0].i_from_j, tolerance, diameter, free)
    if turned is not None:
        alternatives = [alternative_at(i, j, turned, tolerance), *alternatives]
    return decide(i, j, alternatives, refine, near, tolerance, diameter, config.min_margin)


def _as_decided(
    alternatives: Sequence[Alternative], decided: Decided, j: ScanField, diameter: float
) -> list[Alternative]:
    """The pose that a mark decides on first, then what never tied with it."""
    others = [
        option
        for option in alternatives
        if not any(
            is_same(option, one, j, diameter) for one in (decided.pose, *decided.passed_over)
        )
    ]
    return [decided.pose, *others]


def _swept(
    i: ScanField,
    j: ScanField,
    anchors: Sequence[tuple[Anchors, Anchors]],
    num_turns: int,
    tolerance: float,
) -> FloatArray:
    """The best hypotheses (N, 12) of all sets of anchors together, best first."""
    swept = [sweep(i, j, a, b, num_turns, tolerance, MAX_SWEPT) for a, b in anchors]
    poses = np.concatenate([poses for poses, _ in swept])
    scores = np.concatenate([scores for _, scores in swept])
    return poses[np.argsort(-scores, kind="stable")]


def _refined(
    i: ScanField,
    j: ScanField,
    poses: FloatArray,
    schedule: IcpSchedule,
    diameter: float,
    tolerance: float,
) -> FloatArray:
    """Poses (N, 12) after ICP, best first by the evidence at that tolerance."""
    poses = icp(i, j, poses, schedule, diameter)
    scores = score_poses(i, j, poses, schedule.num_samples, tolerance)
    return poses[np.argsort(-scores, kind="stable")]


def _ranked(alternatives: Sequence[Alternative]) -> list[Alternative]:
    return sorted(alternatives, key=lambda alternative: -alternative.score)


def _polished(
    i: ScanField,
    j: ScanField,
    alternatives: Sequence[Alternative],
    polish: Polish,
    tolerance: float,
) -> list[Alternative]:
    """The alternatives, the best of them refined once more where the evidence bears it."""
    polished = list(alternatives)
    for k, alternative in enumerate(alternatives[:NUM_POLISHED]):
        if alternative.score > MIN_POLISHED_SCORE:
            option = alternative_at(i, j, polish(alternative.i_from_j), tolerance)
            if option.score > alternative.score - MAX_POLISHING_LOSS:
                polished[k] = option
    return polished


def _from_start(
    i: ScanField,
    j: ScanField,
    start: Pose,
    diameter: float,
    tolerance: float,
    polish: Polish | None,
) -> Alternative:
    """The best of a start pose, refined from near and from far: thin overlap may not pull right."""
    far, near = schedules(diameter)
    rows = pose_rows([start])
    tries = [rows, icp(i, j, rows, near, diameter)]
    tries.append(icp(i, j, icp(i, j, rows, far, diameter), near, diameter))
    options = _ranked([alternative_at(i, j, to_pose(row), tolerance) for (row,) in tries])
    if polish is not None:
        options = _polished(i, j, options[:1], polish, tolerance)
    return replace(options[0], is_given=True)


def _with_given(
    alternatives: Sequence[Alternative], given: Alternative, j: ScanField, diameter: float
) -> list[Alternative]:
    """The alternatives and a given one; where the search found it too, the better of the two."""
    same = [option for option in alternatives if is_same(option, given, j, diameter)]
    if same and same[0].score >= given.score:
        return list(alternatives)
    others = [option for option in alternatives if option not in same]
    return _ranked([*others, replace(given, is_given=not same)])


def is_same(a: Alternative, b: Alternative, j: ScanField, diameter: float) -> bool:
    """Whether two poses of a pair are the same answer, not rivals."""
    apart = a.i_from_j.inverse() @ b.i_from_j
    near = apart.shift_at(j.centre) < RIVAL_SHIFT_DIAMETERS * diameter
    return near and apart.angle_deg() < RIVAL_ANGLE_DEG


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
    return poses[_distinct_at(poses, j, diameter, count, rivals=rivals)]


def _distinct_at(
    poses: FloatArray, j: ScanField, diameter: float, count: int, *, rivals: bool
) -> IntArray:
    angle = np.radians(RIVAL_ANGLE_DEG if rivals else SAME_ANGLE_DEG)
    shift = (RIVAL_SHIFT_DIAMETERS if rivals else SAME_SHIFT_DIAMETERS) * diameter
    return distinct_poses(poses, j.centre, angle, shift, count)
