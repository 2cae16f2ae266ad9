"""The stages of a run, one after the other."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from scanweld.confidence.assess import Confidence, assess
from scanweld.confidence.diagnostics import diagnostics_of
from scanweld.confidence.model import stored_calibration
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.evidence.evidence import PatchLimits
from scanweld.evidence.field import make_field
from scanweld.evidence.judge import Judge
from scanweld.fusion.fuse import fuse
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.assemble import build_view_graph
from scanweld.graph.doubts import DoubtCode, Doubts, doubt_of, merged
from scanweld.graph.reasons import best_first, doubt_alone, find_doubts
from scanweld.graph.refine_graph import refine_graph
from scanweld.graph.view_graph import ViewGraph
from scanweld.knowledge import check
from scanweld.knowledge.turntable import Turntable, off_axis_doubts
from scanweld.knowledge.usable_pairs import with_found_pairs
from scanweld.pipeline.intake import Intake
from scanweld.pipeline.method import Method, Scene
from scanweld.pipeline.problem import graph_problem
from scanweld.pipeline.registration import Registered
from scanweld.reconstruction import FactReport
from scanweld.sensor.scale import estimate_scales
from scanweld.sensor.standing import standing_scans
from scanweld.work.progress import ScanRefused
from scanweld.work.stage_log import Stages
from scanweld.work.threads import map_in_order

logger = logging.getLogger(__name__)


def lay_out(intake: Intake, config: Config, stages: Stages) -> Judge:
    """Every scan as the arrays that the kernels take, and who judges any two of them."""
    with stages.stage("lay out") as counts:
        counts["scans"] = len(intake.prepared)
        # Here whatever the cluster: it is done faster than sent.
        fields = list(map_in_order(make_field, intake.prepared, stages.workers))
    tolerance = config.pairs.fine_tolerance_diameters * intake.diameter
    return Judge(
        fields=fields,
        diameter=intake.diameter,
        tolerance=tolerance,
        limits=PatchLimits(contradiction=config.pairs.max_contradiction),
    )


def place_scans(
    registered: Registered,
    axis: Turntable | None,
    method: Method,
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """Place what the pairs can place together without contradiction, as far as users' facts allow.

    Args:
        registered: The scans, and every pair, judged.
        axis: The common axis, if there is one.
        method: Refines the poses of a component as it grows.
        config: Settings.
        stages: Bookkeeping of the run.
    """
    scene, found = registered.scene, registered.pairs
    with stages.stage("graph") as counts:
        problem = graph_problem(scene, found, axis, method, config, registered.components)
        graph = with_found_pairs(build_view_graph(problem), found, scene.intake.known)
        counts["accepted"] = len(graph.accepted)
        counts["components"] = len(graph.components)
    return graph


def refine_placed(
    scene: Scene,
    graph: ViewGraph,
    axis: Turntable | None,
    method: Method,
    config: Config,
    stages: Stages,
) -> ViewGraph:
    """Refine each component's poses together (paper 3.2), and doubt what comes out.

    Args:
        scene: The scans.
        graph: Components with the poses that the pairs gave them.
        axis: The common axis, if there is one.
        method: Refines the poses of a component together.
        config: Settings.
        stages: Bookkeeping of the run.
    """
    prepared = scene.intake.prepared
    with stages.stage("refine") as counts:
        graph = refine_graph(graph, partial(method.refine, scene.known_sensor), scene.judge)
        doubts = find_doubts(graph, scene.judge)
        doubts = merged(_standing_doubts(scene, graph), doubts)
        if axis is not None:
            doubts = merged(doubts, off_axis_doubts(graph, axis))
        graph = replace(graph, doubts=merged(doubts, _scale_doubts(scene, graph, stages.workers)))
        counts["scans"] = sum(len(component.poses) for component in graph.components)
        counts["doubtful"] = len(graph.doubts)
    for k, reason in graph.unplaced.items():
        stages.progress(ScanRefused(scan=prepared[k].name, reason=reason))
    return graph


def _standing_doubts(scene: Scene, graph: ViewGraph) -> Doubts:
    """Scans that a camera that stood still took of something that moved."""
    told: dict[int, str] = {}
    for component in graph.components:
        found = standing_scans(
            scene.judge.fields, component.poses, graph.compared(component), scene.judge.diameter
        )
        if found is not None:
            told.update(dict.fromkeys(found.scans, found.words()))
    return doubt_of(DoubtCode.CAMERA_STOOD, told)


def _scale_doubts(scene: Scene, graph: ViewGraph, workers: int) -> Doubts:
    """Scans that fit the others better when they are made larger or smaller."""
    found = [
        estimate_scales(
            *(scene.intake.prepared, component.poses, graph.compared(component)),
            *(scene.known_sensor, workers),
        )
        for component in graph.components
    ]
    told = {
        k: estimate.words() for scales in found for k, estimate in scales.items() if estimate.is_off
    }
    return doubt_of(DoubtCode.SCALE, told)


def assess_placed(
    scene: Scene, graph: ViewGraph, config: Config, stages: Stages
) -> tuple[ViewGraph, Confidence]:
    """How probable it is that each pose is right; scans below ``min_good`` are marked doubtful."""
    with stages.stage("confidence") as counts:
        diagnostics = diagnostics_of(
            scene.intake.prepared, scene.judge, scene.known_sensor, config.contours
        )
        confidence = assess(graph, diagnostics, stored_calibration(), config, stages.workers)
        unsure = {
            k: f"its pose is right with a probability of {found.confidence:.0%} only"
            for k, found in confidence.scans.items()
            if found.confidence < config.confidence.min_good
        }
        doubts = merged(
            graph.doubts,
            doubt_of(DoubtCode.INEXACT, _inexact(confidence.bounds, scene, config)),
            doubt_of(DoubtCode.CONFIDENCE, unsure),
        )
        graph = replace(graph, doubts=doubts)
        graph = best_first(replace(graph, doubts=merged(doubts, doubt_alone(graph))))
        counts["doubtful"] = len(graph.doubts)
    return graph, confidence


def _inexact(bounds: Mapping[int, PoseTolerance], scene: Scene, config: Config) -> dict[int, str]:
    """Scans whose surface may be farther off than is asked for."""
    asked = config.confidence.min_accuracy_percent
    if asked is None:
        return {}
    radius = 0.5 * scene.judge.diameter
    reach = {k: bound.shift + bound.angle * radius for k, bound in bounds.items()}
    percent = {k: 100.0 * far / scene.judge.diameter for k, far in reach.items()}
    return {
        k: f"its surface may be off by {far:.2g} % of the diameter; {asked:g} % are asked for"
        for k, far in percent.items()
        if far > asked
    }


def check_knowledge(
    scene: Scene, graph: ViewGraph, axis: Turntable | None
) -> tuple[FactReport, ...]:
    """Every fact that users gave against what was found."""
    registered = check.Registered(
        prepared=scene.intake.prepared, graph=graph, judge=scene.judge, turntable=axis
    )
    return check.check_facts(scene.intake.knowledge, registered)


def fuse_largest(
    intake: Intake, graph: ViewGraph, config: Config, stages: Stages
) -> TriangleMesh | None:
    """The surface of the first component's good scans, in its world; None without."""
    if not graph.components:
        return None
    left_out = set() if config.fusion.with_doubtful else set(graph.doubts)
    order = sorted(set(graph.components[0].poses) - left_out)
    if not order:
        logger.warning("no model: all of its scans are doubtful")
        return None
    with stages.stage("fuse") as counts:
        mesh = _surface_of(order, intake, graph, config, stages)
        if mesh is not None:
            counts["faces"] = len(mesh.faces)
    return mesh


def preview_largest(
    intake: Intake, graph: ViewGraph, config: Config, stages: Stages
) -> TriangleMesh | None:
    """The same of doubtful scans where all are doubtful, to look at; None where one is not."""
    if not graph.components or config.fusion.with_doubtful:
        return None
    placed = set(graph.components[0].poses)
    if placed - set(graph.doubts):
        return None
    with stages.stage("preview") as counts:
        mesh = _surface_of(sorted(placed), intake, graph, config, stages)
        if mesh is not None:
            counts["faces"] = len(mesh.faces)
    return mesh


def _surface_of(
    order: Sequence[int], intake: Intake, graph: ViewGraph, config: Config, stages: Stages
) -> TriangleMesh | None:
    """The surface of some scans of the largest component; None where they cannot be fused."""
    component, prepared = graph.components[0], intake.prepared
    world_from_reference = component.world_from_reference(
        prepared[component.reference].scan_from_sensor
    )
    try:
        return fuse(
            [prepared[k] for k in order],
            [world_from_reference @ component.poses[k] for k in order],
            config.fusion,
            prepare=config.prepare,
            workers=stages.workers,
            cache=stages.cache,
        )
    except InputError as error:
        logger.warning("no model: %s", error)
        return None
