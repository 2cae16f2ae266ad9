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
from scanweld.graph.partners import partners
from scanweld.graph.tree import clear_components
from scanweld.graph.view_graph import Edge
from scanweld.heat.features import Features, describe
from scanweld.knowledge.turntable import Turntable, find_turntable
from scanweld.pairs.quick import is_clear
from scanweld.pairs.result import PairResult
from scanweld.pairs.verdict import not_compared
from scanweld.pipeline.choice import first_pairs, pairs_across, pairs_beside, pairs_left
from scanweld.pipeline.method import Method, Scene, Shortcuts
from scanweld.pipeline.problem import graph_problem, same_pose
from scanweld.work.stage_log import Stages, work_key

NOT_COMPARED = "not compared: both scans are placed, or refused, by others"

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
    with stages.stage("pairs") as counts:
        quick, components = _clear(scene, method, config, stages)
        asked = _asked(scene, quick, components, method.shortcuts, stages)
        across = pairs_across(len(scene.intake.prepared), components, quick)
        scene, searched = _searched(scene, across, method, config, stages)
        found = {**quick, **asked, **searched}
        counts["quickly searched"] = len(quick)
        counts["searched"] = len(searched)
    edges = combinations(range(len(scene.intake.prepared)), 2)
    pairs = {edge: found.get(edge) or not_compared(*edge, NOT_COMPARED) for edge in edges}
    return Registered(scene=scene, pairs=pairs, components=components)


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
    scene: Scene, method: Method, config: Config, stages: Stages
) -> tuple[dict[Edge, PairResult], Sequence[Poses]]:
    """What quick searches found of pairs, and the components that clear ones make."""
    shortcuts = method.shortcuts
    if shortcuts is None:
        return {}, ()
    found: dict[Edge, PairResult] = {}
    components: Sequence[Poses] = ()
    for choose in (first_pairs, pairs_beside, pairs_left):
        edges = [e for e in choose(len(scene.intake.prepared), components) if e not in found]
        if not edges:
            continue
        found.update(_kept("quick", scene, edges, method, stages, shortcuts.search_quickly))
        axis = common_axis(scene, found, config)
        problem = graph_problem(scene, found, axis, method, config)
        clear = [edge for edge, pair in problem.pairs.items() if is_clear(pair, config.pairs)]
        components = clear_components(problem, clear)
    return found, components


def _asked(
    scene: Scene,
    found: Pairs,
    components: Sequence[Poses],
    shortcuts: Shortcuts | None,
    stages: Stages,
) -> dict[Edge, PairResult]:
    """Pairs within components at the pose that follows; what there is no need to ask is left."""
    if shortcuts is None:
        return {}
    within = {
        edge: poses[edge[0]].inverse() @ poses[edge[1]]
        for poses in components
        for edge in {*partners(poses, scene.judge), *(e for e in found if set(e) <= set(poses))}
    }

    def ask(edge: Edge) -> PairResult:
        return shortcuts.ask(edge, within[edge], found.get(edge))

    edges = sorted(within)
    return dict(zip(edges, stages.each("pairs", ask, edges), strict=True))


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
