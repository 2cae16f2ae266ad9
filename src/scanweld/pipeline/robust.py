"""Scans -> reconstruction by the robust method: every pair searched from any start, and judged."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from scanweld.config import Config
from scanweld.contours.coherence import contour_matcher
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.graph.refine_graph import Refined
from scanweld.graph.view_graph import Edge, ViewGraph
from scanweld.heat.features import Features
from scanweld.pairs.anchors import pair_anchors
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import RESULT_FORMAT, PairResult
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
from scanweld.reconstruction import Reconstruction
from scanweld.refinement.refine import ContourMatcher, refine_poses, scan_rms
from scanweld.work.stage_log import Stages, work_key

MAX_POLISHES = 3
"""Refinements of a pair's pose, one after the other: where overlap is thin, one does not arrive."""
STILL_DEG, STILL_DIAMETERS = 0.5, 0.005
"""A refinement that turns and shifts a pose by less has arrived."""
NUM_SETTLING_ROUNDS = 3
"""Rounds of refinement of a component that grows, so that chains of pairs do not drift."""


def reconstruct(intake: Intake, config: Config, stages: Stages) -> Reconstruction:
    """The robust method: from any start, every pair searched and judged."""
    features = _describe(intake, config, stages)
    fields = lay_out(intake, stages)
    contours = contour_matcher(intake.prepared, config.contours)
    pairs = _register_pairs(intake, features, fields, contours, config, stages)
    graph = _build_graph(intake, fields, pairs, config, stages)
    graph = _refine(intake, fields, contours, graph, config, stages)
    graph, confidence = assess_placed(intake, fields, graph, config, stages)
    mesh = fuse_largest(intake, graph, config, stages)
    facts = check_knowledge(intake, fields, graph, config)
    return conclude(
        intake, features, fields, graph, confidence, mesh, facts, config, stages.reports
    )


def _describe(intake: Intake, config: Config, stages: Stages) -> Sequence[Features | None]:
    """PA-HKS keypoints of every scan, unless the settings do without."""
    if config.pairs.keypoints == "even":
        return [None] * len(intake.prepared)
    return describe_scans(intake, config, stages)


def _register_pairs(
    intake: Intake,
    features: Sequence[Features | None],
    fields: Sequence[ScanField],
    contours: ContourMatcher,
    config: Config,
    stages: Stages,
) -> dict[Edge, PairResult]:
    """Register every pair of scans from any start pose, and judge what two scans alone say."""
    edges = list(combinations(range(len(fields)), 2))
    register = pair_registrar(
        intake.prepared, features, fields, contours, intake.diameter, config, intake.given.starts
    )

    def key(edge: Edge) -> str:
        hashes = [intake.prepared[k].work_hash for k in edge]
        settings = (config.prepare, config.heat, config.pairs, config.contours, config.refine)
        start = intake.given.start_key(edge)
        return work_key("pair", RESULT_FORMAT, *hashes, intake.diameter, *settings, *start)

    with stages.stage("pairs") as counts:
        results = stages.each("pairs", register, edges, key)
        counts["pairs"] = len(results)
    return {
        edge: replace(result, i=edge[0], j=edge[1])
        for edge, result in zip(edges, results, strict=True)
    }


def pair_registrar(
    prepared: Sequence[PreparedScan],
    features: Sequence[Features | None],
    fields: Sequence[ScanField],
    contours: ContourMatcher,
    diameter: float,
    config: Config,
    starts: Mapping[Edge, Pose] | None = None,
) -> Callable[[Edge], PairResult]:
    """What registers a pair (i, j), i < j, of the given scans: the search, then its best refined.

    Args:
        prepared: All scans.
        features: Their PA-HKS keypoints, or None.
        fields: The scans laid out for the search.
        contours: Finds contour matches of two scans.
        diameter: Diameter of the run, in the scans' unit.
        config: Settings.
        starts: Poses i_from_j of some pairs, between sensor frames, to be tried besides.
    """
    starts = starts or {}
    anchors = [
        pair_anchors(field, found, config.pairs)
        for field, found in zip(fields, features, strict=True)
    ]

    def register(edge: Edge) -> PairResult:
        i, j = edge

        def polish(i_from_j: Pose) -> Pose:
            for _ in range(MAX_POLISHES):
                start = {i: Pose.identity(), j: i_from_j}
                i_from_j = refine_poses(prepared, start, [edge], config.refine, contours).poses[j]
                moved = start[j].inverse() @ i_from_j
                shift = moved.shift_at(fields[j].centre) / diameter
                if moved.angle_deg() < STILL_DEG and shift < STILL_DIAMETERS:
                    break
            return i_from_j

        both = list(zip(anchors[i], anchors[j], strict=True))
        return register_pair(
            i, j, fields[i], fields[j], both, diameter, config.pairs, polish, starts.get(edge)
        )

    return register


def _build_graph(
    intake: Intake,
    fields: Sequence[ScanField],
    pairs: Mapping[Edge, PairResult],
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """Place what the pairs can place together without contradiction."""
    settling = config.refine.model_copy(update={"num_rounds": NUM_SETTLING_ROUNDS})

    def settle(poses: Mapping[int, Pose]) -> Mapping[int, Pose]:
        return refine_poses(intake.prepared, poses, [], settling).poses

    return place_scans(intake, fields, pairs, settle, config, stages)


def _refine(
    intake: Intake,
    fields: Sequence[ScanField],
    contours: ContourMatcher,
    graph: ViewGraph,
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """Refine surfaces and contours together (paper 3.2), and doubt what comes out."""

    def refine(poses: Mapping[int, Pose], edges: Sequence[Edge]) -> Refined:
        refined = refine_poses(intake.prepared, poses, edges, config.refine, contours)
        return refined.poses, scan_rms(refined)

    return refine_placed(intake, fields, graph, refine, config, stages)
