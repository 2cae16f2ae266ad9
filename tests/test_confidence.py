"""Confidence: a model that cannot do silly things, and grounds that tell right from wrong."""

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanweld.confidence.assess import MAX_UNDECIDED_CONFIDENCE, Confidence, assess
from scanweld.confidence.diagnostics import Fit, PairDiagnostics, diagnostics_of
from scanweld.confidence.joint_evidence import joint_evidence
from scanweld.confidence.misfit import misfit, sure_offsets
from scanweld.confidence.model import (
    MAX_CONFIDENCE,
    Curve,
    Model,
    read_calibration,
    stored_calibration,
)
from scanweld.confidence.ties import ties_of
from scanweld.config import Config, FusionConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.graph.view_graph import Component
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pairs.verdict import result_of
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction
from tests.prepared import PreparedPair, creature_pair
from tests.scenes import MILD_NOISE, Scene, creature_scene, pair_at_gap, primitive_scene
from tests.view_graphs import graph_with, option, pair_of

pytestmark = pytest.mark.slow

CONFIG = Config(fusion=FusionConfig(max_voxels_across=60))
MARGIN = 0.01
"""Of a confidence, beyond what other arithmetic may change."""
MODELS = {name: getattr(stored_calibration(), name) for name in ("pair", "scan")}


def grounds_of(model: Model, place: float) -> dict[str, float]:
    """Grounds that stand at some share of the way through each curve's knots, or beyond them."""
    return {
        name: curve.knots[0] + place * (curve.knots[-1] - curve.knots[0])
        for name, curve in model.curves.items()
    }


# The model


@pytest.mark.parametrize("name", MODELS)
@given(data=st.data())
def test_better_evidence_never_lowers_a_confidence(name: str, data: st.DataObject):
    model = MODELS[name]
    place = st.floats(-0.5, 1.5)
    grounds = {key: grounds_of(model, data.draw(place))[key] for key in model.curves}
    better = dict(grounds)
    key = data.draw(st.sampled_from(sorted(grounds)))
    better[key] += data.draw(st.floats(0, 10))
    assert model.probability(better) >= model.probability(grounds)


@pytest.mark.parametrize("name", MODELS)
def test_nothing_is_certain_and_extremes_are_flat(name: str):
    model = MODELS[name]
    best, worst = grounds_of(model, 1.0), grounds_of(model, 0.0)
    assert model.probability(worst) < 0.6 < 0.8 < model.probability(best) <= MAX_CONFIDENCE
    beyond = {key: value + 1e6 for key, value in best.items()}
    assert model.probability(beyond) == model.probability(best)


def test_what_is_no_model_is_refused():
    with pytest.raises(ValueError, match="never fall"):
        Curve(knots=np.array([0.0, 1.0]), values=np.array([1.0, 0.5]))
    with pytest.raises(ValueError, match="knots increase"):
        Curve(knots=np.array([1.0, 1.0]), values=np.array([0.0, 0.5]))
    with pytest.raises(ValueError, match="between 0 and 1"):
        Model(curves={}, slope=1.0, offset=0.0, most=1.2)
    with pytest.raises(ValueError, match="odds never fall"):
        Model(curves={}, slope=-0.1, offset=0.0, most=1.0)
    with pytest.raises(ValueError, match="the model has"):
        MODELS["pair"].probability({"margin": 1.0})
    document = json.loads(stored_calibration().to_json())
    with pytest.raises(ValueError, match="format 99, this version reads"):
        read_calibration(json.dumps({**document, "format": 99}))


def test_calibration_survives_its_file():
    stored = stored_calibration()
    again = read_calibration(stored.to_json())
    assert again.to_json() == stored.to_json()
    grounds = grounds_of(stored.pair, 0.7)
    assert again.pair.probability(grounds) == stored.pair.probability(grounds)
    assert set(again.made) >= {"command", "digest", "sets", "pairs", "scans"}


# What it rests on


def component_of(count: int) -> Component:
    return Component(poses={k: Pose.identity() for k in range(count)}, reference=0)


def test_links_are_the_weakest_cut():
    """Scan 4 hangs on one weak pair, the triangle 0-1-2 and 3 hold each other twice.

    0 --- 1       each .9: 2.3
    |  /  |
    2 --- 3 ... 4 (.5: 0.7)

    Of two firm triangles joined by one weak pair nobody beyond it is surer than that pair.
    """
    edges = {(0, 1): 0.9, (0, 2): 0.9, (1, 2): 0.9, (1, 3): 0.9, (2, 3): 0.9, (3, 4): 0.5}
    tied = ties_of(component_of(5), edges)
    assert [tied[k] for k in range(4)] == pytest.approx([-2 * np.log(0.1)] * 4, abs=0.01)
    assert tied[4] == pytest.approx(-np.log(0.5), abs=0.01)
    firm = dict.fromkeys([(0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5)], 0.99)
    tied = ties_of(component_of(6), {**firm, (2, 3): 0.6})
    assert min(tied[k] for k in (0, 1, 2)) > 4.6
    assert max(tied[k] for k in (3, 4, 5)) == pytest.approx(-np.log(0.4), abs=0.01)


def flat_matches(residuals: np.ndarray, seed: int = 0) -> Matches:
    """Matches spread over a unit square that faces along z."""
    points = np.random.default_rng(seed).uniform(0, 1, size=(len(residuals), 3)) * [1, 1, 0]
    up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    return Matches(points=points, directions=up, residuals=residuals)


def test_noise_is_averaged_out_of_the_misfit_but_steps_are_not():
    rng = np.random.default_rng(0)
    noise = rng.normal(scale=0.01, size=4000)
    stepped = flat_matches(noise)
    stepped = replace(stepped, residuals=noise + 0.01 * (stepped.points[:, 0] > 0.7))
    noisy = misfit(sure_offsets(flat_matches(noise), 0.1))
    assert noisy < 0.001
    assert 0.006 < misfit(sure_offsets(stepped, 0.1)) < 0.01
    assert misfit(sure_offsets(flat_matches(noise[:3]), 0.1)) == np.inf
    assert misfit(sure_offsets(flat_matches(noise[:0]), 0.1)) == np.inf


def test_pairs_conduct_like_wires(monkeypatch: pytest.MonkeyPatch):
    """One pair of 0.4 beside two of 0.6 in a row, which conduct 0.3 together."""
    scores = {(0, 1): 0.4, (0, 2): 0.6, (1, 2): 0.6}
    pairs = {
        edge: pair_of(*edge, PairKind.GOOD, option(Pose.identity(), score))
        for edge, score in scores.items()
    }
    component = component_of(3)
    graph = graph_with(pairs, component, accepted=pairs)
    fit = Fit(observability=1.0, misfit=0.0, coherence=1.0)
    monkeypatch.setattr("scanweld.confidence.joint_evidence._fit", lambda *_: fit)
    pair = creature_pair(40)
    judge = replace(pair.judge(), fields=pair.fields + pair.fields)
    contours = contour_matcher(pair.scans, CONFIG.contours)
    diagnostics = PairDiagnostics(judge=judge, sources=[], contours=contours, sensor=pair.sensor())
    joint = joint_evidence(graph, component, diagnostics)
    assert joint.conductance[0, 1] == pytest.approx(0.7, abs=1e-3)
    assert joint.conductance_without((0, 1), 0.4) == pytest.approx(0.3, abs=1e-3)


# Confidence of rendered scans


@lru_cache(maxsize=1)
def creature_run() -> tuple[Scene, Reconstruction]:
    ring = creature_scene(8, pixels=120, noise=MILD_NOISE)
    scene = replace(ring, scans=ring.scans[:4])
    return scene, run(scene.scans, CONFIG, workers=2)


def test_what_is_right_is_believed_and_what_is_wrong_is_not():
    """Each pair that is right above each that is wrong, and even chance between them."""
    scene, found = creature_run()
    assert len(found.poses) == 4
    for scan in found.scans.values():
        assert scan.confidence is not None and scan.confidence >= CONFIG.confidence.min_good
        assert set(scan.grounds) == set(MODELS["scan"].curves)
    names = [scan.name for scan in scene.scans]
    right, wrong = [], []
    for pair in found.pairs:
        assert set(pair.grounds) == set(MODELS["pair"].curves)
        assert pair.i_from_j is not None
        true = scene.i_from_j(names.index(pair.i), names.index(pair.j))
        is_right = (true.inverse() @ pair.i_from_j).angle_deg() < 5
        if not is_right:
            wrong.append(pair.confidence)
        elif pair.accepted:
            right.append(pair.confidence)
    assert right and wrong
    assert max(wrong) + MARGIN < 0.5 < min(right) - MARGIN


def test_confidence_knows_no_names_and_workers():
    scans = pair_at_gap(40, pixels=120)[:2]
    found = run(scans, CONFIG, workers=2)
    renamed = run(
        [replace(scan, name=f"{9 - k}") for k, scan in enumerate(scans)], CONFIG, workers=1
    )
    assert [pair.confidence for pair in renamed.pairs] == [pair.confidence for pair in found.pairs]
    for k, scan in enumerate(scans):
        assert renamed.scans[f"{9 - k}"].grounds == found.scans[scan.name].grounds


@pytest.mark.parametrize("name", ["sphere", "cylinder", "box", "plate"])
def test_no_pose_of_a_symmetric_object_is_believed(name: str):
    found = run(primitive_scene(name, 3, pixels=60).scans, CONFIG, workers=2)
    assert all(pair.confidence < 0.5 for pair in found.pairs)
    assert all((scan.confidence or 0.0) < 0.5 for scan in found.scans.values())


def assessed(
    pair: PreparedPair, found: PairResult, usable: PairResult, best: Alternative
) -> Confidence:
    """Of two scans alone, whose pair is accepted at a pose."""
    component = Component(poses={0: Pose.identity(), 1: best.i_from_j}, reference=0)
    graph = graph_with({(0, 1): found}, component)
    graph = replace(graph, usable={(0, 1): usable}, accepted={(0, 1): best})
    diagnostics = diagnostics_of(pair.scans, pair.judge(), pair.sensor(), CONFIG.contours)
    return assess(graph, diagnostics, stored_calibration(), CONFIG)


def planted(
    pair: PreparedPair,
    i_from_j: Pose,
    kind: PairKind = PairKind.GOOD,
    observability: float | None = None,
) -> float:
    """The confidence in a pose that somebody put into the view graph, of two scans alone."""
    option = pair.problem().evaluate(i_from_j)
    result = result_of(pair.problem(), (option,))
    seen = result.observability if observability is None else observability
    result = replace(result, kind=kind, observability=seen)
    found = assessed(pair, result, result, option)
    # No scan is surer than the only pair that holds it; links are whole numbers of their steps.
    assert max(found.scans[k].confidence for k in (0, 1)) < found.pairs[0, 1].confidence + 1e-3
    return found.pairs[0, 1].confidence


def test_a_planted_wrong_pose_is_not_believed():
    pair = creature_pair(40)
    turn = Pose(rotation=rotation_exp(np.radians([0.0, 0.0, 12.0])), translation=np.zeros(3))
    shift = Pose(rotation=np.eye(3), translation=np.array([0.08, 0.0, 0.0]) * pair.diameter)
    assert planted(pair, pair.i_from_j) > 0.5
    assert planted(pair, pair.i_from_j @ turn) < 0.35
    assert planted(pair, pair.i_from_j @ shift) < 0.35


def test_confidence_knows_no_unit_and_no_order():
    pair, larger = creature_pair(40), creature_pair(40, factor=1000.0)
    back = pair.i_from_j.inverse()
    turned_round = replace(pair, scans=pair.scans[::-1], fields=pair.fields[::-1], i_from_j=back)
    believed = planted(pair, pair.i_from_j)
    assert planted(larger, larger.i_from_j) == pytest.approx(believed, abs=1e-6)
    assert planted(turned_round, back) == pytest.approx(believed, abs=1e-6)


def test_a_rival_that_facts_rule_out_counts_for_nothing():
    """Two poses fit; users' facts leave one, with which the view graph was built."""
    pair = creature_pair(40)
    problem = pair.problem()
    best = problem.evaluate(pair.i_from_j)
    half_turn = Pose(rotation=np.diag([-1.0, -1.0, 1.0]), translation=np.zeros(3))
    rival = replace(best, i_from_j=half_turn @ pair.i_from_j)
    found = replace(result_of(problem, (best, rival)), kind=PairKind.AMBIGUOUS)
    usable = result_of(problem, (best,))
    undecided, decided = (assessed(pair, found, used, best) for used in (found, usable))
    assert undecided.pairs[0, 1].grounds["margin"] == found.margin == 0.0
    assert decided.pairs[0, 1].grounds["margin"] == usable.margin == 1.0
    assert undecided.pairs[0, 1].confidence <= MAX_UNDECIDED_CONFIDENCE
    assert decided.pairs[0, 1].confidence > 0.9
    for k in (0, 1):
        assert undecided.scans[k].confidence <= MAX_UNDECIDED_CONFIDENCE
        assert decided.scans[k].confidence > MAX_UNDECIDED_CONFIDENCE


def test_two_scans_alone_never_decide_what_they_leave_open_or_only_icp_holds():
    pair = creature_pair(40)
    for kind in set(PairKind) - {PairKind.GOOD}:
        assert planted(pair, pair.i_from_j, kind) == MAX_UNDECIDED_CONFIDENCE < 0.5
    assert planted(pair, pair.i_from_j, observability=0.0) == MAX_UNDECIDED_CONFIDENCE
    assert planted(pair, pair.i_from_j, observability=1e-2) > MAX_UNDECIDED_CONFIDENCE
