"""One unknown axis: scans that were taken on a turntable relate by rotations about it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.axis import Axis, fit_axis
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.doubts import DoubtCode, Doubts, doubt_of
from scanweld.graph.view_graph import Edge, ViewGraph
from scanweld.pairs.result import PairKind, PairResult


@dataclass(frozen=True, kw_only=True, slots=True)
class AxisRule:
    """When an axis is believed, and a scan to turn about it.

    Attributes:
        min_turn_deg: A pair that turns by less says little about the axis.
        min_scans: Any one motion without a pitch is a turn about some axis: it takes two pairs
            that agree.
        min_share: Of the scans that have good pairs, more must turn about an axis together.
        num_fits: Fits, each to the pairs that agree with the one before.
        final_share: Poses in the end lie closer to the axis than pairs alone: to this share of
            their tolerance,
        final_residuals: or to so many times the residual of the good pairs, if that is more.
    """

    min_turn_deg: float = 10.0
    min_scans: int = 3
    min_share: float = 0.5
    num_fits: int = 3
    final_share: float = 0.2
    final_residuals: float = 4.0


RULE = AxisRule()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Turntable:
    """The common axis, and how well the good pairs turn about it.

    Attributes:
        axis: In the frame in which the sensor stood still.
        frames: Pose of each scan's sensor frame in that frame.
        centres: (3,) middle of each scan's samples, sensor frame.
        same: A pose that is off by less is on the axis.
        edges: Good pairs that it rests on.
        num_scans: Scans that these hold together.
        angle_deg: Root mean square of the angles by which these are off.
        shift: The same of the shifts of the middles, in the scans' unit.
    """

    axis: Axis
    frames: Sequence[Pose]
    centres: Sequence[FloatArray]
    same: PoseTolerance
    edges: tuple[Edge, ...] = ()
    num_scans: int = 0
    angle_deg: float = 0.0
    shift: float = 0.0

    def off_axis(self, edge: Edge, i_from_j: Pose) -> tuple[float, float]:
        """How far a pose between sensor frames is off any turn: degrees, shift of j's middle."""
        i, j = edge
        motion = self.frames[i] @ i_from_j @ self.frames[j].inverse()
        apart = self.axis.nearest_turn(motion).inverse() @ motion
        return apart.angle_deg(), apart.shift_at(self.frames[j].apply(self.centres[j]))

    def allows(self, edge: Edge, i_from_j: Pose) -> bool:
        """Whether a pose between sensor frames is a turn about the axis."""
        angle, shift = self.off_axis(edge, i_from_j)
        return angle < self.same.angle_deg and shift < self.same.shift

    def off_axis_words(self, edge: Edge, i_from_j: Pose) -> str:
        """That a pose is no turn about the axis, and by how much."""
        angle, shift = self.off_axis(edge, i_from_j)
        if angle >= self.same.angle_deg:
            return f"off the turntable's axis by {angle:.1f} deg"
        times = shift / self.same.shift
        return f"off the turntable's axis: shifted {times:.1f} times what is allowed"


def find_turntable(
    pairs: Mapping[Edge, PairResult],
    frames: Sequence[Sequence[Pose]],
    centres: Sequence[FloatArray],
    same: PoseTolerance,
) -> Turntable | None:
    """The axis about which most scans turn, by their good pairs; None where too few agree.

    A sensor that stands still before a turntable sees all scans turn about one line in its own
    frame. Which frames are the sensor's own is tried: those that were found for the sensors, and
    those of the files, which scanners often write in their own.

    Args:
        pairs: Results of pairs (i, j), i < j.
        frames: Choices of the pose of every scan's sensor frame in the frame that stood still.
        centres: (3,) middle of each scan's samples, sensor frame.
        same: A pose that is off by less is on the axis.
    """
    good = turning_pairs(pairs)
    best: Turntable | None = None
    for choice in frames:
        found = _consensus(good, choice, centres, same)
        if found is not None and (best is None or _weight(found, good) > _weight(best, good)):
            best = found
    turning = {k for edge in good for k in edge}
    if best is None or best.num_scans < max(RULE.min_scans, RULE.min_share * len(turning) + 0.5):
        return None
    return best


def off_axis_doubts(graph: ViewGraph, turntable: Turntable) -> Doubts:
    """Placed scans whose final pose is no turn about the axis from others: thin pairs slide."""
    same = np.array([turntable.same.angle_deg, turntable.same.shift])
    residual = np.array([turntable.angle_deg, turntable.shift])
    limits = np.maximum(RULE.final_share * same, RULE.final_residuals * residual)
    told: dict[int, str] = {}
    for component in graph.components:
        poses = component.poses
        for k in sorted(poses):
            others = [m for m in sorted(poses) if m != k]
            off = [turntable.off_axis((m, k), poses[m].inverse() @ poses[k]) for m in others]
            angle, shift = np.median(off, axis=0)
            if angle > limits[0] or shift > limits[1]:
                times = max(angle / limits[0], shift / limits[1])
                told[k] = f"its pose is {angle:.1f} deg off the axis, {times:.1f} times the limit"
    return doubt_of(DoubtCode.OFF_AXIS, told)


def turning_pairs(pairs: Mapping[Edge, PairResult]) -> dict[Edge, PairResult]:
    """Good pairs that turn far enough to say where the axis is."""
    return {
        edge: pair
        for edge, pair in sorted(pairs.items())
        if pair.kind is PairKind.GOOD
        and pair.alternatives[0].i_from_j.angle_deg() > RULE.min_turn_deg
    }


def _weight(turntable: Turntable, good: Mapping[Edge, PairResult]) -> tuple[int, float]:
    """Scans first: one scan off the axis can have as many good pairs as all others together."""
    return turntable.num_scans, sum(good[edge].alternatives[0].score for edge in turntable.edges)


def _num_joined(edges: Sequence[Edge]) -> int:
    """Scans in the largest set that edges join."""
    groups: list[set[int]] = []
    for edge in edges:
        touched = [group for group in groups if group & set(edge)]
        groups = [group for group in groups if group not in touched]
        groups.append(set(edge).union(*touched))
    return max((len(group) for group in groups), default=0)


def _consensus(
    good: Mapping[Edge, PairResult],
    frames: Sequence[Pose],
    centres: Sequence[FloatArray],
    same: PoseTolerance,
) -> Turntable | None:
    """The axis that most scans agree with, each good pair's own axis tried first."""
    best: Turntable | None = None
    for seed in good:
        found: Turntable | None = None
        edges: tuple[Edge, ...] = (seed,)
        for _ in range(RULE.num_fits):
            motions = [
                frames[i] @ good[i, j].alternatives[0].i_from_j @ frames[j].inverse()
                for i, j in edges
            ]
            middle = np.mean([frames[j].apply(centres[j]) for _, j in edges], axis=0)
            axis = fit_axis(motions, middle)
            found = Turntable(axis=axis, frames=frames, centres=centres, same=same)
            edges = tuple(
                edge for edge in good if found.allows(edge, good[edge].alternatives[0].i_from_j)
            )
            if not edges:
                break
        if found is not None and edges:
            found = _with_residual(found, edges, good)
            if best is None or _weight(found, good) > _weight(best, good):
                best = found
    return best


def _with_residual(
    found: Turntable, edges: tuple[Edge, ...], good: Mapping[Edge, PairResult]
) -> Turntable:
    off = np.array([found.off_axis(edge, good[edge].alternatives[0].i_from_j) for edge in edges])
    angle, shift = np.sqrt((off**2).mean(axis=0))
    return Turntable(
        axis=found.axis,
        frames=found.frames,
        centres=found.centres,
        same=found.same,
        edges=edges,
        num_scans=_num_joined(edges),
        angle_deg=float(angle),
        shift=float(shift),
    )
