"""Evidence to confidence: every pair and every placed scan, by the calibrated model."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from scanweld.confidence.diagnostics import PairDiagnostics
from scanweld.confidence.grounds import (
    LEAST_OBSERVABILITY,
    Grounds,
    is_corroborated,
    pair_grounds,
    scan_grounds,
)
from scanweld.confidence.joint_evidence import JointEvidence, joint_evidence
from scanweld.confidence.model import Calibration
from scanweld.confidence.ties import ties_of
from scanweld.config import Config
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.view_graph import Edge, ViewGraph
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.sensor.accuracy import pose_deviations
from scanweld.work.threads import map_in_rows

MAX_UNDECIDED_CONFIDENCE = 0.49
"""Most confidence in a pose that what was seen leaves open: it slides, another fits as well, or too
little speaks for it."""
MIN_COHERENT_SCORE = 0.0
"""Score below which the contours of a pair that is not accepted are not looked at."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Assessed:
    """The probability that a pose is right, and what it rests on."""

    confidence: float
    grounds: Grounds


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Confidence:
    """Of the pose that each pair names (accepted, else its best), and of each placed scan.

    Attributes:
        pairs: Confidence in pairs.
        scans: Confidence in scans.
        bounds: How far the pose of a scan may be off, at 95 %, if it is right.
        deviations: Standard deviations that the bounds rest on.
    """

    pairs: Mapping[Edge, Assessed] = field(default_factory=dict)
    scans: Mapping[int, Assessed] = field(default_factory=dict)
    bounds: Mapping[int, PoseTolerance] = field(default_factory=dict)
    deviations: Mapping[int, PoseTolerance] = field(default_factory=dict)


def assess(
    graph: ViewGraph,
    diagnostics: PairDiagnostics,
    calibration: Calibration,
    config: Config,
    workers: int = 1,
) -> Confidence:
    """Give every pair that has a pose, and every placed scan, its confidence.

    Args:
        graph: The view graph with its final poses.
        diagnostics: All scans of the run.
        calibration: The models.
        config: Settings: what leaves a pose open.
        workers: Threads; the result is the same for any number.
    """
    deviations = _deviations(graph, diagnostics, workers)
    bounds = calibration.bounds.of(deviations, diagnostics.sensor)
    homes: dict[int, JointEvidence] = {}
    for component in graph.components:
        joint = joint_evidence(graph, component, diagnostics, workers)
        homes.update(dict.fromkeys(component.poses, joint))

    def assessed(edge: Edge) -> Assessed | None:
        # Where users' facts leave a pair no pose, what was found is assessed.
        usable = graph.usable[edge]
        result = graph.pairs[edge] if usable.best is None else usable
        chosen = graph.accepted.get(edge) or result.best
        if chosen is None:
            return None
        return _assess_pair(result, chosen, graph, homes, diagnostics, calibration, config)

    told = zip(graph.pairs, map_in_rows(assessed, [*graph.pairs], workers), strict=True)
    pairs = {edge: pair for edge, pair in told if pair is not None}
    scans = _assess_scans(graph, homes, pairs, calibration, config)
    return Confidence(pairs=pairs, scans=scans, bounds=bounds, deviations=deviations)


def _deviations(
    graph: ViewGraph, diagnostics: PairDiagnostics, workers: int
) -> dict[int, PoseTolerance]:
    """Standard deviation of the pose of each placed scan."""
    sources = dict(enumerate(diagnostics.sources))
    return {
        k: deviation
        for component in graph.components
        for k, deviation in pose_deviations(
            sources, component.poses, graph.compared(component), diagnostics.sensor, workers
        ).items()
    }


def cap_undecided(probability: float, pair: PairResult, grounds: Grounds, config: Config) -> float:
    """A pair's probability, capped if the pair is not sure alone and nothing else decides.

    A good pair that only its ICP holds is not sure alone.
    """
    is_firm = pair.observability >= config.pairs.min_observability
    if pair.kind is PairKind.GOOD and is_firm:
        return probability
    is_decided = is_corroborated(grounds["support"]) and not _is_open(grounds, config)
    return probability if is_decided else min(probability, MAX_UNDECIDED_CONFIDENCE)


def cap_by_links(probability: float, grounds: Grounds, config: Config) -> float:
    """A scan's probability, at most that of what ties it to the others.

    At most ``MAX_UNDECIDED_CONFIDENCE`` if all others together leave its place open.
    """
    tied = min(probability, 1.0 - math.exp(-grounds["link"]))
    return min(tied, MAX_UNDECIDED_CONFIDENCE) if _is_open(grounds, config) else tied


def _is_open(grounds: Grounds, config: Config) -> bool:
    """Whether another place fits nearly as well, or the surfaces slide on each other."""
    least = math.log10(max(config.pairs.min_observability, LEAST_OBSERVABILITY))
    return grounds["margin"] < config.graph.min_margin or grounds["observability"] < least


def _assess_pair(
    result: PairResult,
    chosen: Alternative,
    graph: ViewGraph,
    homes: Mapping[int, JointEvidence],
    diagnostics: PairDiagnostics,
    calibration: Calibration,
    config: Config,
) -> Assessed:
    is_accepted = (result.i, result.j) in graph.accepted
    joint = homes.get(result.i)
    if joint is not homes.get(result.j):
        joint = None
    at_contours = is_accepted or chosen.score > MIN_COHERENT_SCORE
    fit = diagnostics.fit(result.i, result.j, chosen.i_from_j, at_contours=at_contours)
    told = diagnostics.judge.pair(result.i, result.j, chosen.i_from_j)
    grounds = pair_grounds(result, chosen, told, fit, joint, is_accepted)
    probability = calibration.pair.probability(grounds)
    probability = cap_undecided(probability, result, grounds, config)
    if result.rests_on_feature:
        probability = min(probability, MAX_UNDECIDED_CONFIDENCE)
    return Assessed(confidence=probability, grounds=grounds)


def _assess_scans(
    graph: ViewGraph,
    homes: Mapping[int, JointEvidence],
    pairs: Mapping[Edge, Assessed],
    calibration: Calibration,
    config: Config,
) -> dict[int, Assessed]:
    accepted = {edge: pairs[edge] for edge in graph.accepted}
    scans: dict[int, Assessed] = {}
    for component in graph.components:
        tied = ties_of(component, {edge: pair.confidence for edge, pair in accepted.items()})
        for k in sorted(component.poses):
            own = [pair.grounds["coherence"] for edge, pair in accepted.items() if k in edge]
            grounds = scan_grounds(k, homes[k], tied[k], max(own, default=0.0))
            confidence = cap_by_links(calibration.scan.probability(grounds), grounds, config)
            scans[k] = Assessed(confidence=confidence, grounds=grounds)
    return scans
