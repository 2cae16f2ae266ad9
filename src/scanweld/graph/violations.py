"""Parts of placed scans that lie where no surface can, by what other sensors saw there."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from scanweld.evidence.evidence import MAX_EXCESS, Evidence, seen_twice
from scanweld.evidence.judge import PairJudge
from scanweld.graph.doubts import DoubtCode, Doubts, doubt_of, merged
from scanweld.graph.view_graph import Component, Edge, ViewGraph

_BEFORE = (
    "a part of {:.0%} of its surface lies before what another sensor saw: a part of the object "
    "moved, or a pose is wrong"
)
_IN_FREE_SPACE = (
    "a part of {:.0%} of its surface lies where another sensor saw through: a part of the object "
    "moved, or a pose is wrong"
)
_INSIDE = (
    "a part of {:.0%} of its surface is what another sensor saw from the other side, as if the "
    "object had no thickness there: one of them shows a false inside, or a pose is wrong"
)


def violation_doubts(graph: ViewGraph, component: Component, judge: PairJudge) -> Doubts:
    """Doubts about the scans of a component by patches that the set's sensor does not excuse.

    Before a surface and in free space either scan of a pair may be wrong, and what moved is in
    both; a false inside is that of the scan that most others accuse.

    Args:
        graph: The view graph.
        component: One of its components.
        judge: Says what the sensors say of pairs at the component's poses.
    """
    poses, limits = component.poses, judge.limits
    told = {
        (i, j): judge.pair(i, j, poses[i].inverse() @ poses[j])
        for i, j in graph.compared(component)
    }

    def beyond(excess: Callable[[Evidence], float]) -> dict[Edge, Evidence]:
        return {edge: said for edge, said in told.items() if excess(said) > MAX_EXCESS}

    before = beyond(lambda said: said.front_excess(limits))
    free = beyond(lambda said: said.free_excess(limits))
    if seen_twice(said.free_excess(limits) for said in told.values()) <= MAX_EXCESS:
        free = {}
    inside = beyond(lambda said: said.inside_patch)
    accused = accused_most(inside)
    insides = _largest({edge: said.inside_patch for edge, said in inside.items()})
    return merged(
        _told(
            DoubtCode.MOVED_PART, _BEFORE, _largest({e: d.front_patch for e, d in before.items()})
        ),
        _told(
            DoubtCode.VIOLATED, _IN_FREE_SPACE, _largest({e: d.free_patch for e, d in free.items()})
        ),
        _told(DoubtCode.INSIDE, _INSIDE, {k: insides[k] for k in accused}),
    )


def accused_most(edges: Iterable[Edge]) -> set[int]:
    """Scans of pairs that violate which explain all of these pairs, found greedily.

    Whoever has most pairs is accused, and those pairs are explained; of scans that have equally
    many none is spared, so that of a single pair both are accused.

    Args:
        edges: The pairs.
    """
    left, accused = set(edges), set[int]()
    while left:
        counts = Counter(k for edge in left for k in edge)
        most = max(counts.values())
        accused |= {k for k, count in counts.items() if count == most}
        left = {edge for edge in left if not accused.intersection(edge)}
    return accused


def _told(code: DoubtCode, text: str, shares: Mapping[int, float]) -> Doubts:
    return doubt_of(code, {k: text.format(share) for k, share in shares.items()})


def _largest(of_pairs: Mapping[Edge, float]) -> dict[int, float]:
    """The largest of each scan's pairs."""
    found: dict[int, float] = {}
    for edge, value in of_pairs.items():
        for k in edge:
            found[k] = max(found.get(k, 0.0), value)
    return found
