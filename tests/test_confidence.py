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
from scanweld.evidence.evidence import Evidence
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.graph.view_graph import Component, ViewGraph
from scanweld.pairs.result import Alternative, PairKind, PairResult
from scanweld.pairs.verdict import result_of
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction
from tests.prepared import PreparedPair, creature_pair
from tests.scenes import MILD_NOISE, Scene, creature_scene, pair_at_gap, primitive_scene

pytestmark = pytest.mark.slow

CONFIG = Config(fusion=FusionConfig(max_voxels_across=60))
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


def test_curves_that_fall_are_refused():
    with pytest.raises(ValueError, match="never fall"):
        Curve(knots=np.array([0.0, 1.0]), values=np.array([1.0, 0.5]))
    with pytest.raises(ValueError, match="knots increase"):
        Curve(knots=np.array([1.0, 1.0]), values=np.array([0.0, 0.5]))
    with pytest.raises(ValueError, match="between 0 and 1"):
        Model(curves={}, frequencies=Curve(knots=np.array([0.0]), values=np.array([1.2])))


def test_other_grounds_than_the_model_knows_are_refused():
    model = MODELS["pair"]
    with pytest.raises(ValueError, match="the model has"):
        model.probability({"agree": 1.0})


def test_calibration_survives_its_file():
    stored = stored_calibration()
    again = read_calibration(stored.to_json())
    assert again.to_json() == stored.to_json()
    grounds = grounds_of(stored.pair, 0.7)
    assert again.pair.probability(grounds) == stored.pair.probability(grounds)
    assert set(again.made) >= {"command", "digest", "sets", "pairs", "scans"}


def test_a_calibration_of_another_format_is_refused():
    document = json.loads(stored_calibration().to_json())
    with pytest.raises(ValueError, match="format 99, this version reads"):
        read_calibration(json.dumps({**document, "format": 99}))


# What it rests on


def component_of(count: int) -> Component:
    return Component(poses={k: Pose.identity() for k in range(count)}, reference=0)


def test_links_are_the_weakest_cut():
    """Scan 4 hangs on one weak pair, the triangle 0-1-2 and 3 hold each other twice.

    0 --- 1       each .9: 2.3
    |  /  |
    2 --- 3 ... 4 (.5: 0.7)
    """
    edges = {(0, 1): 0.9, (0, 2): 0.9, (1, 2): 0.9, (1, 3): 0.9, (2, 3): 0.9, (3, 4): 0.5}
    tied = ties_of(component_of(5), edges)
    one = -np.log(0.1)
    assert [tied[k] for k in range(4)] == pytest.approx([2 * one] * 4, abs=0.01)
    assert tied[4] == pytest.approx(-np.log(0.5), abs=0.01)


def test_a_component_hangs_by_its_bridge():
    """Two firm triangles joined by one weak pair: beyond it nobody is surer than that pair."""
    firm = {(0, 1): 0.99, (0, 2): 0.99, (1, 2): 0.99, (3, 4): 0.99, (3, 5): 0.99, (4, 5): 0.99}
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


def evidence(agree: float) -> Evidence:
    return Evidence(agree=agree, front=0, contradict=0, free=0, occluded=1 - agree, unknown=0)


def drawn_pair(i: int, j: int, score: float) -> PairResult:
    option = Alternative(i_from_j=Pose.identity(), evidence=evidence(score))
    return PairResult(
        i=i,
        j=j,
        kind=PairKind.GOOD,
        reason="",
        alternatives=(option,),
        information=np.eye(6),
        observability=1.0,
        margin=1.0,
        rms=0.0,
    )


def test_pairs_conduct_like_wires(monkeypatch: pytest.MonkeyPatch):
    """One pair of 0.4 beside two of 0.6 in a row, which conduct 0.3 together."""
    pairs = {(0, 1): drawn_pair(0, 1, 0.4), (0, 2): drawn_pair(0, 2, 0.6)}
    pairs[1, 2] = drawn_pair(1, 2, 0.6)
    accepted = {edge: pair.alternatives[0] for edge, pair in pairs.items()}
    component = component_of(3)
    graph = ViewGraph(
        pairs=pairs,
        usable=pairs,
        accepted=accepted,
        rejected={},
        components=(component,),
        unplaced={},
    )
    fit = Fit(observability=1.0, residual=0.0, misfit=0.0, coherence=1.0)
    monkeypatch.setattr("scanweld.confidence.joint_evidence._fit", lambda *_: fit)
    pair = creature_pair(40)
    diagnostics = PairDiagnostics(
        judge=replace(pair.judge(), fields=pair.fields + pair.fields),
        sources=[],
        contours=contour_matcher(pair.scans, CONFIG.contours),
    )
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
    scene, found = creature_run()
    assert len(found.poses) == 4
    for scan in found.scans.values():
        assert scan.confidence is not None and scan.confidence >= CONFIG.confidence.min_good
        assert set(scan.grounds) == set(MODELS["scan"].curves)
    names = [scan.name for scan in scene.scans]
    for pair in found.pairs:
        assert set(pair.grounds) == set(MODELS["pair"].curves)
        assert pair.i_from_j is not None
        true = scene.i_from_j(names.index(pair.i), names.index(pair.j))
        is_right = (true.inverse() @ pair.i_from_j).angle_deg() < 5
        assert pair.confidence > 0.5 if is_right and pair.accepted else True
        assert is_right or pair.confidence < MAX_UNDECIDED_CONFIDENCE


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
    found = run(primitive_scene(name, 3, pixels=80).scans, CONFIG, workers=2)
    assert all(pair.confidence < 0.5 for pair in found.pairs)
    assert all((scan.confidence or 0.0) < 0.5 for scan in found.scans.values())


def planted(
    pair: PreparedPair,
    i_from_j: Pose,
    kind: PairKind = PairKind.GOOD,
    observability: float | None = None,
) -> float:
    """The confidence in a pose that somebody put into the view graph, of two scans alone."""
    config = Config()
    option = pair.problem().evaluate(i_from_j)
    result = result_of(pair.problem(), (option,))
    seen = result.observability if observability is None else observability
    result = replace(result, kind=kind, observability=seen)
    component = Component(poses={0: Pose.identity(), 1: i_from_j}, reference=0)
    graph = ViewGraph(
        pairs={(0, 1): result},
        usable={(0, 1): result},
        accepted={(0, 1): option},
        rejected={},
        components=(component,),
        unplaced={},
    )
    diagnostics = diagnostics_of(pair.scans, pair.judge(), config.contours)
    found = assess(graph, diagnostics, stored_calibration(), config)
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
    turned_round = replace(
        pair,
        scans=pair.scans[::-1],
        fields=pair.fields[::-1],
        i_from_j=pair.i_from_j.inverse(),
    )
    believed = planted(pair, pair.i_from_j)
    assert planted(larger, larger.i_from_j) == pytest.approx(believed, abs=1e-6)
    assert planted(turned_round, turned_round.i_from_j) == pytest.approx(believed, abs=1e-6)


def test_a_rival_that_facts_rule_out_counts_for_nothing():
    """Two poses fit; users' facts leave one, with which the view graph was built."""
    pair = creature_pair(40)
    problem = pair.problem()
    best = problem.evaluate(pair.i_from_j)
    half_turn = Pose(rotation=np.diag([-1.0, -1.0, 1.0]), translation=np.zeros(3))
    rival = replace(best, i_from_j=half_turn @ pair.i_from_j)
    found = replace(result_of(problem, (best, rival)), kind=PairKind.AMBIGUOUS)
    usable = result_of(problem, (best,))
    assert found.margin == 0.0 and usable.margin == 1.0
    component = Component(poses={0: Pose.identity(), 1: pair.i_from_j}, reference=0)
    diagnostics = diagnostics_of(pair.scans, pair.judge(), CONFIG.contours)

    def assessed(used: PairResult) -> Confidence:
        graph = ViewGraph(
            pairs={(0, 1): found},
            usable={(0, 1): used},
            accepted={(0, 1): best},
            rejected={},
            components=(component,),
            unplaced={},
        )
        return assess(graph, diagnostics, stored_calibration(), CONFIG)

    undecided, decided = assessed(found), assessed(usable)
    assert undecided.pairs[0, 1].grounds["margin"] == 0.0
    assert undecided.pairs[0, 1].confidence <= MAX_UNDECIDED_CONFIDENCE
    assert decided.pairs[0, 1].grounds["margin"] == 1.0
    assert decided.pairs[0, 1].confidence > 0.9
    for k in (0, 1):
        assert undecided.scans[k].confidence <= MAX_UNDECIDED_CONFIDENCE
        assert decided.scans[k].confidence > MAX_UNDECIDED_CONFIDENCE


@pytest.mark.parametrize("kind", [kind for kind in PairKind if kind is not PairKind.GOOD])
def test_two_scans_alone_never_decide_what_they_leave_open(kind: PairKind):
    pair = creature_pair(40)
    assert planted(pair, pair.i_from_j, kind) == MAX_UNDECIDED_CONFIDENCE < 0.5


def test_what_only_icp_holds_two_scans_alone_do_not_decide_either():
    pair = creature_pair(40)
    assert planted(pair, pair.i_from_j, observability=0.0) == MAX_UNDECIDED_CONFIDENCE
    assert planted(pair, pair.i_from_j, observability=1e-2) > MAX_UNDECIDED_CONFIDENCE
