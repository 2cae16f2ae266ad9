"""Worlds of scans, pairs drawn from them, and what must hold of their view graphs."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanweld.config import GraphConfig
from scanweld.evidence.evidence import Evidence, PatchLimits
from scanweld.evidence.judge import PairJudge, Poses
from scanweld.evidence.patches import PixelConsensus
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.graph.assemble import build_view_graph
from scanweld.graph.problem import GraphProblem, Settle
from scanweld.graph.reasons import find_doubts
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.pairs.result import Alternative, PairKind, PairResult

CENTRE = np.array([0.0, 0.0, 3.0])
SAME_DEG, SAME_SHIFT = 2.5, 0.03
GOOD, WEAK = 0.4, 0.09
DENIED = Evidence(
    agree=0.1, front=0.2, contradict=0.0, free=0.1, occluded=0.5, unknown=0.1, front_patch=0.1
)
Pairs = dict[Edge, PairResult]
Say = Callable[[int, int, Pose], Evidence]
SAME = PoseTolerance(angle_deg=5.0, shift=0.03)
USUAL_LIMITS = PatchLimits(contradiction=0.1)
NOWHERE = np.zeros((4, 4), dtype=bool)
SILENT = PixelConsensus(agrees=NOWHERE, violates=NOWHERE, in_free_space=NOWHERE, max_pixels=1.0)


def nothing_seen(a: Poses, b: Poses) -> list[PixelConsensus]:
    return [SILENT] * (len(a) + len(b))


@dataclass(frozen=True, kw_only=True)
class DrawnJudge:
    """A judge that says what is drawn."""

    says: Say
    sees: Callable[[Poses, Poses], list[PixelConsensus]] = nothing_seen
    limits: PatchLimits = USUAL_LIMITS

    def pair(self, i: int, j: int, i_from_j: Pose) -> Evidence:
        return self.says(i, j, i_from_j)

    def poses(self, i: int, j: int, i_from_j: Sequence[Pose]) -> list[Evidence]:
        return [self.says(i, j, pose) for pose in i_from_j]

    def pixels(self, a: Poses, b: Poses) -> list[PixelConsensus]:
        return self.sees(a, b)


def world_of(num_scans: int, seed: int = 0) -> list[Pose]:
    """world_from_sensor of scans of an object of diameter 1, seen from anywhere."""
    rng = np.random.default_rng(seed)
    rotations = [random_rotation(rng) for _ in range(num_scans)]
    shifts = rng.uniform(-0.3, 0.3, size=(num_scans, 3))
    return [
        Pose(rotation=r, translation=t - r @ CENTRE) for r, t in zip(rotations, shifts, strict=True)
    ]


def seen(agree: float) -> Evidence:
    """Evidence without a violation; the rest is out of sight."""
    return Evidence(
        agree=agree, front=0.0, contradict=0.0, free=0.0, occluded=1.0 - agree, unknown=0.0
    )


def option(i_from_j: Pose, agree: float = GOOD) -> Alternative:
    return Alternative(i_from_j=i_from_j, evidence=seen(agree))


def pair_of(i: int, j: int, kind: PairKind, *options: Alternative) -> PairResult:
    return PairResult(
        i=i,
        j=j,
        kind=kind,
        reason="" if kind is PairKind.GOOD else f"{kind} by itself",
        alternatives=options,
        information=np.eye(6),
        observability=1.0,
        margin=1.0,
        rms=0.0,
    )


def true_pose(world: Sequence[Pose], i: int, j: int) -> Pose:
    return world[i].inverse() @ world[j]


def exact_pair(
    i: int, j: int, world: Sequence[Pose], agree: float = GOOD, kind: PairKind = PairKind.GOOD
) -> PairResult:
    return pair_of(i, j, kind, option(true_pose(world, i, j), agree))


def exact_pairs(
    edges: Iterable[Edge], world: Sequence[Pose], agree: Mapping[Edge, float] | None = None
) -> Pairs:
    """Good pairs along the edges; between all other scans nothing fits."""
    n, drawn = len(world), set(edges)
    pairs = {}
    for i in range(n):
        for j in range(i + 1, n):
            if (i, j) in drawn:
                pairs[i, j] = exact_pair(i, j, world, (agree or {}).get((i, j), GOOD))
            else:
                pairs[i, j] = pair_of(i, j, PairKind.NO_OVERLAP)
    return pairs


def turn_about_centre(degrees: float, axis: Sequence[float] = (0.6, 0.0, 0.8)) -> Pose:
    turn = Pose.exp([*(np.radians(degrees) * np.array(axis)), 0, 0, 0])
    return Pose(rotation=turn.rotation, translation=CENTRE - turn.rotation @ CENTRE)


def turned(pair: PairResult, degrees: float) -> PairResult:
    """The same pair, as sure of itself as before, with a pose that is off by an angle."""
    best = pair.alternatives[0]
    wrong = replace(best, i_from_j=best.i_from_j @ turn_about_centre(degrees))
    return replace(pair, alternatives=(wrong, *pair.alternatives[1:]))


def graph_with(
    pairs: Pairs,
    *components: Component,
    accepted: Pairs | None = None,
    unplaced: Mapping[int, str] | None = None,
) -> ViewGraph:
    """A graph of pairs as found, of which some are accepted at their best pose."""
    return ViewGraph(
        pairs=pairs,
        usable=pairs,
        accepted={edge: pair.alternatives[0] for edge, pair in (accepted or {}).items()},
        rejected={},
        components=components,
        unplaced=unplaced or {},
    )


def is_same(p: Pose, q: Pose) -> bool:
    apart = p.inverse() @ q
    return apart.angle_deg() < SAME_DEG and apart.shift_at(CENTRE) < SAME_SHIFT


def judge_of(world: Sequence[Pose], pairs: Pairs, denied: Evidence = DENIED) -> DrawnJudge:
    """Believes what the pairs believe, and the truth; denies everything else."""

    def judge(i: int, j: int, i_from_j: Pose) -> Evidence:
        if i > j:
            return judge(j, i, i_from_j.inverse())
        for known in pairs[i, j].alternatives:
            if is_same(known.i_from_j, i_from_j):
                return known.evidence
        return seen(0.0) if is_same(true_pose(world, i, j), i_from_j) else denied

    return DrawnJudge(says=judge)


def stay(poses: Poses) -> Poses:
    return poses


def problem_of(
    num_scans: int,
    pairs: Pairs,
    judge: PairJudge,
    settle: Settle = stay,
    apart: Collection[Edge] = (),
) -> GraphProblem:
    return GraphProblem(
        pairs=pairs,
        centres=[CENTRE] * num_scans,
        same=SAME,
        judge=judge,
        settle=settle,
        config=GraphConfig(),
        apart=apart,
    )


def graph_of(
    world: Sequence[Pose], pairs: Pairs, judge: PairJudge | None = None, settle: Settle = stay
) -> ViewGraph:
    judge = judge or judge_of(world, pairs)
    graph = build_view_graph(problem_of(len(world), pairs, judge, settle))
    graph = replace(graph, doubts=find_doubts(graph, judge))
    assert_sound(graph, len(world), pairs)
    return graph


def assert_sound(graph: ViewGraph, num_scans: int, pairs: Pairs) -> None:
    """What holds of every view graph: all is accounted for, once, and with a reason."""
    placed = [k for c in graph.components for k in c.poses]
    assert sorted([*placed, *graph.unplaced]) == list(range(num_scans))
    assert set(graph.accepted) | set(graph.rejected) == set(pairs)
    assert not set(graph.accepted) & set(graph.rejected)
    assert all(graph.rejected.values()) and all(graph.unplaced.values())
    sizes = [len(c.poses) for c in graph.components]
    assert sizes == sorted(sizes, reverse=True) and min(sizes, default=2) >= 2
    for component in graph.components:
        assert component.poses[component.reference].angle_deg() == 0.0


def scans_of(component: Component) -> set[int]:
    return set(component.poses)


def assert_right(component: Component, world: Sequence[Pose]) -> None:
    """All relative poses within a component are true."""
    for k, pose in component.poses.items():
        off = true_pose(world, component.reference, k).inverse() @ pose
        assert off.angle_deg() < 1e-6 and off.shift_at(CENTRE) < 1e-9


def only_component(graph: ViewGraph, world: Sequence[Pose]) -> Component:
    (component,) = graph.components
    assert_right(component, world)
    return component


DIAGONAL = [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4)]
