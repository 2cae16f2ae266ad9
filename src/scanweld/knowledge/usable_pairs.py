"""Pairs as found, and as users' facts let the view graph use them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from scanweld.config import PairsConfig
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.graph.reasons import why_unplaced
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.knowledge.by_index import IndexedKnowledge
from scanweld.knowledge.turntable import Turntable
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pairs.verdict import held_to, no_pose, result_of

KNOWN_SHARE = 0.5
"""Share of the usual score and margin that a pair needs where a fact speaks for it."""
APART = "said to be apart"
TOGETHER = "said to be together"
ON_AXIS = "a turn about the common axis"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LenientVerdict:
    """Classifies pairs for which a fact speaks, asking for less than usual of score and margin.

    Attributes:
        fields: The scans, laid out.
        config: The usual settings.
        max_contradiction: Largest patches of violating samples over what agrees, in this set.
    """

    fields: Sequence[ScanField]
    config: PairsConfig
    max_contradiction: float

    def classify(self, edge: Edge, alternatives: tuple[Alternative, ...]) -> PairResult:
        """The result of a pair by some of its poses."""
        lenient = self.config.model_copy(
            update={
                "min_score": KNOWN_SHARE * self.config.min_score,
                "min_margin": KNOWN_SHARE * self.config.min_margin,
            }
        )
        i, j = (self.fields[k] for k in edge)
        problem = PairProblem(edge=edge, i=i, j=j, config=lenient)
        result = result_of(problem, alternatives)
        if result.best is None:
            return result
        return held_to(result, self.max_contradiction, result.best.evidence)


def usable_pairs(
    found: Mapping[Edge, PairResult],
    known: IndexedKnowledge,
    turntable: Turntable | None,
    verdict: LenientVerdict,
) -> dict[Edge, PairResult]:
    """The pairs as the view graph may use them.

    Pairs apart have no pose. Poses off the turntable's axis are left out, and are no rivals. A
    pair that is together, or on the axis, needs less score and margin to be good; violations
    count as ever.

    Args:
        found: Results of pairs (i, j), i < j, as the search found them.
        known: What users know.
        turntable: The common axis, if there is one.
        verdict: Classifies a pair anew by some of its poses.
    """
    usable = {}
    for edge, result in found.items():
        if edge in known.apart:
            usable[edge] = no_pose(*edge, APART)
            continue
        usable[edge] = _on_axis(edge, result, turntable, verdict) if turntable else result
        if edge in known.together and usable[edge].kind is not PairKind.GOOD:
            usable[edge] = _believed(usable[edge], verdict)
    return usable


def _on_axis(
    edge: Edge, result: PairResult, turntable: Turntable, verdict: LenientVerdict
) -> PairResult:
    left = tuple(o for o in result.alternatives if turntable.allows(edge, o.i_from_j))
    if result.best is None or (left and left[0] is result.best and result.kind is PairKind.GOOD):
        return replace(result, alternatives=left)
    if not left:
        return no_pose(*edge, turntable.off_axis_words(edge, result.best.i_from_j))
    return _believed(replace(result, alternatives=left), verdict)


def _believed(result: PairResult, verdict: LenientVerdict) -> PairResult:
    """The pair, good if it is so by the easier measure; else as it is."""
    if not result.alternatives:
        return result
    judged = verdict.classify((result.i, result.j), result.alternatives)
    if judged.kind is PairKind.GOOD:
        return judged
    return replace(result, kind=judged.kind, reason=judged.reason or result.reason)


def with_found_pairs(
    graph: ViewGraph, found: Mapping[Edge, PairResult], known: IndexedKnowledge
) -> ViewGraph:
    """A view graph of usable pairs, with those that were found beside, and what is fixed fixed.

    Args:
        graph: The view graph, built from ``usable_pairs``.
        found: The pairs as the search found them.
        known: What users know.
    """
    reasons = {
        edge: replace(result, reason=graph.usable[edge].reason or result.reason)
        for edge, result in found.items()
    }
    remarks = {}
    for edge in graph.accepted:
        if graph.usable[edge].kind is PairKind.GOOD and found[edge].kind is not PairKind.GOOD:
            by = TOGETHER if edge in known.together else ON_AXIS
            remarks[edge] = f"weak alone ({found[edge].reason}), but {by}"
    return replace(
        graph,
        pairs=found,
        components=tuple(_fixed(component, known) for component in graph.components),
        unplaced={k: why_unplaced(k, reasons) for k in graph.unplaced},
        remarks=remarks,
    )


def _fixed(component: Component, known: IndexedKnowledge) -> Component:
    """The component with a fixed scan, if it holds one, as its reference."""
    reference = next((k for k in known.fixed if k in component.poses), None)
    if reference is None:
        return component
    to_reference = component.poses[reference].inverse()
    moved = {k: to_reference @ pose for k, pose in component.poses.items()}
    moved[reference] = Pose.identity()
    return Component(poses=moved, reference=reference, world_from_scan=known.fixed[reference])
