"""Poses that samples leave tied, decided by a small feature that breaks the object's symmetry.

On an object that is nearly symmetric, every turn by its symmetry explains a few hundred samples
about as well. The turns differ where a feature breaks the symmetry: a worn tooth of one scan comes
to lie before what the other scan saw of a whole tooth, so that its sensor would have seen it. Of a
whole patch of pixels no noise makes that. A pose is refuted if another one has both scans agree on
the very same pixels; what is merely hidden in it refutes nothing.

The places by which a pose refutes its rivals are a feature if they are small: an object that is
like itself by some turns and unlike by others has such places all over. Turns that hide the feature
say that the object has it twice, each time where one of the scans does not look; they are passed
over.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.evidence.patches import (
    MAX_REVERSE,
    MIN_FEATURE_PIXELS,
    PixelConsensus,
    is_refuted_jointly,
    pixel_consensus,
    reverse,
)
from scanweld.evidence.pixels import TwoWay
from scanweld.evidence.rivals import CLEAN_SHARE
from scanweld.evidence.visibility import pose_rows
from scanweld.geometry.arrays import BoolArray
from scanweld.pairs.feature import Contest, feature_of, is_feature
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import Alternative, rival_score

MIN_REFUTED = 3
"""Poses that tie but for the feature, at least: fewer do not show that an object is nearly
symmetric."""
MAX_TURNS = 60
"""Distinct poses of a pair that are looked at; of more, there is a continuum."""
NUM_ROUNDS = 3
"""Rounds in which the motions between the turns found so far lead to new ones."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Decision:
    """What a feature decides.

    Attributes:
        pose: The one pose that explains the feature.
        passed_over: Poses that explain everything else as well, but contradict or hide the feature.
        is_hidden_in_others: Whether some of them hide it. Then the object may have it twice.
    """

    pose: Alternative
    passed_over: tuple[Alternative, ...]
    is_hidden_in_others: bool


def decide(problem: PairProblem, alternatives: Sequence[Alternative]) -> Decision | None:
    """The one pose of a pair that explains a feature, if there are others that tie but for it.

    Args:
        problem: The two scans.
        alternatives: Distinct poses, best first.
    """
    tied = ties(alternatives, problem.config.min_margin)
    if len(tied) < 2:
        return None
    turns = _all_turns(problem, tied)
    if not MIN_REFUTED < len(turns) <= MAX_TURNS:
        return None
    seen = [problem.pixels(option.i_from_j) for option in turns]
    consensus = [_consensus(both, problem.tolerance) for both in seen]
    if not any(one.violates.any() for both in consensus for one in both):
        return None
    refuted = _refutations(consensus)
    best = int(np.argmax(refuted.sum(axis=1)))
    if refuted[best].sum() < MIN_REFUTED or refuted[:, best].any() or not _is_clean(turns[best]):
        return None
    hidden = [both for k, both in enumerate(seen) if k != best and not refuted[best, k]]
    contest = Contest(seen=seen, consensus=consensus, best=best, tolerance=problem.tolerance)
    feature = feature_of(contest, np.flatnonzero(refuted[best]).tolist())
    if hidden and not is_feature(feature, problem, hidden):
        return None
    others = [o for o in alternatives if not any(o is t for t in turns) and not _is_clean(o)]
    worse = [o for o in others if _is_worse(problem, o, consensus[best])]
    return Decision(
        pose=turns[best],
        passed_over=(*(t for t in turns if t is not turns[best]), *worse),
        is_hidden_in_others=bool(hidden),
    )


def _consensus(both: TwoWay, tolerance: float) -> list[PixelConsensus]:
    return [pixel_consensus([one], tolerance) for one in both]


def _refutations(consensus: Sequence[Sequence[PixelConsensus]]) -> BoolArray:
    """(N, N) whether pose a (row) refutes pose b (column)."""
    n = len(consensus)
    return np.array(
        [
            [a != b and is_refuted_jointly(consensus[b], consensus[a]) for b in range(n)]
            for a in range(n)
        ]
    )


def _is_worse(problem: PairProblem, rival: Alternative, pose: Sequence[PixelConsensus]) -> bool:
    """Whether patches of any size, wherever they are, contradict a rival and none the pose."""
    consensus = _consensus(problem.pixels(rival.i_from_j), problem.tolerance)
    against = sum(int(np.count_nonzero(one.violates)) for one in consensus)
    return against >= MIN_FEATURE_PIXELS and reverse(consensus, pose) <= MAX_REVERSE * against


def ties(alternatives: Sequence[Alternative], max_margin: float) -> list[Alternative]:
    """The best pose, and those that explain the scans about as well without contradictions."""
    if not alternatives:
        return []
    best = alternatives[0]
    return [best, *(o for o in alternatives[1:] if _is_tie(o, best, max_margin))]


def _is_tie(option: Alternative, best: Alternative, max_margin: float) -> bool:
    return _is_clean(option) and rival_score(option, best) >= (1.0 - max_margin) * best.score


def _is_clean(option: Alternative) -> bool:
    return option.evidence.violation <= CLEAN_SHARE * option.evidence.agree


def _all_turns(problem: PairProblem, tied: list[Alternative]) -> list[Alternative]:
    """All poses that the motions between tied poses lead to and that tie as well."""
    near, max_margin = problem.rival_tolerance, problem.config.min_margin
    turns, tried = list(tied), list(tied)
    for _ in range(NUM_ROUNDS):
        motions = [turns[0].i_from_j.inverse() @ option.i_from_j for option in turns[1:]]
        motions += [motion.inverse() for motion in motions]
        reached = [option.i_from_j @ motion for option in turns for motion in motions]
        known = [option.i_from_j for option in tried]
        chosen = problem.distinct(pose_rows(known + reached), near, MAX_TURNS + len(known))
        new = problem.refine([reached[k - len(known)] for k in chosen if k >= len(known)])
        tried += new
        better = [option for option in new if _is_tie(option, tied[0], max_margin)]
        rows = pose_rows([option.i_from_j for option in turns + better])
        kept = problem.distinct(rows, near, MAX_TURNS + 1)
        count, turns = len(turns), [(turns + better)[k] for k in kept]
        if len(turns) == count or len(turns) > MAX_TURNS:
            break
    return turns
