"""Registers the pairs of a run: the search, then the best poses refined."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scanweld.config import Config
from scanweld.contours.coherence import ContourMatcher
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import Features
from scanweld.pairs.anchors import pair_anchors
from scanweld.pairs.hypotheses import Anchors
from scanweld.pairs.polish import JointPolish
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairResult

Edge = tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairRegistrar:
    """All that registering any pair of a run takes.

    Attributes:
        scans: All scans.
        anchors: Sets of anchors of each scan.
        fields: The scans, laid out.
        contours: Finds contour matches of two scans.
        config: Settings.
        starts: Poses i_from_j of some pairs, between sensor frames, to be tried besides.
    """

    scans: Sequence[PreparedScan]
    anchors: Sequence[tuple[Anchors, ...]]
    fields: Sequence[ScanField]
    contours: ContourMatcher
    config: Config
    starts: Mapping[Edge, Pose] = field(default_factory=dict)

    def problem(self, edge: Edge) -> PairProblem:
        """The two scans of a pair (i, j), i < j."""
        i, j = (self.fields[k] for k in edge)
        config = self.config.pairs
        return PairProblem(edge=edge, i=i, j=j, config=config)

    def register(self, edge: Edge) -> PairResult:
        """Register a pair (i, j), i < j, from any start pose."""
        i, j = edge
        problem = self.problem(edge)
        polish = JointPolish(
            scans=self.scans,
            edge=edge,
            centre_j=problem.j.centre,
            diameter=problem.diameter,
            contours=self.contours,
            config=self.config.refine,
        )
        both = list(zip(self.anchors[i], self.anchors[j], strict=True))
        return register_pair(problem, both, polish, self.starts.get(edge))


def pair_registrar(
    scans: Sequence[PreparedScan],
    features: Sequence[Features | None],
    fields: Sequence[ScanField],
    contours: ContourMatcher,
    config: Config,
    starts: Mapping[Edge, Pose] | None = None,
) -> PairRegistrar:
    """What registers any pair of the given scans.

    Args:
        scans: All scans.
        features: Their PA-HKS keypoints, or None.
        fields: The scans, laid out.
        contours: Finds contour matches of two scans.
        config: Settings.
        starts: Poses i_from_j of some pairs, between sensor frames, to be tried besides.
    """
    anchors = [
        pair_anchors(field, found, config.pairs)
        for field, found in zip(fields, features, strict=True)
    ]
    return PairRegistrar(
        scans=scans,
        anchors=anchors,
        fields=fields,
        contours=contours,
        config=config,
        starts=starts or {},
    )
