"""Which scans of a component are compared with each other: some partners of each.

All pairs of a large component say the same many times over, and grow with the square of the scans.
Each scan keeps partners from those it shares most with to those it hardly meets: near ones hold it
firmly, far ones keep long chains from drifting.
"""

from itertools import combinations

import numpy as np

from scanweld.evidence.judge import Judge, Poses
from scanweld.graph.view_graph import Edge
from scanweld.work.threads import map_in_rows

MAX_PARTNERS = 16
"""Partners that each scan chooses; in small components all others are."""


def partners(poses: Poses, judge: Judge, workers: int = 1) -> list[Edge]:
    """Pairs (i, j), i < j, of a component's scans that are compared, in order.

    Args:
        poses: ``component_from_sensor`` of its scans.
        judge: Gives the evidence on any pair at any pose.
        workers: Threads.
    """
    scans = sorted(poses)
    edges = list(combinations(scans, 2))
    if len(scans) <= MAX_PARTNERS + 1:
        return edges
    back = {k: poses[k].inverse() for k in scans}
    shared: dict[int, list[tuple[float, Edge]]] = {k: [] for k in scans}

    def agreement(edge: Edge) -> float:
        return judge.agree(*edge, back[edge[0]] @ poses[edge[1]])

    for (i, j), agree in zip(edges, map_in_rows(agreement, edges, workers), strict=True):
        if agree > 0.0:
            shared[i].append((-agree, (i, j)))
            shared[j].append((-agree, (i, j)))
    chosen: set[Edge] = set()
    for options in shared.values():
        options.sort()
        ranks = np.linspace(0, len(options) - 1, min(MAX_PARTNERS, len(options))).round()
        chosen.update(options[int(rank)][1] for rank in ranks)
    return sorted(chosen)
