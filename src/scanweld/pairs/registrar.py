"""Registers a pair of a run: quickly, at a pose that is known, or thoroughly.

All that it takes can be pickled and is of two scans only, so that it can be done anywhere.
"""

from dataclasses import dataclass

from scanweld.config import Config
from scanweld.contours.coherence import ContourMatcher
from scanweld.contours.contour_sets import ObservedContours, observe_contours
from scanweld.evidence.field import ScanField, make_field
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
class PairScan:
    """What registering its pairs thoroughly takes of a scan.

    Attributes:
        prepared: The scan.
        field: The same, laid out.
        contours: Its contours.
        features: Its PA-HKS keypoints; None where the settings do without.
    """

    prepared: PreparedScan
    field: ScanField
    contours: ObservedContours
    features: Features | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairTask:
    """A pair to be registered.

    Attributes:
        edge: Indices (i, j), i < j.
        start: A pose i_from_j between the sensor frames that users want to be tried besides.
        asked: The pose that other pairs say.
        found: What a quick search found.
    """

    edge: Edge
    start: Pose | None = None
    asked: Pose | None = None
    found: PairResult | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairRegistrar:
    """Registers pairs by the robust method.

    Attributes:
        config: Settings.
    """

    config: Config

    def search_quickly(self, task: PairTask, i: ScanField, j: ScanField) -> PairResult:
        """A quick search of a pair, from any start pose."""
        return search_quickly(self._problem(task, i, j), task.start)

    def ask(self, task: PairTask, i: ScanField, j: ScanField) -> PairResult:
        """A pair at the pose that other pairs say, beside what was found of it.

        Raises:
            ValueError: If the task names no pose.
        """
        if task.asked is None:
            raise ValueError("there is no pose to ask about")
        return ask(self._problem(task, i, j), task.asked, task.found)

    def register(self, task: PairTask, i: PairScan, j: PairScan) -> PairResult:
        """Register a pair thoroughly, from any start pose."""
        problem = self._problem(task, i.field, j.field)
        both = (i, j)
        contours = ContourMatcher(
            observed=[scan.contours for scan in both], config=self.config.contours
        )
        polish = JointPolish(
            scans=[scan.prepared for scan in both],
            edge=(0, 1),
            centre_j=problem.j.centre,
            diameter=problem.diameter,
            contours=contours,
            config=self.config.refine,
        )
        sets = [pair_anchors(scan.field, scan.features, self.config.pairs) for scan in both]
        return register_pair(problem, list(zip(*sets, strict=True)), polish, task.start)

    def scan(self, prepared: PreparedScan, features: Features | None = None) -> PairScan:
        """What ``register`` takes of a scan."""
        contours = observe_contours(prepared, self.config.contours)
        field = make_field(prepared)
        return PairScan(prepared=prepared, field=field, contours=contours, features=features)

    def _problem(self, task: PairTask, i: ScanField, j: ScanField) -> PairProblem:
        return PairProblem(edge=task.edge, i=i, j=j, config=self.config.pairs)
