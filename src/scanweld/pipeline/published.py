"""Scans -> reconstruction by the method as published: PA-HKS and ICP, then MM-ICC.

The readings of the paper are settings, ``coarse`` and ``contours``; nothing else finds or moves a
pose, unless users give start poses. What the paper takes for granted is added: it is told which
views are adjacent, and does not ask whether its answer is right. Here the evidence of the pairs
says both, as it does for the robust method.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from scanweld.config import Config
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.graph.refine_graph import Refined
from scanweld.graph.view_graph import Edge, ViewGraph
from scanweld.heat.features import Features
from scanweld.pairs.result import RESULT_FORMAT, PairResult
from scanweld.pairs.verdict import no_pose
from scanweld.pipeline.conclude import conclude
from scanweld.pipeline.intake import Intake
from scanweld.pipeline.stages import (
    assess_placed,
    check_knowledge,
    describe_scans,
    fuse_largest,
    lay_out,
    place_scans,
    refine_placed,
)
from scanweld.published.coarse import register_as_published
from scanweld.published.judged_pose import judge_pose
from scanweld.published.mm_icc import mm_icc
from scanweld.reconstruction import Reconstruction
from scanweld.work.stage_log import Stages, work_key


def reconstruct_as_published(intake: Intake, config: Config, stages: Stages) -> Reconstruction:
    """Place the scans of a run by the paper's method, fuse them and judge what came out.

    Args:
        intake: The scans, prepared.
        config: Settings of every stage; ``coarse`` and ``contours`` hold the readings.
        stages: Bookkeeping of the run.
    """
    features = describe_scans(intake, config, stages)
    fields = lay_out(intake, stages)
    pairs = _register_pairs(intake, features, fields, config, stages)
    graph = _choose_adjacent_views(intake, fields, pairs, config, stages)
    graph = _refine(intake, fields, graph, config, stages)
    graph, confidence = assess_placed(intake, fields, graph, config, stages)
    mesh = fuse_largest(intake, graph, config, stages)
    facts = check_knowledge(intake, fields, graph, config)
    return conclude(
        intake, features, fields, graph, confidence, mesh, facts, config, stages.reports
    )


def _register_pairs(
    intake: Intake,
    features: Sequence[Features],
    fields: Sequence[ScanField],
    config: Config,
    stages: Stages,
) -> dict[Edge, PairResult]:
    """Every pair by the coarse step (paper 3.1) and MM-ICC of its two views (3.2), and judged.

    Where a start pose is given, MM-ICC is run from there too, and what is judged better is kept.
    """
    prepared = intake.prepared
    edges = list(combinations(range(len(prepared)), 2))

    def register(edge: Edge) -> PairResult:
        i, j = edge
        coarse = register_as_published(
            prepared[i], prepared[j], features[i], features[j], config.coarse
        )
        starts = [coarse.i_from_j, intake.given.starts.get(edge)]
        results = [refined(edge, start) for start in starts if start is not None]
        if not results:
            return no_pose(i, j, coarse.reason)
        return max(results, key=lambda result: result.alternatives[0].score)

    def refined(edge: Edge, start: Pose) -> PairResult:
        i, j = edge
        fine = mm_icc(prepared, {i: Pose.identity(), j: start}, [edge], config.contours).poses
        i_from_j = fine[i].inverse() @ fine[j]
        return judge_pose(i, j, fields[i], fields[j], i_from_j, intake.diameter, config.pairs)

    def key(edge: Edge) -> str:
        hashes = [prepared[k].work_hash for k in edge]
        settings = (config.prepare, config.heat, config.coarse, config.contours, config.pairs)
        start = intake.given.start_key(edge)
        return work_key(
            "published pair", RESULT_FORMAT, *hashes, intake.diameter, *settings, *start
        )

    with stages.stage("pairs") as counts:
        results = stages.each("pairs", register, edges, key)
        counts["pairs"] = len(results)
    return {
        edge: replace(result, i=edge[0], j=edge[1])
        for edge, result in zip(edges, results, strict=True)
    }


def _choose_adjacent_views(
    intake: Intake,
    fields: Sequence[ScanField],
    pairs: Mapping[Edge, PairResult],
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """The pairs that the evidence accepts and that agree with each other, and the poses they give.

    This choice is ours: the paper is given its adjacent views. Unlike the robust method's graph
    nothing is refined on the way.
    """
    return place_scans(intake, fields, pairs, lambda poses: poses, config, stages)


def _refine(
    intake: Intake,
    fields: Sequence[ScanField],
    graph: ViewGraph,
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """MM-ICC over the adjacent views of each component (3.2), and doubts of what comes out."""

    def refine(poses: Mapping[int, Pose], edges: Sequence[Edge]) -> Refined:
        aligned = mm_icc(intake.prepared, poses, edges, config.contours)
        return {**poses, **aligned.poses}, {}

    return refine_placed(intake, fields, graph, refine, config, stages)
