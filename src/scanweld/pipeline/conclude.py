"""The end of a run: what became of every scan and pair, and the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from scanweld.confidence.assess import Assessed, Confidence
from scanweld.config import Config
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.judge import Judge
from scanweld.evidence.visibility import two_way_evidence
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.graph.apart import why_apart
from scanweld.graph.doubts import DoubtCode
from scanweld.graph.reasons import why_open
from scanweld.graph.view_graph import ViewGraph
from scanweld.pairs.result import Alternative, PairResult, weights_of
from scanweld.pipeline.method import Scene
from scanweld.pipeline.problem import same_pose
from scanweld.reconstruction import (
    AlternativeReport,
    DoubtReport,
    FactReport,
    FactVerdict,
    PairReport,
    Reconstruction,
    ScanReport,
    ScanVerdict,
    Verdict,
)
from scanweld.work.stage_log import StageReport

Report = TypeVar("Report", ScanReport, PairReport)


def conclude(
    scene: Scene,
    graph: ViewGraph,
    confidence: Confidence,
    mesh: TriangleMesh | None,
    facts: tuple[FactReport, ...],
    config: Config,
    stages: Mapping[str, StageReport],
) -> Reconstruction:
    """Put together what a run gives back, with poses between the scans' own frames."""
    intake, prepared = scene.intake, scene.intake.prepared
    unplaced = dict(intake.refused)
    unplaced.update({prepared[k].name: reason for k, reason in graph.unplaced.items()})
    scans = {
        name: unplaced_report(intake.scans.get(name), reason) for name, reason in unplaced.items()
    }
    for k, scan in enumerate(prepared):
        report = _scan_report(k, scene, graph)
        report = _with_confidence(report, confidence.scans.get(k))
        scans[scan.name] = _with_bound(report, k, confidence)
    apart = why_apart(graph, scene.judge.centres, same_pose(scene, config))
    verdict, reasons = _verdict(graph, scans, mesh, [*_denied(facts), *apart], config)
    return Reconstruction(
        poses=_poses(prepared, graph),
        components=tuple(
            tuple(prepared[k].name for k in [c.reference, *_others(c.poses, c.reference)])
            for c in graph.components
        ),
        unplaced=dict(sorted(unplaced.items())),
        scans=dict(sorted(scans.items())),
        pairs=tuple(
            sorted(
                (
                    _with_confidence(
                        pair_report(prepared, graph, edge, config), confidence.pairs.get(edge)
                    )
                    for edge in graph.pairs
                ),
                key=lambda pair: (pair.i, pair.j),
            )
        ),
        mesh=mesh,
        verdict=verdict,
        reasons=reasons,
        stages=stages,
        config=config,
        knowledge=facts,
        prepared={scan.name: scan for scan in prepared},
        sensor=scene.sensor,
    )


def _with_confidence(report: Report, assessed: Assessed | None) -> Report:
    if assessed is None:
        return report
    return replace(report, confidence=assessed.confidence, grounds=assessed.grounds)


def _with_bound(report: ScanReport, k: int, confidence: Confidence) -> ScanReport:
    bound, deviation = confidence.bounds.get(k), confidence.deviations.get(k)
    if bound is None or deviation is None:
        return report
    return replace(
        report,
        rotation_bound_deg=bound.angle_deg,
        translation_bound=bound.shift,
        deviation_deg=deviation.angle_deg,
        deviation=deviation.shift,
    )


def _others(poses: Mapping[int, Pose], reference: int) -> list[int]:
    return [k for k in sorted(poses) if k != reference]


def _poses(prepared: Sequence[PreparedScan], graph: ViewGraph) -> dict[str, Pose]:
    """world_from_scan: the world is the scan frame of the reference, unless that is fixed."""
    poses = {}
    for component in graph.components:
        world_from_reference = component.world_from_reference(
            prepared[component.reference].scan_from_sensor
        )
        for k, pose in sorted(component.poses.items()):
            sensor_from_scan = prepared[k].scan_from_sensor.inverse()
            is_reference = k == component.reference
            poses[prepared[k].name] = (
                component.world_from_scan or Pose.identity()
                if is_reference
                else world_from_reference @ pose @ sensor_from_scan
            )
    return dict(sorted(poses.items()))


def unplaced_report(scan: RangeScan | None, reason: str) -> ScanReport:
    """What is known of a scan that has no pose, if it could be read at all."""
    if scan is None:
        return ScanReport(verdict=ScanVerdict.UNPLACED, reason=reason)
    return ScanReport(
        verdict=ScanVerdict.UNPLACED,
        reason=reason,
        num_points=len(scan.points),
        num_dropped=scan.num_dropped,
        camera=_camera_words(scan.camera),
        viewpoint=scan.viewpoint,
        notes=scan.notes,
        content_hash=scan.content_hash(),
    )


def prepared_report(scan: PreparedScan, verdict: ScanVerdict, reason: str) -> ScanReport:
    """What is known of a scan by itself, once it is prepared."""
    return ScanReport(
        verdict=verdict,
        reason=reason,
        num_points=len(scan.scan.points),
        num_dropped=scan.scan.num_dropped,
        resolution=scan.resolution,
        diameter=scan.diameter,
        camera=_camera_words(scan.scan.camera),
        viewpoint=scan.scan.viewpoint,
        notes=scan.scan.notes,
        content_hash=scan.content_hash,
        is_without_support=scan.is_without_support,
    )


def _scan_report(
    k: int,
    scene: Scene,
    graph: ViewGraph,
) -> ScanReport:
    prepared, found = scene.intake.prepared, scene.features.get(k)
    scan = prepared[k]
    neighbours = graph.neighbours(k)
    overlap = None
    if k in graph.unplaced:
        verdict, reason = ScanVerdict.UNPLACED, graph.unplaced[k]
    else:
        overlap = _overlap(k, scene.judge, graph)
        told = f"{overlap:.0%} of its surface agrees with another scan"
        if k in graph.doubts:
            verdict, reason = ScanVerdict.DOUBTFUL, graph.doubts[k][0].text
        else:
            verdict = ScanVerdict.GOOD
            pairs = "one pair" if len(neighbours) == 1 else f"{len(neighbours)} pairs"
            reason = f"held by {pairs}; {told}"
    return replace(
        prepared_report(scan, verdict, reason),
        doubts=tuple(
            DoubtReport(code=doubt.code.value, text=doubt.text) for doubt in graph.doubts.get(k, ())
        ),
        num_keypoints=None if found is None else len(found.points),
        edges=tuple(sorted(prepared[n].name for n in neighbours)),
        overlap=overlap,
        rms=graph.rms.get(k),
    )


def _overlap(k: int, judge: Judge, graph: ViewGraph) -> float:
    """Largest share of a scan's samples that agree with one other scan of its component."""
    home = next(c for c in graph.components if k in c.poses)
    poses = home.poses
    shares = [
        two_way_evidence(
            judge.fields[k], judge.fields[m], poses[k].inverse() @ poses[m], judge.tolerance
        )[0].agree
        for m in sorted({a + b - k for a, b in graph.compared(home) if k in (a, b)})
    ]
    return max(shares, default=0.0)


def _camera_words(camera: Camera | None) -> str | None:
    if camera is None:
        return None
    return f"{camera.model.name.lower()} {camera.width} x {camera.height}"


def pair_report(
    prepared: Sequence[PreparedScan], graph: ViewGraph, edge: tuple[int, int], config: Config
) -> PairReport:
    """What became of a pair of a view graph, with poses between the scans' own frames."""
    result = graph.pairs[edge]
    chosen = graph.accepted.get(edge) or result.best
    options = (*result.alternatives, *result.further_ties)
    weights = weights_of(options, config.pairs.min_margin, config.pairs.min_score)
    a, b = (prepared[k] for k in edge)
    is_swapped = b.name < a.name
    first, second = (b, a) if is_swapped else (a, b)

    def between_scans(i_from_j: Pose) -> Pose:
        pose = i_from_j.inverse() if is_swapped else i_from_j
        return first.scan_from_sensor @ pose @ second.scan_from_sensor.inverse()

    return PairReport(
        i=first.name,
        j=second.name,
        kind=result.kind,
        accepted=edge in graph.accepted,
        reason=graph.rejected.get(edge) or graph.remarks.get(edge) or _remark(result, chosen),
        i_from_j=None if chosen is None else between_scans(chosen.i_from_j),
        score=None if chosen is None else chosen.score,
        overlap=0.0 if chosen is None else _overlap_share(chosen.evidence),
        evidence=None if chosen is None else chosen.evidence,
        margin=result.margin,
        observability=result.observability,
        sliding=None if result.sliding is None else result.sliding.slide,
        searched=result.is_searched,
        alternatives=tuple(
            AlternativeReport(
                i_from_j=between_scans(option.i_from_j), score=option.score, weight=weight
            )
            for option, weight in zip(options, weights, strict=True)
        ),
        passed_over=tuple(
            AlternativeReport(i_from_j=between_scans(option.i_from_j), score=option.score)
            for option in result.passed_over
        ),
    )


def _remark(result: PairResult, chosen: Alternative | None) -> str:
    if chosen is not None and chosen is not result.best:
        return "not its best pose alone, but the one that the other scans bear out"
    return result.reason and f"weak alone ({result.reason}), but borne out by the other scans"


def _overlap_share(evidence: Evidence) -> float:
    """Share of all samples that lie on the other scan's surface."""
    return evidence.agree + evidence.contradict


def _bodies(graph: ViewGraph) -> list[str]:
    """That not all of what the scans show moves as one body, where that is in doubt."""
    doubts = [doubt for some in graph.doubts.values() for doubt in some]
    told = sorted({doubt.text for doubt in doubts if doubt.code is DoubtCode.CAMERA_STOOD})
    if any(doubt.code in (DoubtCode.MOVED_PART, DoubtCode.VIOLATED) for doubt in doubts):
        told.append(
            "parts of scans lie where other sensors saw through or saw something else: a part of "
            "the object moved by itself, or a pose is wrong"
        )
    return told


def _denied(facts: Sequence[FactReport]) -> list[str]:
    """Facts of the users that the scans contradict."""
    return [
        f"the scans contradict what is given ({fact.fact}): {fact.reason}"
        for fact in facts
        if fact.verdict is FactVerdict.CONTRADICTED
    ]


def _verdict(
    graph: ViewGraph,
    scans: Mapping[str, ScanReport],
    mesh: TriangleMesh | None,
    denied: Sequence[str],
    config: Config,
) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict and its reasons, with what speaks against the run as a whole."""
    if not graph.components:
        told = ("no two scans could be registered to each other", *why_open(graph), *denied)
        return Verdict.NOTHING, told
    largest = graph.components[0]
    by_verdict = {
        kind: [name for name, scan in sorted(scans.items()) if scan.verdict is kind]
        for kind in ScanVerdict
    }
    reasons = []
    if by_verdict[ScanVerdict.DOUBTFUL]:
        told = "" if config.fusion.with_doubtful else " (placed, but left out of the model)"
        reasons.append(f"doubtful: {', '.join(by_verdict[ScanVerdict.DOUBTFUL])}{told}")
    reasons += _bodies(graph)
    if by_verdict[ScanVerdict.UNPLACED]:
        reasons.append(f"not placed: {', '.join(by_verdict[ScanVerdict.UNPLACED])}")
    if len(graph.components) > 1:
        sizes = ", ".join(str(len(component.poses)) for component in graph.components)
        reasons.append(f"the scans fall into {len(graph.components)} components of {sizes} scans")
    if not config.fusion.with_doubtful and largest.poses.keys() <= graph.doubts.keys():
        reasons.append("no model: all scans that it would be made of are doubtful")
    elif mesh is None:
        reasons.append("the placed scans could not be fused into a model")
    reasons += why_open(graph)
    reasons += denied
    if by_verdict[ScanVerdict.DOUBTFUL] or denied:
        return Verdict.DOUBTFUL, tuple(reasons)
    return (Verdict.PARTIAL if reasons else Verdict.GOOD), tuple(reasons)
