"""The method as published: PA-HKS and ICP, then MM-ICC.

The readings of the paper are settings, ``coarse`` and ``contours``; nothing else finds or moves a
pose, unless users give start poses. What the paper takes for granted is added: it is told which
views are adjacent, and does not ask whether its answer is right. Here the evidence of the pairs
says both, as it does for the robust method.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scanweld.config import Config
from scanweld.evidence.judge import Poses
from scanweld.geometry.pose import Pose
from scanweld.graph.refine_graph import Refined
from scanweld.graph.view_graph import Edge
from scanweld.heat.features import Features
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import PairResult
from scanweld.pairs.verdict import no_pose
from scanweld.pipeline.method import Method, Scene
from scanweld.published.coarse import register_as_published
from scanweld.published.judged_pose import judge_pose
from scanweld.published.mm_icc import mm_icc


def published_method(scene: Scene, config: Config) -> Method:
    """The published method for the scans of a run."""
    registrar = _PublishedRegistrar(scene=scene, config=config)

    def stay(poses: Poses) -> Poses:
        """Unlike in the robust method nothing is refined while components grow."""
        return poses

    def refine(
        poses: Mapping[int, Pose], accepted: Sequence[Edge], compared: Sequence[Edge]
    ) -> Refined:
        del compared
        aligned = mm_icc(scene.intake.prepared, poses, accepted, config.contours)
        return {**poses, **aligned.poses}, {}

    return Method(
        name="published",
        settings=(config.prepare, config.heat, config.coarse, config.contours, config.pairs),
        register=registrar.register,
        settle=stay,
        refine=refine,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _PublishedRegistrar:
    """Every pair by the coarse step (paper 3.1) and MM-ICC of its two views (3.2), and judged."""

    scene: Scene
    config: Config

    def register(self, edge: Edge, features: Mapping[int, Features]) -> PairResult:
        """Register a pair; where a start pose is given, what MM-ICC makes of it counts as well."""
        i, j = edge
        prepared = self.scene.intake.prepared
        coarse = register_as_published(
            prepared[i], prepared[j], features[i], features[j], self.config.coarse
        )
        starts = [coarse.i_from_j, self.scene.intake.known.starts.get(edge)]
        results = [self._refined(edge, start) for start in starts if start is not None]
        if not results:
            return no_pose(i, j, coarse.reason)
        return max(results, key=lambda result: result.alternatives[0].score)

    def _refined(self, edge: Edge, start: Pose) -> PairResult:
        i, j = edge
        prepared, judge = self.scene.intake.prepared, self.scene.judge
        poses = {i: Pose.identity(), j: start}
        fine = mm_icc(prepared, poses, [edge], self.config.contours).poses
        problem = PairProblem(
            edge=edge,
            i=judge.fields[i],
            j=judge.fields[j],
            config=self.config.pairs,
        )
        return judge_pose(problem, fine[i].inverse() @ fine[j])
