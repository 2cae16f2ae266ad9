"""Registers the pairs of a run: quickly, at a pose that is known, or thoroughly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scanweld.config import Config
from scanweld.contours.coherence import ContourMatcher
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import Features
from scanweld.pairs.anchors import pair_anchors
from scanweld.pairs.polish import JointPolish
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.quick import ask, search_quickly
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairResult

Edge = tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairRegistrar:
    """All that registering any pair of a run takes.

    Attributes:
        scans: All scans.
        fields: The scans, laid out.
        contours: Finds contour matches of two scans.
        config: Settings.
        starts: Poses i_from_j of some pairs, between sensor frames, to be tried besides.
    """

    scans: Sequence[PreparedScan]
    fields: Sequence[ScanField]
    contours: ContourMatcher
    config: Config
    starts: Mapping[Edge, Pose] = field(default_factory=dict)

    def problem(self, edge: Edge) -> PairProblem:
        """The two scans of a pair (i, j), i < j."""
        i, j = (self.fields[k] for k in edge)
        config = self.config.pairs
        return PairProblem(edge=edge, i=i, j=j, config=config)

    def search_quickly(self, edge: Edge) -> PairResult:
        """A quick search of a pair (i, j), i < j, from any start pose."""
        return search_quickly(self.problem(edge), self.starts.get(edge))

    def ask(self, edge: Edge, i_from_j: Pose, found: PairResult | None) -> PairResult:
        """A pair (i, j), i < j, at the pose that other pairs say, beside what was found of it."""
        return ask(self.problem(edge), i_from_j, found)

    def register(self, edge: Edge, features: Mapping[int, Features]) -> PairResult:
        """Register a pair (i, j), i < j, thoroughly, from any start pose.

        Args:
            edge: The pair.
            features: PA-HKS keypoints of its scans, unless the settings do without.
        """
        problem = self.problem(edge)
        polish = JointPolish(
            scans=self.scans,
            edge=edge,
            centre_j=problem.j.centre,
            diameter=problem.diameter,
            contours=self.contours,
            config=self.config.refine,
        )
        sets = [pair_anchors(self.fields[k], features.get(k), self.config.pairs) for k in edge]
        return register_pair(problem, list(zip(*sets, strict=True)), polish, self.starts.get(edge))
