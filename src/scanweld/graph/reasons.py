"""In words: why a pair is not used, why a scan is not placed, what speaks against a placed one."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from scanweld.evidence.judge import PairJudge
from scanweld.evidence.slippage import Slide, slide_words
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.doubts import Doubt, DoubtCode, doubt_of, merged
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.graph.violations import violation_doubts
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pairs.symmetry import fold_words

Said = TypeVar("Said")

MIN_ALIKE = 2
"""So many pairs, more than half of their kind, must say the same of the object to be quoted."""
OUTWEIGHED = 2.0
"""Accepted pairs outweigh a good one that disagrees if their scores sum to so many times its."""


def why_rejected(
    result: PairResult,
    components: Sequence[Component],
    centres: Sequence[FloatArray],
    same: PoseTolerance,
) -> str:
    """Why a pair is not used: by its own evidence, or because the rest disagrees with it."""
    i, j = result.i, result.j
    if result.best is None or result.kind is PairKind.NO_OVERLAP:
        return result.reason
    home = next((c for c in components if i in c.poses and j in c.poses), None)
    if home is None:
        return result.reason or "its scans could not be placed together without contradictions"
    i_from_j = home.poses[i].inverse() @ home.poses[j]
    apart = i_from_j.inverse() @ result.best.i_from_j
    if not same.covers(result.best.i_from_j, i_from_j, centres[j]):
        told = f"cycle: {apart.angle_deg():.1f} deg off what the other pairs say"
        return f"{told}; {result.reason}" if result.reason else told
    return result.reason or f"score {result.best.score:.2f} too low to hold"


def why_unplaced(scan: int, pairs: Mapping[Edge, PairResult]) -> str:
    """Why a scan is in no component: what is wrong with its best pair."""
    options = [
        (result.best.score, result)
        for edge, result in sorted(pairs.items())
        if scan in edge and result.best is not None
    ]
    if not options:
        return "no pose brings it onto any other scan"
    score, result = max(options, key=lambda option: option[0])
    told = result.reason or "it contradicts other scans"
    return f"no pair with another scan holds; the best one (score {score:.2f}): {told}"


def why_open(graph: ViewGraph) -> tuple[str, ...]:
    """Which symmetries leave poses open: what several pairs of scans not safely placed agree on."""
    unsure = graph.unplaced.keys() | graph.doubts.keys()
    pairs = [result for edge, result in sorted(graph.pairs.items()) if unsure & set(edge)]
    told = []
    folds = [p.symmetry.fold if p.symmetry.angles_deg else 0 for p in pairs if p.symmetry]
    fold, count = _agreed(folds)
    if count and fold != 0:
        words = fold_words(fold)
        told.append(f"the object looks alike after {words} ({count} pairs): poses are open")
    slide, count = _agreed([p.sliding.slide for p in pairs if p.sliding])
    if count and slide is not None and slide is not Slide.MANY:
        words = slide_words(slide)
        told.append(f"the scans slide on each other {words} ({count} pairs): poses are open")
    return tuple(told)


def _agreed(said: Sequence[Said]) -> tuple[Said | None, int]:
    """What most say, and how many do; 0 where there is no agreement."""
    most, count = max(Counter(said).items(), key=lambda item: item[1], default=(None, 0))
    return most, count if count >= MIN_ALIKE and 2 * count > len(said) else 0


def _rest_on_feature_alone(graph: ViewGraph, component: Component) -> set[int]:
    """Scans of a component that no good pairs join to most of it, but a mark alone."""
    inside = {edge: graph.usable[edge] for edge in graph.accepted if edge[0] in component.poses}
    if not any(result.rests_on_feature for result in inside.values()):
        return set()
    groups = [{k} for k in component.poses]
    for edge, result in inside.items():
        if result.kind is PairKind.GOOD:
            joined = set().union(*(group for group in groups if group & set(edge)))
            groups = [group for group in groups if not group & joined] + [joined]
    most = max(groups, key=len)
    return set(component.poses) - (most if len(most) > 1 else set())


def find_doubts(graph: ViewGraph, judge: PairJudge) -> dict[int, tuple[Doubt, ...]]:
    """What speaks against the final poses of placed scans, by scan; known doubts stay."""
    marked: dict[int, str] = {}
    unpaired: dict[int, str] = {}
    disagree: dict[int, str] = {}
    for component in graph.components:
        for k in _rest_on_feature_alone(graph, component):
            marked[k] = "only a small mark decides its pose: others hide the mark"
        for k in component.poses:
            if not graph.neighbours(k):
                unpaired[k] = "no single pair confirms its pose"
    for edge in _good_but_rejected(graph):
        against = graph.pairs[edge].alternatives[0].score
        for k in edge:
            if _strength(k, graph) < OUTWEIGHED * against:
                disagree[k] = "a good pair disagrees with its pose"
    return merged(
        graph.doubts,
        doubt_of(DoubtCode.MARK_ONLY, marked),
        *(violation_doubts(graph, component, judge) for component in graph.components),
        doubt_of(DoubtCode.UNPAIRED, unpaired),
        doubt_of(DoubtCode.DISAGREEMENT, disagree),
    )


def doubt_alone(graph: ViewGraph) -> dict[int, tuple[Doubt, ...]]:
    """Scans whose component has no other one without doubts: a pose is right beside others only."""
    sure = [sorted(set(component.poses) - set(graph.doubts)) for component in graph.components]
    told = "no other scan of its component is good"
    return doubt_of(DoubtCode.ALONE, {scans[0]: told for scans in sure if len(scans) == 1})


def best_first(graph: ViewGraph) -> ViewGraph:
    """The graph with the component of which most scans are good first: it makes the model."""
    doubtful = set(graph.doubts)

    def rank(component: Component) -> tuple[int, int, int]:
        scans = set(component.poses)
        return -len(scans - doubtful), -len(scans), min(scans)

    return replace(graph, components=tuple(sorted(graph.components, key=rank)))


def _strength(scan: int, graph: ViewGraph) -> float:
    return sum(max(option.score, 0.0) for edge, option in graph.accepted.items() if scan in edge)


def _good_but_rejected(graph: ViewGraph) -> list[Edge]:
    placed = [set(component.poses) for component in graph.components]
    return [
        edge
        for edge, result in graph.pairs.items()
        if result.kind is PairKind.GOOD
        and edge not in graph.accepted
        and any(set(edge) <= scans for scans in placed)
    ]
