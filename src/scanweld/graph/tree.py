"""Clear pairs -> components: a tree of the strongest, every pair across looked at.

Where two scans alone leave no doubt, nothing has to be weighed: the pairs are put together from the
strongest down (Kruskal), and what a chain of them implies of other scans must not contradict these.
Whatever clear pairs do not agree on is left to the thorough search and to merging.
"""

from collections.abc import Collection, Sequence

from scanweld.evidence.judge import Poses
from scanweld.geometry.pose import Pose
from scanweld.graph.merge import judged_motion
from scanweld.graph.problem import GraphProblem
from scanweld.graph.view_graph import Edge


def clear_components(problem: GraphProblem, clear: Collection[Edge]) -> list[Poses]:
    """Components of two scans and more that clear pairs make without contradiction.

    Args:
        problem: The pairs, and who judges and settles components.
        clear: Pairs (i, j), i < j, that are believed.
    """
    pairs = problem.pairs
    edges = sorted(clear, key=lambda edge: (-pairs[edge].alternatives[0].score, edge))
    while True:
        components = _grown(problem, edges)
        disputed = _disputed(problem, components, edges)
        if not disputed:
            return components
        edges = [edge for edge in edges if not disputed & set(edge)]


def _grown(problem: GraphProblem, edges: Sequence[Edge]) -> list[Poses]:
    """Components by the strongest edges first; settled whenever one has doubled."""
    home: dict[int, Poses] = {k: {k: Pose.identity()} for edge in edges for k in edge}
    settled_at: dict[int, int] = dict.fromkeys(home, 2)
    for i, j in edges:
        a, b = home[i], home[j]
        if a is b:
            continue
        a_from_b = a[i] @ problem.pairs[i, j].alternatives[0].i_from_j @ b[j].inverse()
        merge = judged_motion(a, b, a_from_b, problem.judge)
        if merge.is_contradicted or problem.joins_apart(a, b, merge):
            continue
        joined = dict(sorted({**a, **{k: a_from_b @ pose for k, pose in b.items()}}.items()))
        last = max(settled_at[k] for k in joined)
        if len(joined) >= 2 * last:
            joined, last = dict(problem.settled(joined)), len(joined)
        home.update(dict.fromkeys(joined, joined))
        settled_at.update(dict.fromkeys(joined, last))
    distinct = {min(poses): poses for poses in home.values() if len(poses) > 1}
    return [distinct[first] for first in sorted(distinct)]


def _disputed(
    problem: GraphProblem, components: Sequence[Poses], edges: Sequence[Edge]
) -> set[int]:
    """Scans of clear pairs that do not agree with the component that both are in."""
    disputed: set[int] = set()
    for poses in components:
        for i, j in edges:
            if i in poses and j in poses:
                pair = problem.pairs[i, j].alternatives[0].i_from_j
                here = poses[i].inverse() @ poses[j]
                if not problem.same.covers(pair, here, problem.centres[j]):
                    disputed |= {i, j}
    return disputed
