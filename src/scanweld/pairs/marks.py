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
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PixelKind
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.field import RASTER_DEPTH, RASTER_KIND, RASTER_NORMAL, ScanField
from scanweld.pairs.result import CLEAN_SHARE, Alternative, rival_score
from scanweld.pairs.visibility import pose_rows

JUMP_PIXELS = 6.0
"""Depths of four neighbouring pixels that differ by more, in footprints, make no surface."""
AGREE_TOLERANCES = 0.5
"""Farthest that a pixel lies from the other scan's surface where it agrees with it."""
MIN_PATCH_PIXELS = 8
"""Pixels that hang together and all say the same, at least, to be told from chance."""
MIN_MARK_PIXELS = 10
"""Pixels in such patches that refute a pose, or make a mark, at least."""
MAX_REVERSE = 0.1
"""Share of them that may speak against the other pose; share of a mark that a rival may show."""
MAJORITY = 0.6
"""Share of the 3 x 3 pixels around one that must say the same: strips along edges are too thin."""
MIN_SAYING = 0.25
"""Share of the refuted poses that a mark's place refutes."""
MARK_DIAMETERS = 0.15
"""Most of a mark lies within this of its middle."""
MOST = 0.9
"""How much that is."""
MAX_MARK_AREA = 0.02
"""Of a mark and what it comes to lie on, in squared diameters."""
MIN_REFUTED = 3
"""Poses that tie but for the mark, at least: fewer do not show that an object is near-symmetric."""
MAX_TURNS = 60
"""Distinct poses of a pair that are looked at; of more, there is a continuum."""
NUM_ROUNDS = 3

IS_SURFACE = float(PixelKind.SURFACE)

Refine = Callable[[Sequence[Pose]], list[Alternative]]
"""Refines poses i_from_j of the pair at hand, and gives them their evidence."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Seen:
    """All pixels of a scan in what another one saw, at a pose.

    Attributes:
        behind: (H, W) distance behind the other scan's surface; NaN without a say.
        lands: (H, W) index of the pixel that they fall on; -1 without a say.
        max_pixels: So many may a mark and what it comes to lie on have in this scan.
    """

    behind: NDArray[np.float32]
    lands: NDArray[np.int32]
    max_pixels: float


TwoWay = tuple[Seen, Seen]
"""Of the pixels of i in what j saw, and of those of j in what i saw."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Told:
    """What the sensors of several scans say of all pixels of another one.

    Attributes:
        agrees: (H, W) pixels that lie on the surface that any of them saw, and before none.
        violates: (H, W) pixels of patches that lie before the surface that any of them saw.
        max_pixels: So many may a mark and what it comes to lie on have.
    """

    agrees: BoolArray
    violates: BoolArray
    max_pixels: float


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
    ties = _ties(alternatives, max_margin)
    if len(ties) < 2:
        return None
    turns = _all_turns(ties, j.centre, refine, near, max_margin)
    if len(turns) > MAX_TURNS:
        return None
    if len(turns) <= MIN_REFUTED:
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
    """Whether patches of any size speak against a rival and none for it."""
    told = [told_of([one], tolerance) for one in rival]
    against = sum(_counts_against(told, pose))
    return against >= MIN_MARK_PIXELS and _reverse(told, pose) <= MAX_REVERSE * against


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
            int((_agrees(one.behind, tolerance) & mark).sum())
            for one, mark in zip(both, marks, strict=True)
        )
        <= most
        for both in hidden
    )


def _ties(alternatives: Sequence[Alternative], max_margin: float) -> list[Alternative]:
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


def _agrees(behind: NDArray[np.float32], tolerance: float) -> BoolArray:
    return np.abs(behind) < AGREE_TOLERANCES * tolerance


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
            contested[1 - k].ravel()[seen[b][k].lands[against]] = True
        for vote, place in zip(votes, contested, strict=True):
            vote += ndimage.binary_dilation(place)
    least = max(2.0, MIN_SAYING * len(refuted))
    one, other = (
        _coherent((vote >= least) & _agrees(own.behind, tolerance))
        for vote, own in zip(votes, seen[a], strict=True)
    )
    return one, other


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


def see(i: ScanField, j: ScanField, i_from_j: Pose, diameter: float) -> TwoWay:
    """All pixels of both scans in what the other saw."""
    forward, backward = pose_rows([i_from_j, i_from_j.inverse()])
    of_i = _seen(i.camera, i.raster, j.camera, j.raster, backward)
    of_j = _seen(j.camera, j.raster, i.camera, i.raster, forward)
    return (
        Seen(behind=of_i[0], lands=of_i[1], max_pixels=_max_pixels(i, diameter)),
        Seen(behind=of_j[0], lands=of_j[1], max_pixels=_max_pixels(j, diameter)),
    )


def _max_pixels(scan: ScanField, diameter: float) -> float:
    """How many of a scan's pixels the largest mark and what it lies on may have."""
    footprint = (scan.centre[2] if scan.camera[0] == 0.0 else 1.0) / scan.camera[1]
    return float(MAX_MARK_AREA * (diameter / footprint) ** 2)


def told_of(seen: Sequence[Seen], tolerance: float) -> Told:
    """Sum up what several sensors say of the pixels of one scan."""
    violates = np.any([one.behind < -tolerance for one in seen], axis=0)
    agrees = np.any([_agrees(one.behind, tolerance) for one in seen], axis=0)
    return Told(
        agrees=agrees & ~violates, violates=_coherent(violates), max_pixels=seen[0].max_pixels
    )


def pixels_against(rival: Sequence[Told], pose: Sequence[Told]) -> int:
    """Pixels of patches that are contradicted in a rival and agreed with in a pose.

    They must be few enough, in each scan, to be a mark: else the poses differ all over.
    """
    counts = _counts_against(rival, pose)
    is_small = all(n <= one.max_pixels for n, one in zip(counts, pose, strict=True))
    return sum(counts) if is_small else 0


def _counts_against(rival: Sequence[Told], pose: Sequence[Told]) -> list[int]:
    return [int(np.count_nonzero(b.violates & a.agrees)) for b, a in zip(rival, pose, strict=True)]


def is_refuted_jointly(rival: Sequence[Told], pose: Sequence[Told]) -> bool:
    """Whether patches of pixels of any scans speak for their poses and against rival ones."""
    against = pixels_against(rival, pose)
    if against < MIN_MARK_PIXELS:
        return False
    return _reverse(rival, pose) <= MAX_REVERSE * against


def _reverse(rival: Sequence[Told], pose: Sequence[Told]) -> int:
    """Pixels of patches that are contradicted in a pose and not in its rival."""
    return sum(
        int(np.count_nonzero(a.violates & ~b.violates)) for b, a in zip(rival, pose, strict=True)
    )


def _coherent(said: BoolArray) -> BoolArray:
    """Those pixels of a mask that hang together in sufficient numbers."""
    if np.count_nonzero(said) < MIN_PATCH_PIXELS:
        return np.zeros_like(said)
    most = ndimage.uniform_filter(said.astype(np.float32), 3, mode="constant") > MAJORITY
    labels = np.zeros(said.shape, dtype=np.int32)
    ndimage.label(most & said, output=labels)
    is_large = np.bincount(labels.ravel()) >= MIN_PATCH_PIXELS
    is_large[0] = False
    return is_large[labels]


@njit(cache=True, nogil=True)
def _seen(
    camera_from: FloatArray,
    raster_from: NDArray[np.float32],
    camera_to: FloatArray,
    raster_to: NDArray[np.float32],
    pose: FloatArray,
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """How far behind (H, W) one scan's pixels lie in another's raster, and where they fall on it.

    The pose row is to_from.
    """
    height, width = raster_from.shape[0], raster_from.shape[1]
    rows, columns = raster_to.shape[0], raster_to.shape[1]
    behind = np.full((height, width), np.nan, dtype=np.float32)
    lands = np.full((height, width), -1, dtype=np.int32)
    for r in range(height):
        for c in range(width):
            if raster_from[r, c, RASTER_KIND] != IS_SURFACE:
                continue
            depth = float(raster_from[r, c, RASTER_DEPTH])
            a, b = (c - camera_from[3]) / camera_from[1], (r - camera_from[4]) / camera_from[2]
            if camera_from[0] == 0.0:
                a *= depth
                b *= depth
            x = pose[0] * a + pose[1] * b + pose[2] * depth + pose[9]
            y = pose[3] * a + pose[4] * b + pose[5] * depth + pose[10]
            z = pose[6] * a + pose[7] * b + pose[8] * depth + pose[11]
            u, v = camera_to[1] * x, camera_to[2] * y
            if camera_to[0] == 0.0:
                if z <= 0.0:
                    continue
                u /= z
                v /= z
            u += camera_to[3]
            v += camera_to[4]
            if not (0.0 <= u < columns - 1.0 and 0.0 <= v < rows - 1.0):
                continue
            q, p = int(u), int(v)
            low, high, seen = np.inf, -np.inf, 0.0
            is_surface = True
            for dp in range(2):
                for dq in range(2):
                    if raster_to[p + dp, q + dq, RASTER_KIND] != IS_SURFACE:
                        is_surface = False
                    at = float(raster_to[p + dp, q + dq, RASTER_DEPTH])
                    low, high = min(low, at), max(high, at)
                    across = u - q if dq == 1 else 1.0 - (u - q)
                    along = v - p if dp == 1 else 1.0 - (v - p)
                    seen += across * along * at
            footprint = 1.0 / camera_to[1]
            if camera_to[0] == 0.0:
                footprint *= low
            if not is_surface or high - low > JUMP_PIXELS * footprint:
                continue
            near_p, near_q = int(v + 0.5), int(u + 0.5)
            n = RASTER_NORMAL
            nx = float(raster_to[near_p, near_q, n])
            ny = float(raster_to[near_p, near_q, n + 1])
            nz = float(raster_to[near_p, near_q, n + 2])
            # A step along the ray, as a distance from the surface.
            is_pinhole = camera_to[0] == 0.0
            tilt = abs(nx * x + ny * y + nz * z) / z if is_pinhole else abs(nz)
            behind[r, c] = (z - seen) * min(tilt, 1.0)
            lands[r, c] = near_p * columns + near_q
    return behind, lands
