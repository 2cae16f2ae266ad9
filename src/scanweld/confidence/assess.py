"""Evidence to confidence: every pair and every placed scan, by the calibrated model."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from scanweld.confidence.grounds import Grounds, is_supported, pair_grounds, scan_grounds
from scanweld.confidence.joint_evidence import JointEvidence, joint_evidence
from scanweld.confidence.links import links
from scanweld.confidence.model import Calibration
from scanweld.confidence.witnesses import Witnesses
from scanweld.multiview.view_graph import Edge, ViewGraph
from scanweld.pairs.result import Alternative, PairKind, PairResult

OPEN = 0.49
"""Most confidence in a pose that what was seen leaves open: it slides, or another fits as well."""
MIN_COHERENT_SCORE = 0.0
"""Score below which the contours of a pair that is not accepted are not looked at."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Assessed:
    """The probability that a pose is right, and what it rests on."""

    confidence: float
    grounds: Grounds


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Confidence:
    """Of the pose that each pair names (accepted, else its best), and of each placed scan."""

    pairs: Mapping[Edge, Assessed] = field(default_factory=dict)
    scans: Mapping[int, Assessed] = field(default_factory=dict)


def assess(graph: ViewGraph, witnesses: Witnesses, calibration: Calibration) -> Confidence:
    """Give every pair that has a pose, and every placed scan, its confidence.

    Args:
        graph: The view graph with its final poses.
        witnesses: All scans of the run.
        calibration: The models.
    """
    homes: dict[int, JointEvidence] = {}
    for component in graph.components:
        joint = joint_evidence(graph, component, witnesses)
        homes.update(dict.fromkeys(component.poses, joint))
    pairs = {
        edge: _assess_pair(result, chosen, graph, homes, witnesses, calibration)
        for edge, result in graph.pairs.items()
        if (chosen := graph.accepted.get(edge) or result.best) is not None
    }
    return Confidence(pairs=pairs, scans=_assess_scans(graph, homes, pairs, calibration))


def close_open(probability: float, kind: PairKind, grounds: Grounds) -> float:
    """A pair's probability, at most ``OPEN`` if its two scans and no others leave it open."""
    is_open = kind in (PairKind.SLIDING, PairKind.AMBIGUOUS)
    return (
        min(probability, OPEN) if is_open and not is_supported(grounds["support"]) else probability
    )


def as_tied(probability: float, link: float) -> float:
    """A scan's probability, at most that of what ties it to the others."""
    return min(probability, 1.0 - math.exp(-link))


def _assess_pair(
    result: PairResult,
    chosen: Alternative,
    graph: ViewGraph,
    homes: Mapping[int, JointEvidence],
    witnesses: Witnesses,
    calibration: Calibration,
) -> Assessed:
    is_accepted = (result.i, result.j) in graph.accepted
    joint = homes.get(result.i)
    if joint is not homes.get(result.j):
        joint = None
    at_contours = is_accepted or chosen.score > MIN_COHERENT_SCORE
    looks = witnesses.look(result.i, result.j, chosen.i_from_j, at_contours=at_contours)
    grounds = pair_grounds(result, chosen, looks, joint, is_accepted)
    probability = calibration.pair.probability(grounds)
    if (result.i, result.j) not in graph.remarks:
        probability = close_open(probability, result.kind, grounds)
    if result.is_marked:
        probability = min(probability, OPEN)
    return Assessed(confidence=probability, grounds=grounds)


def _assess_scans(
    graph: ViewGraph,
    homes: Mapping[int, JointEvidence],
    pairs: Mapping[Edge, Assessed],
    calibration: Calibration,
) -> dict[int, Assessed]:
    accepted = {edge: pairs[edge] for edge in graph.accepted}
    scans: dict[int, Assessed] = {}
    for component in graph.components:
        tied = links(component, {edge: pair.confidence for edge, pair in accepted.items()})
        for k in sorted(component.poses):
            own = [pair.grounds["coherence"] for edge, pair in accepted.items() if k in edge]
            grounds = scan_grounds(k, homes[k], tied[k], max(own, default=0.0))
            confidence = as_tied(calibration.scan.probability(grounds), tied[k])
            scans[k] = Assessed(confidence=confidence, grounds=grounds)
    return scans
