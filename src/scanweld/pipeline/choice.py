"""Which pairs of scans are searched: all of a few, of many some partners of each.

Among many scans of one object most see what many others see. So each is searched with a few, then
those left outside beside views from all around, then those still outside with all.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from scanweld.evidence.judge import Poses
from scanweld.graph.partners import MAX_PARTNERS
from scanweld.graph.view_graph import Edge
from scanweld.pairs.result import PairResult

MAX_ALL = 24
"""So many scans are searched each with each."""
NUM_FIRST = 4
"""Of more, each is searched with so many that follow it, in an order that says nothing of where
they look: eight partners each."""
NUM_BESIDE = 12
"""Views, spread over the largest component, beside which a scan left outside is searched."""


def first_pairs(num_scans: int, components: Sequence[Poses]) -> list[Edge]:
    """The pairs (i, j), i < j, that are searched when nothing is known."""
    del components
    if num_scans <= MAX_ALL:
        return list(combinations(range(num_scans), 2))
    following = [
        (k, (k + n) % num_scans) for k in range(num_scans) for n in range(1, NUM_FIRST + 1)
    ]
    return sorted({(min(edge), max(edge)) for edge in following})


def pairs_beside(num_scans: int, components: Sequence[Poses]) -> list[Edge]:
    """Scans outside the largest component, each beside views spread over it."""
    if num_scans <= MAX_ALL or not components:
        return []
    largest = max(components, key=len)
    inside = _spread(largest, NUM_BESIDE)
    outside = sorted(set(range(num_scans)) - set(largest))
    return sorted((min(i, j), max(i, j)) for i in outside for j in inside)


def pairs_left(num_scans: int, components: Sequence[Poses]) -> list[Edge]:
    """All pairs across components, and of scans that are in none."""
    return pairs_across(num_scans, components, {}) if num_scans > MAX_ALL else []


def pairs_across(
    num_scans: int, components: Sequence[Poses], found: Mapping[Edge, PairResult]
) -> list[Edge]:
    """Pairs of scans that no component holds together; of many, those that look best so far.

    Args:
        num_scans: Of the run.
        components: What is placed together.
        found: What quick searches found of pairs; if nothing, all pairs are given.
    """
    home = {k: n for n, poses in enumerate(components) for k in poses}
    edges = [
        (i, j)
        for i, j in combinations(range(num_scans), 2)
        if i not in home or home[i] != home.get(j)
    ]
    if num_scans <= MAX_ALL or not found:
        return edges
    chosen: set[Edge] = set()
    for k in range(num_scans):
        own = [edge for edge in edges if k in edge and edge in found]
        own.sort(key=lambda edge: (-_score(found[edge]), edge))
        chosen.update(own[:MAX_PARTNERS])
    return sorted(chosen)


def _score(result: PairResult) -> float:
    return -np.inf if result.best is None else result.best.score


def _spread(poses: Poses, number: int) -> list[int]:
    """Scans that look in directions as different as can be, from the first on."""
    scans = sorted(poses)
    axes = np.array([poses[k].rotation[:, 2] for k in scans])
    chosen = [0]
    nearest = axes @ axes[0]
    while len(chosen) < min(number, len(scans)):
        chosen.append(int(np.argmin(nearest)))
        nearest = np.maximum(nearest, axes @ axes[chosen[-1]])
    return [scans[n] for n in chosen]
