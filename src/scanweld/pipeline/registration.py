"""Pairs of a run: quickly where two scans leave no doubt, thoroughly where they do.

What is clear makes components; within these, all other pairs are asked at the pose that follows.
Only pairs across what stays apart are searched thoroughly.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from scanweld.config import Config
from scanweld.evidence.judge import Poses
from scanweld.geometry.pose import Pose
from scanweld.graph.tree import clear_components
from scanweld.graph.view_graph import Edge
from scanweld.heat.features import Features, describe
from scanweld.knowledge.turntable import Turntable, find_turntable
from scanweld.pairs.quick import is_clear
from scanweld.pairs.result import PairResult
from scanweld.pipeline.method import Method, Scene
from scanweld.pipeline.problem import graph_problem, same_pose
from scanweld.work.stage_log import Stages, work_key

Pairs = Mapping[Edge, PairResult]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Registered:
    """Every pair of a run, and what clear pairs have put together already.

    Attributes:
        scene: The scans, with the keypoints that were asked for.
        pairs: Results of all pairs (i, j), i < j.
        components: Poses of scans that clear pairs place together.
    """

    scene: Scene
    pairs: Pairs
    components: Sequence[Poses] = ()


def register_pairs(scene: Scene, method: Method, config: Config, stages: Stages) -> Registered:
    """Register every pair of scans, and judge what two scans alone say."""
    edges = list(combinations(range(len(scene.intake.prepared)), 2))
    with stages.stage("pairs") as counts:
        counts["pairs"] = len(edges)
        found, components = _clear(scene, edges, method, config, stages)
        home = {k: n for n, poses in enumerate(components) for k in poses}
        open_ones = [e for e in edges if e[0] not in home or home[e[0]] != home.get(e[1])]
        counts["searched"] = len(open_ones)
        scene, thorough = _searched(scene, open_ones, method, config, stages)
    found = dict(sorted({**found, **thorough}.items()))
    return Registered(scene=scene, pairs=found, components=components)


def common_axis(scene: Scene, found: Pairs, config: Config) -> Turntable | None:
    """The axis about which most good pairs turn, in frames of the sensors or of the files.

    None if the scans are not said to have one.
    """
    if not scene.intake.known.turntable:
        return None
    sensors = [Pose.identity() for _ in scene.judge.fields]
    files = [scan.scan_from_sensor for scan in scene.intake.prepared]
    return find_turntable(found, [sensors, files], scene.judge.centres, same_pose(scene, config))


def _clear(
    scene: Scene, edges: Sequence[Edge], method: Method, config: Config, stages: Stages
) -> tuple[Pairs, Sequence[Poses]]:
    """Pairs within the components that clear pairs make, and these components."""
    shortcuts = method.shortcuts
    if shortcuts is None:
        return {}, ()
    quick = _kept("quick", scene, edges, method, stages, shortcuts.search_quickly)
    axis = common_axis(scene, quick, config)
    problem = graph_problem(scene, quick, axis, method, config)
    clear = [edge for edge, pair in problem.pairs.items() if is_clear(pair, config.pairs)]
    components = clear_components(problem, clear)
    within = [
        (edge, poses[edge[0]].inverse() @ poses[edge[1]])
        for poses in components
        for edge in combinations(sorted(poses), 2)
    ]

    def ask(item: tuple[Edge, Pose]) -> PairResult:
        edge, i_from_j = item
        return shortcuts.ask(edge, i_from_j, quick[edge])

    asked = stages.each("pairs", ask, within)
    return {edge: pair for (edge, _), pair in zip(within, asked, strict=True)}, components


def _searched(
    scene: Scene, edges: Sequence[Edge], method: Method, config: Config, stages: Stages
) -> tuple[Scene, Pairs]:
    """The scene with the keypoints of the scans that are searched thoroughly, and their pairs."""
    if method.needs_features:
        scene = replace(scene, features=_described(scene, edges, config, stages))

    def register(edge: Edge) -> PairResult:
        return method.register(edge, scene.features)

    return scene, _kept("pair", scene, edges, method, stages, register)


def _described(
    scene: Scene, edges: Sequence[Edge], config: Config, stages: Stages
) -> dict[int, Features]:
    """PA-HKS keypoints of the scans of some pairs (paper 3.1)."""
    scans = sorted({k for edge in edges for k in edge})
    prepared = scene.intake.prepared
    found = stages.each(
        "pairs",
        lambda k: describe(prepared[k], config.heat),
        scans,
        lambda k: work_key("features", prepared[k].work_hash, config.prepare, config.heat),
    )
    return dict(zip(scans, found, strict=True))


def _kept(
    what: str,
    scene: Scene,
    edges: Sequence[Edge],
    method: Method,
    stages: Stages,
    register: Callable[[Edge], PairResult],
) -> dict[Edge, PairResult]:
    """Results of pairs, each kept under what it depends on: its scans, their start, settings."""
    intake = scene.intake

    def key(edge: Edge) -> str:
        hashes = [intake.prepared[k].work_hash for k in edge]
        return work_key(
            f"{method.name} {what}", *hashes, *method.settings, *intake.known.start_key(edge)
        )

    results = stages.each("pairs", register, edges, key)
    return {
        edge: replace(result, i=edge[0], j=edge[1])
        for edge, result in zip(edges, results, strict=True)
    }
