"""View graph -> view graph whose components have had all their poses refined together."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from scanweld.evidence.judge import PairJudge
from scanweld.geometry.pose import Pose
from scanweld.graph.doubts import DoubtCode, doubt_of
from scanweld.graph.view_graph import Component, Edge, ViewGraph

logger = logging.getLogger(__name__)

Refined = tuple[Mapping[int, Pose], Mapping[int, float]]
"""Poses, and the residual rms of the scans that have one."""
Refine = Callable[[Mapping[int, Pose], Sequence[Edge], Sequence[Edge]], Refined]
"""Refines ``world_from_sensor`` of a component's scans, given its accepted and compared pairs."""

MAX_SCORE_LOSS = 0.03
"""Mean score that a refinement may cost: it is judged by few samples."""


def refine_graph(graph: ViewGraph, refine: Refine, judge: PairJudge) -> ViewGraph:
    """Refine the poses of each component together (paper 3.2); the evidence is the judge.

    A component whose accepted pairs would lose by it keeps its poses, has no residuals, and its
    scans are doubtful: where poses are right, surfaces and evidence agree.

    Args:
        graph: Components with the poses that the pairs gave them.
        refine: The joint refinement of a component.
        judge: Gives the evidence on any pair at any pose.
    """
    components: list[Component] = []
    rms: dict[int, float] = {}
    apart: dict[int, str] = {}
    for component in graph.components:
        edges = [edge for edge in graph.accepted if edge[0] in component.poses]
        refined, rms_of = refine(component.poses, edges, graph.compared(component))
        loss = _mean_score(component.poses, edges, judge) - _mean_score(refined, edges, judge)
        if loss > MAX_SCORE_LOSS:
            logger.warning("the joint refinement made the evidence worse and is left out")
            apart.update(dict.fromkeys(component.poses, "surfaces and evidence pull it apart"))
            components.append(component)
            continue
        to_reference = refined[component.reference].inverse()
        poses = {k: to_reference @ pose for k, pose in refined.items()}
        components.append(replace(component, poses=poses))
        rms.update(rms_of)
    doubts = doubt_of(DoubtCode.NOT_REFINED, apart)
    return replace(graph, components=tuple(components), rms=rms, doubts=doubts)


def _mean_score(poses: Mapping[int, Pose], edges: Sequence[Edge], judge: PairJudge) -> float:
    scores = [judge.pair(i, j, poses[i].inverse() @ poses[j]).score for i, j in edges]
    return float(np.mean(scores)) if scores else 0.0
