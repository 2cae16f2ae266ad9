"""How far poses of pairs miss each other around cycles: what a sensor's bent depth does to them.

Depth that is bent over a whole scan hides from a pair: its pose gives way until the surfaces lie on
each other. But it gives way differently in every pair, so that cycles of pairs do not close. What
is left open is by how much surfaces lie apart once all scans have one pose each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import shortest_path

from scanweld.evidence.field import ScanField
from scanweld.evidence.rivals import RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.result import PairKind, PairResult
from scanweld.sensor.certain import Edge

MIN_CYCLES = 2
"""One cycle may close, or not, by chance."""
USUAL_MISCLOSURE = 2.0
"""How far a pair moves a scan amiss as a rule, over the distance between surfaces that coincide
(mean of the 33 sets of the calibration that have cycles)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Closure:
    """How far cycles of pairs do not close.

    Attributes:
        displacement: Root mean square distance by which one pair moves a scan's samples amiss, in
            the scans' unit.
        num_cycles: Cycles that tell it.
    """

    displacement: float
    num_cycles: int

    def misclosure(self, apart: float) -> float:
        """How far the pose of one pair moves a scan amiss, in the scans' unit.

        What cycles show; what is usual of such surfaces where too few close.

        Args:
            apart: Distance between surfaces of a pair that coincide, in the scans' unit.
        """
        if self.num_cycles < MIN_CYCLES:
            return USUAL_MISCLOSURE * apart
        return self.displacement


NO_CYCLES = Closure(displacement=0.0, num_cycles=0)


def closure_of(
    pairs: Mapping[Edge, PairResult], fields: Sequence[ScanField], diameter: float
) -> Closure:
    """How far one pair moves a scan's samples amiss, as cycles of pairs show it.

    Good pairs make a tree, the strongest first; every other good pair closes a cycle of it, and
    errors of the pairs around a cycle add up like independent ones. The median over the cycles
    that close: where a pair moves samples as far as rival poses are apart, some pair is wrong.
    Fewer than two cycles tell nothing.

    Args:
        pairs: All pairs, judged.
        fields: All scans, laid out.
        diameter: Of the run, in the scans' unit.
    """
    good = sorted(
        (pair for pair in pairs.values() if pair.kind is PairKind.GOOD),
        key=lambda pair: (-pair.alternatives[0].score, pair.i, pair.j),
    )
    home, in_tree = _strongest_tree(good, len(fields))
    steps = shortest_path(in_tree, directed=False, unweighted=True)
    most = RIVAL_SHIFT_DIAMETERS * diameter
    found = []
    for pair in good:
        if in_tree[pair.i, pair.j]:
            continue
        poses, samples = home[pair.i], fields[pair.j].points
        amiss = poses[pair.j].inverse() @ poses[pair.i] @ pair.alternatives[0].i_from_j
        moved = np.linalg.norm(amiss.apply(samples) - samples, axis=1)
        length = np.sqrt(1.0 + steps[pair.i, pair.j])
        if (each := float(np.sqrt(np.mean(moved**2))) / length) < most:
            found.append(each)
    if len(found) < MIN_CYCLES:
        return NO_CYCLES
    return Closure(displacement=float(np.median(found)), num_cycles=len(found))


def _strongest_tree(
    pairs: Sequence[PairResult], num_scans: int
) -> tuple[dict[int, dict[int, Pose]], BoolArray]:
    """The poses of each scan's tree, by scan, and which pairs (N, N), i < j, make the trees."""
    home = {k: {k: Pose.identity()} for k in range(num_scans)}
    in_tree = np.zeros((num_scans, num_scans), dtype=bool)
    for pair in pairs:
        a, b = home[pair.i], home[pair.j]
        if a is b:
            continue
        in_tree[pair.i, pair.j] = True
        a_from_b = a[pair.i] @ pair.alternatives[0].i_from_j @ b[pair.j].inverse()
        a.update({k: a_from_b @ pose for k, pose in b.items()})
        home.update(dict.fromkeys(b, a))
    return home, in_tree
