"""What sets a method apart: how it registers pairs, settles components and refines poses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scanweld.config import Section
from scanweld.evidence.judge import Judge
from scanweld.graph.problem import Settle
from scanweld.graph.refine_graph import Refine
from scanweld.graph.view_graph import Edge
from scanweld.heat.features import Features
from scanweld.pairs.result import PairResult
from scanweld.pipeline.intake import Intake


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scene:
    """The scans of a run, ready to be registered.

    Attributes:
        intake: The scans, prepared, and what users know of them.
        features: PA-HKS keypoints of each scan; None where the settings do without.
        judge: Gives the evidence on any pair at any pose.
    """

    intake: Intake
    features: Sequence[Features | None]
    judge: Judge


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Method:
    """The three steps in which the robust and the published method differ.

    Attributes:
        name: Of the method, for the keys of finished work.
        settings: Sections that a pair's result depends on.
        register: Registers a pair (i, j), i < j, and judges what two scans alone say.
        settle: Refines the poses of a component as it grows.
        refine: Refines all poses of a component together.
    """

    name: str
    settings: Sequence[Section]
    register: Callable[[Edge], PairResult]
    settle: Settle
    refine: Refine
