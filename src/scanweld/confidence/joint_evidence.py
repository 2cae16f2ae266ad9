"""What all scans of a component say together: of each scan's place, and of each pair's pose."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from scanweld.confidence.diagnostics import Fit, PairDiagnostics, over
from scanweld.confidence.misfit import misfit, two_way_offsets
from scanweld.evidence.evidence import MIN_AGREE, Evidence
from scanweld.evidence.information import information_from, observability_of, two_way_matches
from scanweld.evidence.judge import Poses
from scanweld.evidence.rivals import (
    MIN_RIVAL_SHARE,
    RIVAL_ANGLE_DEG,
    RIVAL_SHIFT_DIAMETERS,
    as_rival,
    margin_over,
    refutation,
)
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.merge import Merge, propose_merges
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.work.threads import map_in_order, map_in_rows

MIN_CONDUCTANCE = 0.02
"""Accepted pairs conduct by their score, and none less than this."""
LEAK = 1e-6
"""Conductance between any two scans, so that it is defined between those that no pair joins."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class JointEvidence:
    """A component looked at as a whole.

    Attributes:
        between: Evidence on all pairs (i, j), i < j, at the component's poses.
        margins: For each scan, the share of the score of its place by which that beats the best
            distinct place that any pair proposes for it, as all others judge it.
        refutations: For each scan, how clearly such places are refuted.
        fits: How each scan lies on all others together; their coherence is left to pairs.
        conductance: Between any two scans through accepted pairs, each of which conducts by its
            score: a short way, a strong way and many ways are all better.
    """

    between: Mapping[Edge, Evidence]
    margins: Mapping[int, float]
    refutations: Mapping[int, float]
    fits: Mapping[int, Fit]
    conductance: Mapping[Edge, float]

    def conductance_without(self, edge: Edge, score: float) -> float:
        """Conductance between the scans of an accepted pair of that score without the pair."""
        return max(self.conductance[edge] - max(score, MIN_CONDUCTANCE), 0.0)


def joint_evidence(
    graph: ViewGraph, component: Component, diagnostics: PairDiagnostics, workers: int = 1
) -> JointEvidence:
    """Ask all scans of a component about each of them.

    Args:
        graph: The view graph.
        component: One of its components.
        diagnostics: All scans of the run.
        workers: Threads.
    """
    poses = component.poses
    edges = graph.compared(component)

    def evidence(edge: Edge) -> Evidence:
        i, j = edge
        return diagnostics.judge.pair(i, j, poses[i].inverse() @ poses[j])

    between = dict(zip(edges, map_in_rows(evidence, edges, workers), strict=True))
    near = {
        k: {m: poses[m] for edge in between if k in edge for m in edge if m != k} for k in poses
    }

    def look(k: int) -> tuple[_Standing, Fit]:
        own = {k: poses[k], **near[k]}
        return _standing(k, graph, own, between, diagnostics), _fit(k, own, diagnostics)

    scans = sorted(poses)
    looks = dict(zip(scans, map_in_order(look, scans, workers), strict=True))
    return JointEvidence(
        between=between,
        margins={k: standing.margin for k, (standing, _) in looks.items()},
        refutations={k: standing.refutation for k, (standing, _) in looks.items()},
        fits={k: fit for k, (_, fit) in looks.items()},
        conductance=_conductance(graph, component),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class _Standing:
    """A place beside others: its margin over them, and how clearly they are refuted."""

    margin: float
    refutation: float


def _standing(
    k: int,
    graph: ViewGraph,
    poses: Poses,
    between: Mapping[Edge, Evidence],
    diagnostics: PairDiagnostics,
) -> _Standing:
    """The place of a scan beside other places, its partners being where they are."""
    others = {m: pose for m, pose in poses.items() if m != k}
    judge = diagnostics.judge
    same = PoseTolerance(angle_deg=RIVAL_ANGLE_DEG, shift=RIVAL_SHIFT_DIAMETERS * judge.diameter)
    alone = {k: Pose.identity()}
    merges = propose_merges(others, alone, graph.usable, judge.centres, same, judge)
    said = _said_of(k, between)
    here = Merge(
        a_from_b=poses[k],
        proposals=(),
        agree=sum(e.agree for e in said),
        violated=sum(e.surface_violation for e in said),
        free=sum(e.free for e in said),
        worst=0.0,
    )
    rivals = [m for m in merges if not same.covers(m.a_from_b, poses[k], judge.centres[k])]
    scores = [
        as_rival(rival.score, (rival.agree, here.agree), (_violated(rival), _violated(here)))
        for rival in rivals
        if not rival.is_contradicted
    ]
    margin = margin_over(here.score, scores)
    least = max(MIN_AGREE, MIN_RIVAL_SHARE * here.agree)
    return _Standing(
        margin=max(margin, -1.0),
        refutation=refutation([_violated(rival) for rival in rivals if rival.agree >= least]),
    )


def _violated(merge: Merge) -> float:
    return (merge.violated + merge.free) / max(merge.agree, MIN_AGREE)


def _said_of(scan: int, between: Mapping[Edge, Evidence]) -> list[Evidence]:
    return [evidence for edge, evidence in between.items() if scan in edge]


def _fit(k: int, poses: Poses, diagnostics: PairDiagnostics) -> Fit:
    """How a scan lies on all others together."""
    judge, sources = diagnostics.judge, diagnostics.sources
    fields, tolerance, diameter = judge.fields, judge.tolerance, judge.diameter
    k_from = {m: poses[k].inverse() @ pose for m, pose in sorted(poses.items()) if m != k}
    found = [two_way_matches(fields[k], fields[m], pose, tolerance) for m, pose in k_from.items()]
    information, _, _ = information_from(found, diameter)
    patches = [
        two_way_offsets(sources[k], sources[m], pose, tolerance, diameter)
        for m, pose in k_from.items()
    ]
    return Fit(
        observability=observability_of(information),
        misfit=over(misfit(np.concatenate(patches)), diagnostics.sensor.sigma),
        coherence=0.0,
    )


def _conductance(graph: ViewGraph, component: Component) -> dict[Edge, float]:
    """Effective conductance between all pairs of scans: 1 / (e_i - e_j)^T L^+ (e_i - e_j)."""
    scans = sorted(component.poses)
    at = {k: n for n, k in enumerate(scans)}
    laplacian = LEAK * (len(scans) * np.eye(len(scans)) - 1.0)
    for (i, j), option in graph.accepted.items():
        if i in at and j in at:
            a, b = at[i], at[j]
            conducts = max(option.score, MIN_CONDUCTANCE)
            laplacian[[a, b], [a, b]] += conducts
            laplacian[[a, b], [b, a]] -= conducts
    inverse = np.linalg.pinv(laplacian, hermitian=True)
    return {
        (i, j): 1.0 / float(inverse[a, a] + inverse[b, b] - 2 * inverse[a, b])
        for (i, a), (j, b) in combinations(at.items(), 2)
    }
