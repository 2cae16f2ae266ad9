"""Marks: small places where all pixels of two scans tell poses apart that samples leave tied.

On an object that is nearly symmetric, every turn by its symmetry explains a few hundred samples
about as well. The turns differ where the one mark lies: a worn tooth of one scan comes to lie
before what the other scan saw of a whole tooth, so that its sensor would have seen it. Of a whole
patch of pixels no noise makes that. A pose is refuted if another one has both scans agree on the
very same pixels; what is merely hidden in it refutes nothing.

The places by which a pose refutes its rivals are a mark if they are small: an object that is like
itself by some turns and unlike by others has such places all over. Turns that hide the mark say
that the object has it twice, each time where one of the scans does not look; they are passed over.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from scanweld.evidence.field import RASTER_DEPTH, ScanField
from scanweld.evidence.patches import (
    MAX_REVERSE,
    MIN_MARK_PIXELS,
    Told,
    agrees,
    coherent,
    is_refuted_jointly,
    reverse,
    told_of,
)
from scanweld.evidence.pixels import TwoWay, fallen_on, see
from scanweld.evidence.rivals import CLEAN_SHARE
from scanweld.evidence.visibility import pose_rows
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.result import Alternative, rival_score

MIN_SAYING = 0.25
"""Share of the refuted poses that a mark's place refutes."""
MARK_DIAMETERS = 0.15
"""Most of a mark lies within this of its middle."""
MOST = 0.9
"""How much that is."""
MIN_REFUTED = 3
"""Poses that tie but for the mark, at least: fewer do not show that an object is near-symmetric."""
MAX_TURNS = 60
"""Distinct poses of a pair that are looked at; of more, there is a continuum."""
NUM_ROUNDS = 3


Refine = Callable[[Sequence[Pose]], list[Alternative]]
"""Refines poses i_from_j of the pair at hand, and gives them their evidence."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Decided:
    """What a mark decides.

    Attributes:
        pose: The one pose that explains the mark.
        passed_over: Poses that explain everything else as well, but contradict or hide the mark.
        is_hidden_in_others: Whether some of them hide it. Then the object may have it twice.
    """

    pose: Alternative
    passed_over: tuple[Alternative, ...]
    is_hidden_in_others: bool


def decide(
    i: ScanField,
    j: ScanField,
    alternatives: Sequence[Alternative],
    refine: Refine,
    near: tuple[float, float],
    tolerance: float,
    diameter: float,
    max_margin: float,
) -> Decided | None:
    """The one pose of a pair that explains a mark, if there are others that tie but for it.

    Args:
        i: First scan.
        j: Second scan.
        alternatives: Distinct poses, best first.
        refine: Refines poses.
        near: Angle (radians) and shift of j's middle within which two poses are the same.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        diameter: Diameter of the run.
        max_margin: Share of its score by which the best pose does not beat those that tie.
    """
    tied = ties(alternatives, max_margin)
    if len(tied) < 2:
        return None
    turns = _all_turns(tied, j.centre, refine, near, max_margin)
    if not MIN_REFUTED < len(turns) <= MAX_TURNS:
        return None
    seen = [see(i, j, option.i_from_j, diameter) for option in turns]
    told = [[told_of([one], tolerance) for one in both] for both in seen]
    if not any(one.violates.any() for both in told for one in both):
        return None
    n = len(turns)
    refuted = np.array(
        [[a != b and is_refuted_jointly(told[b], told[a]) for b in range(n)] for a in range(n)]
    )
    a = int(np.argmax(refuted.sum(axis=1)))
    if refuted[a].sum() < MIN_REFUTED or refuted[:, a].any() or not _is_clean(turns[a]):
        return None
    hidden = [seen[b] for b in range(n) if b != a and not refuted[a, b]]
    marks = _marks_of(seen, told, a, np.flatnonzero(refuted[a]).tolist(), tolerance)
    if hidden and not _is_mark(marks, (i, j), hidden, tolerance, diameter):
        return None
    others = [o for o in alternatives if not any(o is t for t in turns) and not _is_clean(o)]
    worse = [o for o in others if _is_worse(see(i, j, o.i_from_j, diameter), told[a], tolerance)]
    return Decided(
        pose=turns[a],
        passed_over=(*(t for t in turns if t is not turns[a]), *worse),
        is_hidden_in_others=bool(hidden),
    )


def _is_worse(rival: TwoWay, pose: Sequence[Told], tolerance: float) -> bool:
    """Whether patches of any size, wherever they are, contradict a rival and none the pose."""
    told = [told_of([one], tolerance) for one in rival]
    against = sum(int(np.count_nonzero(one.violates)) for one in told)
    return against >= MIN_MARK_PIXELS and reverse(told, pose) <= MAX_REVERSE * against


def _is_mark(
    marks: tuple[BoolArray, BoolArray],
    scans: tuple[ScanField, ScanField],
    hidden: Sequence[TwoWay],
    tolerance: float,
    diameter: float,
) -> bool:
    """Whether places that both scans show are small, and hidden in the poses left."""
    if min(int(mark.sum()) for mark in marks) < MIN_MARK_PIXELS:
        return False
    if not all(_is_small(s, mark, diameter) for s, mark in zip(scans, marks, strict=True)):
        return False
    most = MAX_REVERSE * sum(int(mark.sum()) for mark in marks)
    return all(
        sum(
            int((agrees(one.behind, tolerance) & mark).sum())
            for one, mark in zip(both, marks, strict=True)
        )
        <= most
        for both in hidden
    )


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


def _all_turns(
    ties: list[Alternative],
    centre_j: FloatArray,
    refine: Refine,
    near: tuple[float, float],
    max_margin: float,
) -> list[Alternative]:
    """All poses that the motions between tied poses lead to and that tie as well."""
    turns, tried = list(ties), list(ties)
    for _ in range(NUM_ROUNDS):
        motions = [turns[0].i_from_j.inverse() @ option.i_from_j for option in turns[1:]]
        motions += [motion.inverse() for motion in motions]
        reached = [option.i_from_j @ motion for option in turns for motion in motions]
        known = [option.i_from_j for option in tried]
        chosen = distinct_poses(pose_rows(known + reached), centre_j, *near, MAX_TURNS + len(known))
        new = refine([reached[k - len(known)] for k in chosen if k >= len(known)])
        tried += new
        better = [option for option in new if _is_tie(option, ties[0], max_margin)]
        rows = pose_rows([option.i_from_j for option in turns + better])
        kept = distinct_poses(rows, centre_j, *near, MAX_TURNS + 1)
        count, turns = len(turns), [(turns + better)[k] for k in kept]
        if len(turns) == count or len(turns) > MAX_TURNS:
            break
    return turns


def _marks_of(
    seen: Sequence[TwoWay],
    told: Sequence[Sequence[Told]],
    a: int,
    refuted: Sequence[int],
    tolerance: float,
) -> tuple[BoolArray, BoolArray]:
    """Pixels of both scans at which many poses are refuted by pose a, each where it agrees.

    A place that sticks out is itself contradicted; a place that is lacking contradicts what the
    other scan saw in its stead. What a mark comes to lie on is another place in each pose.
    """
    votes = [np.zeros(one.behind.shape, dtype=np.int64) for one in seen[a]]
    for b in refuted:
        contested = [np.zeros(one.behind.shape, dtype=bool) for one in seen[a]]
        for k in (0, 1):
            against = told[b][k].violates & told[a][k].agrees
            contested[k] |= against
            contested[1 - k] |= fallen_on(seen[b][k], against, contested[1 - k].shape)
        for vote, place in zip(votes, contested, strict=True):
            vote += ndimage.binary_dilation(place)
    least = max(2.0, MIN_SAYING * len(refuted))
    one, other = (
        coherent((vote >= least) & agrees(own.behind, tolerance))
        for vote, own in zip(votes, seen[a], strict=True)
    )
    # What a mark agrees with is the same mark, if seen too aslant to be contradicted elsewhere.
    on_one = fallen_on(seen[a][1], other, one.shape)
    on_other = fallen_on(seen[a][0], one, other.shape)
    return one | on_one, other | on_other


def _is_small(scan: ScanField, mark: BoolArray, diameter: float) -> bool:
    """Whether most of a mark lies close to its middle."""
    rows, columns = np.nonzero(mark)
    if not len(rows):
        return True
    depth = scan.raster[rows, columns, RASTER_DEPTH].astype(np.float64)
    is_pinhole = scan.camera[0] == 0.0
    scale = depth if is_pinhole else np.ones_like(depth)
    x = (columns - scan.camera[3]) / scan.camera[1] * scale
    y = (rows - scan.camera[4]) / scan.camera[2] * scale
    points = np.stack([x, y, depth], axis=1)
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    return float(np.quantile(away, MOST)) < MARK_DIAMETERS * diameter
