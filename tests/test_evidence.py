"""What sensors say at the truth and of wrong poses, and margins over rivals."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanweld.config import PairsConfig
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.rivals import as_rival
from scanweld.evidence.visibility import mean_evidence, two_way_evidence
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose
from scanweld.pairs.result import Alternative, PairKind, margin_among, refutation_among
from scanweld.pairs.verdict import Measured, classify_pair
from tests.prepared import PreparedPair, creature_pair
from tests.results import turned

MODELS = (CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC)
TOLERANCE = 0.012


def evidence_at(pair: PreparedPair, i_from_j: Pose) -> tuple[Evidence, Evidence]:
    return two_way_evidence(*pair.fields, i_from_j, TOLERANCE * pair.diameter)


def shares(evidence: Evidence) -> FloatArray:
    return np.array([getattr(evidence, field.name) for field in fields(Evidence)])


@pytest.mark.parametrize("model", MODELS)
def test_at_the_truth_nothing_is_violated_and_wrong_poses_score_less(model: CameraModel):
    """Of a scan and itself all agrees."""
    for gap, least in ((30, 0.7), (60, 0.4), (90, 0.2)):
        pair = creature_pair(gap, model)
        for said in evidence_at(pair, pair.i_from_j):
            assert said.front < 0.02 and said.contradict < 0.005 and said.free < 0.01
            assert said.agree > least
            assert said.score > 0.9 * said.agree - 0.03
        best = mean_evidence(*evidence_at(pair, pair.i_from_j)).score
        for pose in random_poses(pair, 60):
            degrees, shift = pair.off_by(pose)
            if degrees > 5 or shift > 0.03:
                assert mean_evidence(*evidence_at(pair, pose)).score < best
        field = pair.fields[0]
        for said in two_way_evidence(field, field, Pose.identity(), 1e-6 * pair.diameter):
            assert said.agree == said.score == 1.0 and said.violation == 0.0


@pytest.mark.parametrize("model", MODELS)
def test_a_scan_pulled_towards_the_other_sensor_is_before_its_surface(model: CameraModel):
    """Along i's view: j's samples come to lie before what i saw; i's behind what j saw, or free."""
    pair = creature_pair(30, model)

    def along_i(shift: float) -> tuple[Evidence, Evidence]:
        return evidence_at(pair, Pose.exp([0, 0, 0, 0, 0, shift * pair.diameter]) @ pair.i_from_j)

    of_i, of_j = along_i(-0.08)
    assert of_j.front > 0.5 and of_j.agree < 0.2
    assert of_i.occluded + of_i.free > 0.5 and of_i.front < 0.2
    assert mean_evidence(of_i, of_j).score < 0
    of_i, of_j = along_i(0.08)
    assert of_j.occluded > 0.5 and of_j.front < 0.2
    assert of_i.front > 0.4 and of_i.agree < 0.2
    assert model is CameraModel.ORTHOGRAPHIC or along_i(-20.0)[1].unknown == 1.0


@pytest.mark.parametrize("model", MODELS)
def test_a_wider_tolerance_forgives_more_and_fewer_samples_say_about_the_same(model: CameraModel):
    pair = creature_pair(60, model)
    pose = pair.i_from_j @ Pose.exp([0, 0, 0, 0, 0, 0.02 * pair.diameter])
    said = [
        mean_evidence(*two_way_evidence(*pair.fields, pose, tolerance * pair.diameter))
        for tolerance in (0.005, 0.01, 0.02, 0.04)
    ]
    agree, front = [one.agree + one.contradict for one in said], [one.front for one in said]
    assert agree == sorted(agree) and agree[0] < 0.3 * agree[-1]
    assert front == sorted(front, reverse=True) and front[-1] < 0.2 * front[0]
    whole, _ = evidence_at(pair, pair.i_from_j)
    few, _ = two_way_evidence(*pair.fields, pair.i_from_j, TOLERANCE * pair.diameter, 200)
    np.testing.assert_allclose(shares(few), shares(whole), atol=0.06)
    # Shares of exactly 200 samples.
    np.testing.assert_allclose(200 * shares(few) % 1.0 % (1 - 1e-9), 0, atol=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_a_scan_beside_the_other_lies_in_free_space(model: CameraModel):
    pair = creature_pair(30, model)
    aside, near = (Pose.exp([0, 0, 0, by * pair.diameter, 0, 0]) for by in (3.0, 0.15))
    _, of_j = evidence_at(pair, aside @ pair.i_from_j)
    # Beyond the image its border speaks, which the narrow field of view leaves partly unknown.
    assert of_j.free + of_j.grazing + of_j.unknown == pytest.approx(1.0)
    _, of_j = evidence_at(pair, near @ pair.i_from_j)
    assert of_j.free > 0.2, "it faces the other sensor, which would have seen it"
    assert of_j.grazing > 0.05


def test_flipped_normals_contradict():
    pair = creature_pair(30)
    i, j = pair.fields
    flipped = replace(j, normals=-j.normals)
    _, true = two_way_evidence(i, j, pair.i_from_j, TOLERANCE * pair.diameter)
    _, said = two_way_evidence(i, flipped, pair.i_from_j, TOLERANCE * pair.diameter)
    assert said.agree == 0.0 and said.contradict >= true.agree > 0.6
    assert said.front == true.front and said.occluded == true.occluded


def random_poses(pair: PreparedPair, count: int) -> list[Pose]:
    """Wrong poses of all sizes around the truth."""
    rng = np.random.default_rng(9)
    twists = rng.normal(size=(count, 6)) * np.geomspace(0.01, 2, count)[:, None]
    twists[:, 3:] *= 0.2 * pair.diameter
    middle = Pose(rotation=np.eye(3), translation=pair.fields[1].centre)
    return [pair.i_from_j @ middle @ Pose.exp(t) @ middle.inverse() for t in twists]


@pytest.mark.parametrize("model", MODELS)
def test_shares_never_exceed_the_whole_nor_depend_on_unit_and_order(model: CameraModel):
    """The inverse rounds differently: a sample on a pixel's border may change sides."""
    pair, stretched = creature_pair(60, model), creature_pair(60, model, 1000.0)
    i, j = pair.fields
    for pose in random_poses(pair, 30):
        both = evidence_at(pair, pose)
        for said in both:
            assert (shares(said) >= 0).all() and shares(said).sum() <= 1 + 1e-12
            assert said.score <= said.agree and said.violation <= 1
        swapped = two_way_evidence(j, i, pose.inverse(), TOLERANCE * pair.diameter)[::-1]
        far = Pose(rotation=pose.rotation, translation=1000.0 * pose.translation)
        for other in (swapped, evidence_at(stretched, far)):
            for a, b in zip(both, other, strict=True):
                np.testing.assert_allclose(shares(a), shares(b), atol=0.008)


def test_a_judge_says_of_many_poses_what_it_says_of_each():
    pair = creature_pair(60, CameraModel.PINHOLE)
    judge, poses = pair.judge(), [pair.i_from_j, *random_poses(pair, 5)]
    said = judge.poses(0, 1, poses)
    assert said == [judge.pair(0, 1, pose) for pose in poses]
    assert [each.agree for each in said] == [judge.agree(0, 1, pose) for pose in poses]
    assert said[0].agree > 0.3 and max(each.free_patch for each in said[1:]) > 0.0


def test_the_mean_of_both_directions():
    a = Evidence(agree=0.6, front=0.1, contradict=0.0, free=0.1, occluded=0.2, unknown=0.0)
    b = Evidence(agree=0.2, front=0.0, contradict=0.2, free=0.0, occluded=0.1, unknown=0.5)
    mean = mean_evidence(a, b)
    np.testing.assert_allclose(shares(mean), 0.5 * (shares(a) + shares(b)))
    assert mean.score == pytest.approx(0.5 * (a.score + b.score))


# Margins: what counts is how well rivals explain the scans, not how far they meet.


def evidence(agree: float, front: float = 0.0, free: float = 0.0) -> Evidence:
    """All that violates hangs together."""
    left = 1.0 - agree - front - free
    told = Evidence(agree=agree, front=front, contradict=0.0, free=free, occluded=left, unknown=0.0)
    return replace(told, front_patch=front, free_patch=free)


def options_of(evidences: list[Evidence]) -> list[Alternative]:
    return [Alternative(i_from_j=turned(k), evidence=e) for k, e in enumerate(evidences)]


def margin(best: Evidence, rivals: list[Evidence]) -> float:
    options = options_of([best, *rivals])
    return margin_among(options[0], options)


def refuted(best: Evidence, rivals: list[Evidence]) -> float:
    options = options_of([best, *rivals])
    return refutation_among(options[0], options)


def test_a_rival_that_nothing_contradicts_is_as_good_though_it_overlaps_less():
    """The next turn of a toothed wheel: fewer teeth meet, and all that meet fit."""
    assert margin(evidence(0.9, front=0.005), [evidence(0.5, front=0.003)]) < 0.05
    assert margin(evidence(0.9), [evidence(0.35)]) == pytest.approx(0.0, abs=1e-12)
    assert margin(evidence(0.8, free=0.2), [evidence(0.4, free=0.11)]) < 0.1, "as dirty"
    best, rival = evidence(0.6, front=0.01), evidence(0.5, front=0.1, free=0.1)
    assert margin(best, [rival]) == pytest.approx((best.score - rival.score) / best.score)
    options = options_of([evidence(0.9, front=0.01), evidence(0.4, front=0.005)])
    found = classify_pair(
        (0, 1), tuple(options), Measured(information=np.eye(6), rms=0.1), PairsConfig()
    )
    assert found.kind is PairKind.AMBIGUOUS and len(found.alternatives) == 2


def test_slivers_are_no_rivals():
    best = evidence(0.6, front=0.01)
    assert margin(best, [evidence(0.04)]) > 0.9
    assert margin(best, [evidence(0.18)]) > 0.6, "a narrow view fits a third as well elsewhere"
    assert margin(evidence(0.15), [evidence(0.06)]) == pytest.approx(0.0, abs=1e-12)
    assert margin(evidence(0.3), []) == 1.0
    assert margin(evidence(0.1, front=0.2), []) == 0.0
    assert as_rival(-0.1, (0.0, 0.0), (0.0, 0.0)) == -0.1, "where nothing agrees, its score alone"
    assert as_rival(0.2, (0.0, 0.5), (0.0, 0.0)) == 0.2


@given(st.floats(0.06, 1.0), st.floats(0.01, 1.0), st.floats(0, 0.3), st.floats(0, 0.3))
def test_one_more_rival_never_makes_a_pose_surer(a: float, b: float, front: float, free: float):
    best, first = evidence(a, front=0.02 * a), evidence(0.3, front=0.05)
    rival = evidence(b, front=front, free=free)
    assert margin(best, [first, rival]) <= margin(best, [first])


def test_how_clearly_rivals_are_refuted_is_told_by_the_least_contradicted_one():
    best, poor, poorer = evidence(0.6), evidence(0.25, front=0.0625), evidence(0.3, front=0.3)
    assert refuted(best, [poor, poorer]) == pytest.approx(0.5)
    scattered = replace(poor, front_patch=0.00625)
    assert refuted(best, [scattered]) == pytest.approx(0.05), "what does not hang together is noise"
    assert refuted(best, [poorer]) == 1.0
    assert refuted(best, [poorer, evidence(0.3)]) == 0.0
    assert refuted(best, [evidence(0.2)]) == 1.0, "a sliver is no rival"
    assert refuted(best, []) == 1.0
