"""What sets a method apart: how it registers pairs, settles components and refines poses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from scanweld.config import Section
from scanweld.contours.coherence import ContourMatcher
from scanweld.evidence.field import ScanField
from scanweld.evidence.judge import Judge, Poses
from scanweld.graph.refine_graph import Refined
from scanweld.graph.view_graph import Edge
from scanweld.heat.features import Features
from scanweld.pairs.registrar import PairScan, PairTask
from scanweld.pairs.result import PairResult
from scanweld.pipeline.intake import Intake
from scanweld.sensor.model import SensorModel


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scene:
    """The scans of a run, ready to be registered.

    Attributes:
        intake: The scans, prepared, and what users know of them.
        judge: Gives the evidence on any pair at any pose.
        features: PA-HKS keypoints of the scans for which something asked for them.
        sensor: What the set says of its sensor; None before its pairs are known.
        margin: How far from silhouettes the judge takes empty pixels for free, in the scans' unit.
    """

    intake: Intake
    judge: Judge
    features: Mapping[int, Features] = field(default_factory=dict)
    sensor: SensorModel | None = None
    margin: float = 0.0

    @property
    def known_sensor(self) -> SensorModel:
        """The same, once it is known.

        Raises:
            ValueError: If it is not.
        """
        if self.sensor is None:
            raise ValueError("the pairs of the run say what its sensor does: register them first")
        return self.sensor


Settle = Callable[[SensorModel | None, Poses], Poses]
"""Refines, by what is known of the sensor, the poses of a component as it grows."""
Refine = Callable[[SensorModel, Poses, Sequence[Edge], Sequence[Edge]], Refined]
"""Refines the poses of a component, given the sensor, its accepted and its compared pairs."""


class Shortcuts(Protocol):
    """Ways to spare the thorough search where scans leave no doubt."""

    def search_quickly(self, task: PairTask, i: ScanField, j: ScanField) -> PairResult:
        """A quick search of a pair."""
        ...

    def ask(self, task: PairTask, i: ScanField, j: ScanField) -> PairResult:
        """A pair at the pose that other pairs say, beside what was found of it."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Method:
    """The steps in which the robust and the published method differ.

    Attributes:
        name: Of the method, for the keys of finished work.
        settings: Sections that a pair's result depends on.
        register: Registers a pair of two scans and judges what these alone say. Can be pickled, as
            can the shortcuts.
        contours: The contours of all scans.
        settle: Refines the poses of a component as it grows.
        refine: Refines all poses of a component together.
        needs_features: Whether registering takes PA-HKS keypoints.
        shortcuts: What spares the thorough search of many pairs; None to search them all.
    """

    name: str
    settings: tuple[Section, ...]
    register: Callable[[PairTask, PairScan, PairScan], PairResult]
    contours: ContourMatcher
    settle: Settle
    refine: Refine
    needs_features: bool = True
    shortcuts: Shortcuts | None = None
