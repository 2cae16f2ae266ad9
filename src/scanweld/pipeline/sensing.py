"""The set's own sensor: learnt from its pairs, and what they come to when judged by it."""

from collections.abc import Mapping
from dataclasses import replace

from scanweld.config import Config
from scanweld.evidence.field import with_margin
from scanweld.evidence.sample_patches import violating_patches, with_patches
from scanweld.graph.view_graph import Edge
from scanweld.pairs.result import PairResult
from scanweld.pairs.verdict import held_to
from scanweld.pipeline.method import Method, Scene
from scanweld.pipeline.registration import Registered, register_pairs
from scanweld.sensor.learn import learn_sensor
from scanweld.sensor.model import SensorModel
from scanweld.sensor.silhouette import silhouette_margin
from scanweld.work.stage_log import Stages


def as_silhouettes_allow(
    registered: Registered, method: Method, config: Config, stages: Stages
) -> Registered:
    """The pairs of a run, registered anew if its silhouettes are not as exact as its surfaces.

    What empty pixels near cut borders say hides right poses from the search.
    """
    scene = registered.scene
    judge = scene.judge
    if method.shortcuts is None:
        return registered
    margin = silhouette_margin(registered.pairs, judge.fields, judge.diameter, judge.tolerance)
    if not margin:
        return registered
    judge = replace(judge, fields=[with_margin(field, margin) for field in judge.fields])
    return register_pairs(replace(scene, judge=judge, margin=margin), method, config, stages)


def learnt(registered: Registered, config: Config, stages: Stages) -> Registered:
    """The scans and pairs of a run, judged by what the pairs say of the sensor.

    Poses were ranked by a fine tolerance, which tells the best from its neighbours. Whether it is
    right is asked with the tolerance that the set's own sensor needs.
    """
    scene = registered.scene
    judge = scene.judge
    with stages.stage("sensor") as counts:
        sensor = learn_sensor(
            registered.pairs,
            judge.fields,
            judge.diameter,
            judge.tolerance,
            config.pairs.max_contradiction,
        )
        sensor = replace(sensor, margin=scene.margin)
        counts["certain"] = sensor.num_certain
        judge = replace(judge, tolerance=sensor.tolerance, limits=sensor.limits)
        pairs = _held(registered.pairs, scene, sensor)
    return replace(registered, scene=replace(scene, judge=judge, sensor=sensor), pairs=pairs)


def _held(
    pairs: Mapping[Edge, PairResult], scene: Scene, sensor: SensorModel
) -> dict[Edge, PairResult]:
    """The pairs, those whose violations hang together more than right ones' do contradicted."""
    judge, held = scene.judge, {}
    for (i, j), pair in pairs.items():
        if pair.best is not None:
            best, evidence = pair.best, pair.best.evidence
            if sensor.tolerance > judge.tolerance:
                both = judge.fields[i], judge.fields[j]
                (patches,) = violating_patches(*both, [best.i_from_j], sensor.tolerance)
                evidence = with_patches(evidence, patches)
            pair = held_to(pair, sensor.max_contradiction, evidence)
        held[i, j] = pair
    return held
