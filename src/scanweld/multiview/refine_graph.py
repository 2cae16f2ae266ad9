"""View graph -> view graph whose components have had all their poses refined together."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from scanweld.config import RefineConfig
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.multiview.merge import Judge
from scanweld.multiview.refine import ContourMatcher, refine_poses, scan_rms
from scanweld.multiview.view_graph import Component, Edge, ViewGraph

logger = logging.getLogger(__name__)

MAX_SCORE_LOSS = 0.03
"""Mean score that a refinement may cost: it is judged by few samples."""


def refine_graph(
    graph: ViewGraph,
    scans: Sequence[PreparedScan],
    contour_matches: ContourMatcher,
    judge: Judge,
    config: RefineConfig,
) -> ViewGraph:
    """Refine the poses of each component together (paper 3.2); the evidence is the judge.

    A component whose accepted pairs would lose by it keeps its poses, has no residuals, and its
    scans are doubtful: where poses are right, surfaces and evidence agree.

    Args:
        graph: Components with the poses that the pairs gave them.
        scans: All scans, by the graph's indices.
        contour_matches: Finds contour matches of two scans.
        judge: Gives the evidence on any pair at any pose.
        config: Settings of the joint refinement.
    """
    components: list[Component] = []
    rms: dict[int, float] = {}
    doubts: dict[int, str] = {}
    for component in graph.components:
        edges = [edge for edge in graph.accepted if edge[0] in component.poses]
        refined = refine_poses(scans, component.poses, edges, config, contour_matches)
        loss = _mean_score(component.poses, edges, judge) - _mean_score(refined.poses, edges, judge)
        if loss > MAX_SCORE_LOSS:
            logger.warning("the joint refinement made the evidence worse and is left out")
            doubts.update(dict.fromkeys(component.poses, "surfaces and evidence pull it apart"))
            components.append(component)
            continue
        to_reference = refined.poses[component.reference].inverse()
        poses = {k: to_reference @ pose for k, pose in refined.poses.items()}
        components.append(replace(component, poses=poses))
        rms.update(scan_rms(refined))
    return replace(graph, components=tuple(components), rms=rms, doubts=doubts)


def _mean_score(poses: Mapping[int, Pose], edges: Sequence[Edge], judge: Judge) -> float:
    scores = [judge(i, j, poses[i].inverse() @ poses[j]).score for i, j in edges]
    return float(np.mean(scores)) if scores else 0.0
