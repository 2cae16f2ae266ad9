"""Steps that both methods take, each a stage of the run."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

from scanweld.confidence.assess import Confidence, assess
from scanweld.confidence.model import stored_calibration
from scanweld.confidence.witnesses import witnesses_of
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.evidence.edges import judge_off_edges, with_wide_edges
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.field import ScanField, make_field
from scanweld.evidence.patches import Told, told_of
from scanweld.evidence.pixels import see
from scanweld.evidence.visibility import judge, mean_evidence
from scanweld.fusion.fuse import fuse
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.graph.assemble import Settle, build_view_graph
from scanweld.graph.merge import Judge, Poses, Tell
from scanweld.graph.reasons import doubt_alone, find_doubts
from scanweld.graph.refine_graph import Refine, refine_graph
from scanweld.graph.view_graph import Edge, ViewGraph
from scanweld.heat.features import Features, describe
from scanweld.knowledge.check import Outcome, check_facts
from scanweld.knowledge.given import easier_verdict, pairs_as_given, with_given
from scanweld.knowledge.turntable import Turntable, find_turntable, off_axis_doubts
from scanweld.pairs.result import PairResult
from scanweld.pipeline.intake import Intake
from scanweld.reconstruction import FactReport
from scanweld.refinement.scale import estimate_scales
from scanweld.work.progress import ScanRefused
from scanweld.work.stage_log import Stages, work_key

logger = logging.getLogger(__name__)

NUM_JUDGED_SAMPLES = 300
"""Samples of a scan that judge merges and refinements: thousands of poses are asked about."""


def describe_scans(intake: Intake, config: Config, stages: Stages) -> list[Features]:
    """PA-HKS keypoints of every scan (paper 3.1)."""
    with stages.stage("features") as counts:
        found = stages.each(
            "features",
            lambda scan: describe(scan, config.heat),
            intake.prepared,
            lambda scan: work_key("features", scan.work_hash, config.prepare, config.heat),
        )
        counts["keypoints"] = sum(len(f.points) for f in found)
    return found


def lay_out(intake: Intake, stages: Stages) -> list[ScanField]:
    """Every scan as the arrays that the pairs' kernels take."""
    with stages.stage("lay out") as counts:
        counts["scans"] = len(intake.prepared)
        return stages.each(
            "lay out", lambda scan: make_field(scan, intake.diameter), intake.prepared
        )


def pair_judge(fields: Sequence[ScanField], diameter: float, config: Config) -> Judge:
    """What gives the evidence on any pair of scans at any pose, by a few hundred samples each."""
    tolerance = config.pairs.tolerance_diameters[2] * diameter

    def judge_pair(i: int, j: int, i_from_j: Pose) -> Evidence:
        both = judge(fields[i], fields[j], i_from_j, tolerance, NUM_JUDGED_SAMPLES)
        return mean_evidence(*both)

    return judge_pair


def off_edges_judge(fields: Sequence[ScanField], diameter: float, config: Config) -> Judge:
    """The same with samples before the edges of what the other sensor saw left out."""
    tolerance = config.pairs.tolerance_diameters[2] * diameter

    @cache
    def both(k: int) -> tuple[ScanField, ScanField]:
        return fields[k], with_wide_edges(fields[k], tolerance)

    def judge_pair(i: int, j: int, i_from_j: Pose) -> Evidence:
        return judge_off_edges(both(i), both(j), i_from_j, tolerance, NUM_JUDGED_SAMPLES)

    return judge_pair


def pixel_teller(fields: Sequence[ScanField], diameter: float, config: Config) -> Tell:
    """What gives what all pixels of two components' scans say of each other."""
    tolerance = config.pairs.tolerance_diameters[2] * diameter

    def tell(a: Poses, b: Poses) -> list[Told]:
        both = {
            (i, j): see(fields[i], fields[j], a[i].inverse() @ b[j], diameter) for i in a for j in b
        }
        of_a = [told_of([both[i, j][0] for j in b], tolerance) for i in a]
        return of_a + [told_of([both[i, j][1] for i in a], tolerance) for j in b]

    return tell


def place_scans(
    intake: Intake,
    fields: Sequence[ScanField],
    pairs: Mapping[Edge, PairResult],
    settle: Settle,
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """Place what the pairs can place together without contradiction, as far as is given.

    Args:
        intake: The scans, prepared, and what is given of them.
        fields: The scans laid out.
        pairs: Every pair, judged.
        settle: Refines the poses of a component as it grows.
        config: Settings.
        stages: Bookkeeping of the run.
    """
    given = intake.given
    with stages.stage("graph") as counts:
        easier = easier_verdict(fields, intake.diameter, config.pairs)
        axis = _common_axis(intake, fields, pairs, config)
        graph = build_view_graph(
            len(fields),
            pairs_as_given(pairs, given, axis, easier),
            [field.centre for field in fields],
            intake.diameter,
            pair_judge(fields, intake.diameter, config),
            settle,
            config.graph,
            given.apart,
            pixel_teller(fields, intake.diameter, config),
            off_edges_judge(fields, intake.diameter, config),
        )
        graph = with_given(graph, pairs, given)
        counts["accepted"] = len(graph.accepted)
        counts["components"] = len(graph.components)
    return graph


def refine_placed(
    intake: Intake,
    fields: Sequence[ScanField],
    graph: ViewGraph,
    refine: Refine,
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """Refine each component's poses together (paper 3.2), and doubt what comes out.

    Args:
        intake: The scans, prepared, and what is given of them.
        fields: The scans laid out.
        graph: Components with the poses that the pairs gave them.
        refine: The joint refinement of a component.
        config: Settings.
        stages: Bookkeeping of the run.
    """
    judge_pair = pair_judge(fields, intake.diameter, config)
    with stages.stage("refine") as counts:
        graph = refine_graph(graph, refine, judge_pair)
        doubts = find_doubts(graph, judge_pair, config.graph)
        axis = _common_axis(intake, fields, graph.pairs, config)
        if axis is not None:
            doubts = {**off_axis_doubts(graph, axis), **doubts}
        graph = replace(graph, doubts={**_scale_doubts(intake, graph), **doubts})
        counts["scans"] = sum(len(component.poses) for component in graph.components)
        counts["doubtful"] = len(graph.doubts)
    for k, reason in graph.unplaced.items():
        stages.progress(ScanRefused(scan=intake.prepared[k].name, reason=reason))
    return graph


def _scale_doubts(intake: Intake, graph: ViewGraph) -> dict[int, str]:
    """Scans that fit the others better when they are made larger or smaller."""
    return {
        k: estimate.words()
        for component in graph.components
        for k, estimate in estimate_scales(intake.prepared, component.poses).items()
        if estimate.is_off
    }


def assess_placed(
    intake: Intake, fields: Sequence[ScanField], graph: ViewGraph, config: Config, stages: Stages
) -> tuple[ViewGraph, Confidence]:
    """How probable it is that each pose is right; scans of which it is too little are doubtful."""
    judge_pair = pair_judge(fields, intake.diameter, config)
    with stages.stage("confidence") as counts:
        witnesses = witnesses_of(intake.prepared, fields, intake.diameter, judge_pair, config)
        confidence = assess(graph, witnesses, stored_calibration(), config)
        doubts = dict(graph.doubts)
        for k, found in confidence.scans.items():
            if found.confidence < config.confidence.min_good:
                told = f"its pose is right with a probability of {found.confidence:.0%} only"
                doubts.setdefault(k, told)
        graph = replace(graph, doubts=doubts)
        graph = replace(graph, doubts={**doubts, **doubt_alone(graph)})
        counts["doubtful"] = len(graph.doubts)
    return graph, confidence


def _common_axis(
    intake: Intake,
    fields: Sequence[ScanField],
    pairs: Mapping[Edge, PairResult],
    config: Config,
) -> Turntable | None:
    """The axis about which most good pairs turn, in frames of the sensors or of the files.

    None if the scans are not said to have one.
    """
    if not intake.given.turntable:
        return None
    sensors = [Pose.identity() for _ in fields]
    files = [scan.scan_from_sensor for scan in intake.prepared]
    near = config.graph.max_cycle_deg, config.graph.max_cycle_diameters * intake.diameter
    return find_turntable(pairs, [sensors, files], [field.centre for field in fields], near)


def check_knowledge(
    intake: Intake, fields: Sequence[ScanField], graph: ViewGraph, config: Config
) -> tuple[FactReport, ...]:
    """Every fact that users gave against what was found."""
    outcome = Outcome(
        prepared=intake.prepared,
        graph=graph,
        centres=[field.centre for field in fields],
        diameter=intake.diameter,
        judge=pair_judge(fields, intake.diameter, config),
        turntable=_common_axis(intake, fields, graph.pairs, config),
    )
    return check_facts(intake.knowledge, outcome)


def fuse_largest(
    intake: Intake, graph: ViewGraph, config: Config, stages: Stages
) -> TriangleMesh | None:
    """The surface of the largest component's good scans, in its world; None without."""
    if not graph.components:
        return None
    component = graph.components[0]
    left_out = set() if config.fusion.with_doubtful else set(graph.doubts)
    order = sorted(set(component.poses) - left_out)
    prepared = intake.prepared
    if not order:
        logger.warning("no model: all of its scans are doubtful")
        return None
    world_from_reference = component.world_from_reference(
        prepared[component.reference].scan_from_sensor
    )
    with stages.stage("fuse") as counts:
        try:
            mesh = fuse(
                [prepared[k] for k in order],
                [world_from_reference @ component.poses[k] for k in order],
                config.fusion,
                prepare=config.prepare,
                workers=stages.workers,
            )
        except InputError as error:
            logger.warning("no model: %s", error)
            return None
        counts["faces"] = len(mesh.faces)
    return mesh
