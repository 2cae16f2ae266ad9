"""What is given beforehand, by index: pairs as it lets the view graph use them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from scanweld.config import PairsConfig
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.graph.reasons import why_unplaced
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.knowledge.turntable import Turntable
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pairs.verdict import no_pose, result_of

Reclassify = Callable[[Edge, tuple[Alternative, ...]], PairResult]
"""Classifies a pair anew by some of its poses, asking for less than usual of score and margin."""

KNOWN_SHARE = 0.5
"""Share of the usual score and margin that a pair needs where what is given speaks for it."""
APART = "said to be apart"
TOGETHER = "said to be together"
ON_AXIS = "a turn about the common axis"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Given:
    """Facts about the scans of a run.

    Attributes:
        fixed: world_from_scan of scans that stay where they are, in the order given.
        starts: Start poses i_from_j of pairs (i, j), i < j, between sensor frames.
        together: Pairs of one object that see some of the same surface.
        apart: Pairs whose scans must not be laid onto each other.
        turntable: Whether all scans relate by turns about one axis.
    """

    fixed: Mapping[int, Pose] = field(default_factory=dict)
    starts: Mapping[Edge, Pose] = field(default_factory=dict)
    together: frozenset[Edge] = frozenset()
    apart: frozenset[Edge] = frozenset()
    turntable: bool = False

    def start_key(self, edge: Edge) -> tuple[str, ...]:
        """What the key of a pair's work says of its start pose; nothing where there is none."""
        start = self.starts.get(edge)
        return () if start is None else ("start", start.matrix().tobytes().hex())


def easier_verdict(fields: Sequence[ScanField], diameter: float, config: PairsConfig) -> Reclassify:
    """What classifies pairs for which something is known, on less than the usual."""
    easier = config.model_copy(
        update={
            "min_score": KNOWN_SHARE * config.min_score,
            "min_margin": KNOWN_SHARE * config.min_margin,
        }
    )

    def reclassify(edge: Edge, alternatives: tuple[Alternative, ...]) -> PairResult:
        i, j = edge
        return result_of(i, j, fields[i], fields[j], alternatives, diameter, easier)

    return reclassify


def pairs_as_given(
    pairs: Mapping[Edge, PairResult],
    given: Given,
    turntable: Turntable | None,
    reclassify: Reclassify,
) -> dict[Edge, PairResult]:
    """The pairs as the view graph may use them.

    Pairs apart have no pose. Poses off the turntable's axis are left out, and are no rivals. A
    pair that is together, or on the axis, needs less score and margin to be good; violations
    count as ever.

    Args:
        pairs: Results of pairs (i, j), i < j.
        given: What is given.
        turntable: The common axis, if there is one.
        reclassify: Classifies a pair anew by some of its poses.
    """
    known = {}
    for edge, result in pairs.items():
        if edge in given.apart:
            known[edge] = no_pose(*edge, APART)
            continue
        known[edge] = _on_axis(edge, result, turntable, reclassify) if turntable else result
        if edge in given.together and known[edge].kind is not PairKind.GOOD:
            known[edge] = _believed(known[edge], reclassify)
    return known


def _on_axis(
    edge: Edge, result: PairResult, turntable: Turntable, reclassify: Reclassify
) -> PairResult:
    left = tuple(o for o in result.alternatives if turntable.allows(edge, o.i_from_j))
    if result.best is None or (left and left[0] is result.best and result.kind is PairKind.GOOD):
        return replace(result, alternatives=left)
    if not left:
        return no_pose(*edge, off_axis_words(edge, result.best.i_from_j, turntable))
    return _believed(replace(result, alternatives=left), reclassify)


def off_axis_words(edge: Edge, i_from_j: Pose, turntable: Turntable) -> str:
    """That a pose is no turn about the axis, and by how much."""
    angle, shift = turntable.off_axis(edge, i_from_j)
    if angle >= turntable.near[0]:
        return f"off the turntable's axis by {angle:.1f} deg"
    times = shift / turntable.near[1]
    return f"off the turntable's axis: shifted {times:.1f} times what is allowed"


def _believed(result: PairResult, reclassify: Reclassify) -> PairResult:
    """The pair, good if it is so by the easier measure; else as it is."""
    if not result.alternatives:
        return result
    judged = reclassify((result.i, result.j), result.alternatives)
    if judged.kind is PairKind.GOOD:
        return judged
    return replace(result, kind=judged.kind, reason=judged.reason or result.reason)


def with_given(graph: ViewGraph, pairs: Mapping[Edge, PairResult], given: Given) -> ViewGraph:
    """The view graph of ``pairs_as_given`` with the pairs themselves, and what is fixed fixed."""
    told = {
        edge: replace(result, reason=graph.pairs[edge].reason or result.reason)
        for edge, result in pairs.items()
    }
    remarks = {}
    for edge in graph.accepted:
        if graph.pairs[edge].kind is PairKind.GOOD and pairs[edge].kind is not PairKind.GOOD:
            by = TOGETHER if edge in given.together else ON_AXIS
            remarks[edge] = f"weak alone ({pairs[edge].reason}), but {by}"
    return replace(
        graph,
        pairs=pairs,
        components=tuple(_held(component, given) for component in graph.components),
        unplaced={k: why_unplaced(k, told) for k in graph.unplaced},
        remarks=remarks,
    )


def _held(component: Component, given: Given) -> Component:
    """The component with a fixed scan, if it holds one, as its reference."""
    reference = next((k for k in given.fixed if k in component.poses), None)
    if reference is None:
        return component
    to_reference = component.poses[reference].inverse()
    moved = {k: to_reference @ pose for k, pose in component.poses.items()}
    moved[reference] = Pose.identity()
    return Component(poses=moved, reference=reference, world_from_scan=given.fixed[reference])
