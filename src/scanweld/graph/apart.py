"""Why components stay apart although pairs between them agree on how they lie on each other."""

from collections.abc import Sequence
from itertools import combinations

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.proposals import proposed_motions
from scanweld.graph.view_graph import Component, ViewGraph

MIN_SAYING = 4
"""Pairs between two components that must say the same: of other objects, and of turns that look
alike, as a rule fewer do."""


def why_apart(
    graph: ViewGraph, centres: Sequence[FloatArray], same: PoseTolerance
) -> tuple[str, ...]:
    """What is likely to have moved between components that many pairs would join alike.

    Where pairs found separately say the same motion and other scans contradict it, most of what the
    scans show moved as one body, and a part did not.

    Args:
        graph: The view graph.
        centres: (3,) middle of each scan's samples, sensor frame.
        same: Motions that differ by less are the same.
    """
    told = []
    for a, b in combinations(graph.components, 2):
        count = _most_saying(a, b, graph, centres, same)
        if count >= MIN_SAYING:
            sizes = f"{len(a.poses)} and {len(b.poses)}"
            told.append(
                f"{count} pairs lay the components of {sizes} scans onto each other in the same "
                "way, which others contradict: a part of the object moved between them, or "
                "something else was seen beside it"
            )
    return tuple(told)


def _most_saying(
    a: Component,
    b: Component,
    graph: ViewGraph,
    centres: Sequence[FloatArray],
    same: PoseTolerance,
) -> int:
    """Pairs that say the motion which most pairs say."""
    motions = proposed_motions(a.poses, b.poses, graph.usable, centres, same)
    return max(
        (sum(p.score > 0 and not p.is_given for p in said) for _, said in motions), default=0
    )
