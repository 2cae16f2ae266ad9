"""Pairs of a run: quickly where two scans leave no doubt, thoroughly where they do.

What is clear makes components; within these, all other pairs are asked at the pose that follows.
Only pairs across what stays apart are searched thoroughly.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

from scanweld.config import Config, Section
from scanweld.evidence.judge import Poses
from scanweld.geometry.pose import Pose
from scanweld.graph.partners import partners
from scanweld.graph.tree import clear_components
from scanweld.graph.view_graph import Edge
from scanweld.heat.features import describe
from scanweld.knowledge.turntable import Turntable, find_turntable
from scanweld.pairs.quick import is_clear
from scanweld.pairs.registrar import PairScan, PairTask
from scanweld.pairs.result import PairResult
from scanweld.pairs.verdict import not_compared
from scanweld.pipeline.choice import first_pairs, pairs_across, pairs_beside, pairs_left
from scanweld.pipeline.method import Method, Scene, Shortcuts
from scanweld.pipeline.problem import graph_problem, same_pose
from scanweld.work.runners import Shared
from scanweld.work.stage_log import Stages, work_key

NOT_COMPARED = "not compared: both scans are placed, or refused, by others"

BLOCK = 16
"""Pairs of so many scans and so many others are registered in a row."""

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
    num_scans = len(scene.intake.prepared)
    found: dict[Edge, PairResult] = {}
    asked: dict[Edge, PairResult] = {}
    components: Sequence[Poses] = ()
    if method.shortcuts is not None:
        with stages.stage("pairs") as counts:
            found, components = _clear(scene, method, config, stages)
            counts["pairs"] = len(found)
            asked = _asked(scene, found, components, method.shortcuts, config, stages)
            counts["placed"] = sum(len(poses) for poses in components)
    across = pairs_across(num_scans, components, found)
    found.update(asked)
    if across:
        scene = _described(scene, across, method, config, stages)
        with stages.stage("search") as counts:
            counts["pairs"] = len(across)
            found.update(_searched(scene, across, method, stages))
    edges = combinations(range(num_scans), 2)
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
    assert method.shortcuts is not None
    found: dict[Edge, PairResult] = {}
    components: Sequence[Poses] = ()
    for choose in (first_pairs, pairs_beside, pairs_left):
        edges = [e for e in choose(len(scene.intake.prepared), components) if e not in found]
        if not edges:
            continue
        quickly = method.shortcuts.search_quickly
        found.update(_kept("pairs", scene, edges, method, stages, quickly, _fields(scene, config)))
        axis = common_axis(scene, found, config)
        problem = graph_problem(scene, found, axis, method, config)
        clear = [edge for edge, pair in problem.pairs.items() if is_clear(pair, config.pairs)]
        components = clear_components(problem, clear)
    return found, components


def _asked(
    scene: Scene,
    found: Pairs,
    components: Sequence[Poses],
    shortcuts: Shortcuts,
    config: Config,
    stages: Stages,
) -> dict[Edge, PairResult]:
    """Pairs within components at the pose that follows; what there is no need to ask is left."""
    within = {
        edge: poses[edge[0]].inverse() @ poses[edge[1]]
        for poses in components
        for edge in {
            *partners(poses, scene.judge, stages.workers),
            *(e for e in found if set(e) <= set(poses)),
        }
    }
    tasks = [
        PairTask(edge=edge, asked=within[edge], found=found.get(edge))
        for edge in sorted(within, key=_in_blocks)
    ]
    results = stages.each("pairs", shortcuts.ask, tasks, shared=_fields(scene, config))
    return {task.edge: result for task, result in zip(tasks, results, strict=True)}


def _described(
    scene: Scene, edges: Sequence[Edge], method: Method, config: Config, stages: Stages
) -> Scene:
    """The scene with the PA-HKS keypoints of the scans of some pairs (paper 3.1), if needed."""
    if not method.needs_features:
        return scene
    scans = sorted({k for edge in edges for k in edge})
    prepared = scene.intake.prepared
    with stages.stage("features") as counts:
        found = stages.each(
            "features",
            partial(describe, config=config.heat),
            [prepared[k] for k in scans],
            lambda scan: work_key("features", scan.work_hash, config.prepare, config.heat),
        )
        counts["keypoints"] = sum(len(features.points) for features in found)
    return replace(scene, features=dict(zip(scans, found, strict=True)))


def _searched(scene: Scene, edges: Sequence[Edge], method: Method, stages: Stages) -> Pairs:
    scans = {
        k: PairScan(
            prepared=scene.intake.prepared[k],
            field=scene.judge.fields[k],
            contours=method.contours.observed[k],
            features=scene.features.get(k),
        )
        for k in {k for edge in edges for k in edge}
    }
    shared = _shared(scene, f"{method.name} scan", scans, *method.settings)
    return _kept("search", scene, edges, method, stages, method.register, shared)


def _fields(scene: Scene, config: Config) -> Shared[PairTask]:
    fields = dict(enumerate(scene.judge.fields))
    return _shared(scene, "field", fields, config.prepare)


def _shared(
    scene: Scene, what: str, parts: Mapping[int, object], *settings: Section
) -> Shared[PairTask]:
    """What pairs take of their scans, each named after all that it depends on."""
    prepared = scene.intake.prepared
    names = {k: work_key(what, prepared[k].work_hash, *settings, scene.margin) for k in parts}
    return Shared(parts=parts, names=names, of=lambda task: task.edge)


def _kept(
    stage: str,
    scene: Scene,
    edges: Sequence[Edge],
    method: Method,
    stages: Stages,
    register: Callable[..., PairResult],
    shared: Shared[PairTask],
) -> dict[Edge, PairResult]:
    """Results of pairs, each kept under what it depends on: its scans, their start, settings."""
    intake = scene.intake

    def key(task: PairTask) -> str:
        hashes = [intake.prepared[k].work_hash for k in task.edge]
        return work_key(
            *(f"{method.name} {stage}", *hashes, *method.settings),
            *(*intake.known.start_key(task.edge), scene.margin),
        )

    tasks = [
        PairTask(edge=edge, start=intake.known.starts.get(edge))
        for edge in sorted(edges, key=_in_blocks)
    ]
    results = stages.each(stage, register, tasks, key, shared=shared)
    found = {task.edge: result for task, result in zip(tasks, results, strict=True)}
    return {edge: replace(found[edge], i=edge[0], j=edge[1]) for edge in edges}


def _in_blocks(edge: Edge) -> tuple[int, ...]:
    """Orders pairs so that a machine that takes some in a row needs few scans for them."""
    return (*(k // BLOCK for k in edge), *edge)
