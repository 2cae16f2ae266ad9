"""The problem that the view graph is built from, as users' facts let its pairs be used."""

from collections.abc import Mapping, Sequence
from functools import partial

from scanweld.config import Config
from scanweld.evidence.judge import Poses
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.problem import GraphProblem
from scanweld.graph.view_graph import Edge
from scanweld.knowledge.turntable import Turntable
from scanweld.knowledge.usable_pairs import LenientVerdict, usable_pairs
from scanweld.pairs.result import PairResult
from scanweld.pipeline.method import Method, Scene


def graph_problem(
    scene: Scene,
    found: Mapping[Edge, PairResult],
    axis: Turntable | None,
    method: Method,
    config: Config,
    components: Sequence[Poses] = (),
) -> GraphProblem:
    """Pairs as users' facts let them be used, and who judges and settles what comes of them.

    Args:
        scene: The scans.
        found: Pairs, judged.
        axis: The common axis, if there is one.
        method: Refines the poses of a component as it grows.
        config: Settings.
        components: What is placed together already.
    """
    judge, known = scene.judge, scene.intake.known
    limit = config.pairs.max_contradiction
    if scene.sensor is not None:
        limit = scene.sensor.max_contradiction
    verdict = LenientVerdict(fields=judge.fields, config=config.pairs, max_contradiction=limit)
    return GraphProblem(
        pairs=usable_pairs(found, known, axis, verdict),
        centres=judge.centres,
        same=same_pose(scene, config),
        judge=judge,
        settle=partial(method.settle, scene.sensor),
        config=config.graph,
        apart=known.apart,
        initial=components,
    )


def same_pose(scene: Scene, config: Config) -> PoseTolerance:
    """Poses of a scan that differ by less close a cycle; more where the sensor is less exact."""
    usual = config.pairs.fine_tolerance_diameters * scene.judge.diameter
    wider = scene.judge.tolerance / usual
    shift = config.graph.max_cycle_diameters * scene.judge.diameter
    return PoseTolerance(angle_deg=wider * config.graph.max_cycle_deg, shift=wider * shift)
