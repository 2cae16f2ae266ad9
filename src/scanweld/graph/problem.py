"""What the view graph is built from, and what attempts at building it have found out."""

import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from scanweld.config import GraphConfig
from scanweld.evidence.evidence import MIN_AGREE
from scanweld.evidence.judge import PairJudge, Poses
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.merge import Merge, propose_merges, unrefuted
from scanweld.graph.view_graph import Edge
from scanweld.pairs.result import PairResult

Settle = Callable[[Poses], Poses]
"""Refines the poses of a component a little, so that chains of pairs do not drift."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class GraphProblem:
    """Pairs to be put together, and who judges and settles what comes of it.

    Attributes:
        pairs: Results of pairs (i, j), i < j.
        centres: (3,) middle of each scan's samples, sensor frame.
        same: Poses of a scan that differ by less are the same.
        judge: Gives the evidence on any pair at any pose.
        settle: Refines a component's poses.
        config: Settings.
        apart: Pairs whose scans no merge may lay onto each other.
        initial: Components that are there already.
    """

    pairs: Mapping[Edge, PairResult]
    centres: Sequence[FloatArray]
    same: PoseTolerance
    judge: PairJudge
    settle: Settle
    config: GraphConfig
    apart: Collection[Edge]
    initial: Sequence[Poses] = ()
    _merges: dict[tuple[bytes, bytes], list[Merge]] = field(default_factory=dict)
    _settled: dict[bytes, Poses] = field(default_factory=dict)

    def merges(self, a: Poses, b: Poses) -> list[Merge]:
        """Distinct ways to merge two components, best first, that lay no scans apart together."""
        key = _content(a), _content(b)
        if key not in self._merges:
            proposed = propose_merges(a, b, self.pairs, self.centres, self.same, self.judge)
            merges = unrefuted(a, b, proposed, self.judge)
            self._merges[key] = [m for m in merges if not self.joins_apart(a, b, m)]
        return self._merges[key]

    def settled(self, poses: Poses) -> Poses:
        """The poses of a component, refined a little; two scans are as their pair has them."""
        if len(poses) < 3:
            return poses
        key = _content(poses)
        if key not in self._settled:
            self._settled[key] = self.settle(poses)
        return self._settled[key]

    def joins_apart(self, a: Poses, b: Poses, merge: Merge) -> bool:
        """Whether a merge lays scans onto each other that are apart."""
        for i, j in self.apart:
            first, second = (i, j) if i in a else (j, i)
            if first in a and second in b:
                pose = a[first].inverse() @ merge.a_from_b @ b[second]
                if self.judge.pair(first, second, pose).agree >= MIN_AGREE:
                    return True
        return False


def _content(poses: Poses) -> bytes:
    """A hash of which scans a component holds, and exactly where."""
    digest = hashlib.sha256()
    for k, pose in poses.items():
        digest.update(b"%d" % k + pose.rotation.tobytes() + pose.translation.tobytes())
    return digest.digest()
