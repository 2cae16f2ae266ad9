"""The method as published: PA-HKS and ICP, then MM-ICC.

The readings of the paper are settings, ``coarse`` and ``contours``; nothing else finds or moves a
pose, unless users give start poses. What the paper takes for granted is added: it is told which
views are adjacent, and does not ask whether its answer is right. Here the evidence of the pairs
says both, as it does for the robust method.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from scanweld.config import Config
from scanweld.contours.coherence import contour_matcher
from scanweld.evidence.judge import Poses
from scanweld.geometry.pose import Pose
from scanweld.graph.refine_graph import Refined
from scanweld.graph.view_graph import Edge
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.registrar import PairScan, PairTask
from scanweld.pairs.result import PairResult
from scanweld.pairs.verdict import no_pose
from scanweld.pipeline.method import Method, Scene
from scanweld.published.coarse import register_as_published
from scanweld.published.judged_pose import judge_pose
from scanweld.published.mm_icc import mm_icc
from scanweld.sensor.model import SensorModel


def published_method(scene: Scene, config: Config, workers: int) -> Method:
    """The published method for the scans of a run; its joint steps know one thread only."""
    del workers
    registrar = _PublishedRegistrar(config=config)

    def stay(sensor: SensorModel | None, poses: Poses) -> Poses:
        """Unlike in the robust method nothing is refined while components grow."""
        del sensor
        return poses

    def refine(
        sensor: SensorModel, poses: Poses, accepted: Sequence[Edge], compared: Sequence[Edge]
    ) -> Refined:
        del compared, sensor
        aligned = mm_icc(scene.intake.prepared, poses, accepted, config.contours)
        return {**poses, **aligned.poses}, {}

    return Method(
        name="published",
        settings=(config.prepare, config.heat, config.coarse, config.contours, config.pairs),
        register=registrar.register,
        contours=contour_matcher(scene.intake.prepared, config.contours),
        settle=stay,
        refine=refine,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _PublishedRegistrar:
    """Every pair by the coarse step (paper 3.1) and MM-ICC of its two views (3.2), and judged."""

    config: Config

    def register(self, task: PairTask, i: PairScan, j: PairScan) -> PairResult:
        """Register a pair; where a start pose is given, what MM-ICC makes of it counts as well."""
        assert i.features is not None and j.features is not None
        coarse = register_as_published(
            i.prepared, j.prepared, i.features, j.features, self.config.coarse
        )
        starts = [coarse.i_from_j, task.start]
        results = [self._refined(task, i, j, start) for start in starts if start is not None]
        if not results:
            return no_pose(*task.edge, coarse.reason)
        return max(results, key=lambda result: result.alternatives[0].score)

    def _refined(self, task: PairTask, i: PairScan, j: PairScan, start: Pose) -> PairResult:
        poses = {0: Pose.identity(), 1: start}
        fine = mm_icc([i.prepared, j.prepared], poses, [(0, 1)], self.config.contours).poses
        problem = PairProblem(edge=task.edge, i=i.field, j=j.field, config=self.config.pairs)
        return judge_pose(problem, fine[0].inverse() @ fine[1])
