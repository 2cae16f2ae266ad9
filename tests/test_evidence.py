"""Visibility evidence on rendered pairs: what sensors say at the truth, and of wrong poses."""

from dataclasses import fields, replace

import numpy as np
import pytest

from scanweld.evidence.evidence import Evidence
from scanweld.evidence.visibility import mean_evidence, two_way_evidence
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose
from tests.prepared import PreparedPair, creature_pair

MODELS = (CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC)
TOLERANCE = 0.012


def shifted(pair: PreparedPair, along_j: FloatArray) -> Pose:
    """The true pose after scan j was shifted in its own sensor frame, in diameters."""
    shift = Pose(rotation=np.eye(3), translation=pair.diameter * along_j)
    return pair.i_from_j @ shift


def evidence_at(pair: PreparedPair, i_from_j: Pose) -> tuple[Evidence, Evidence]:
    return two_way_evidence(*pair.fields, i_from_j, TOLERANCE * pair.diameter)


def shares(evidence: Evidence) -> FloatArray:
    return np.array([getattr(evidence, field.name) for field in fields(Evidence)])


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("gap", [30, 60, 90])
def test_at_the_truth_nothing_is_violated(gap: int, model: CameraModel):
    pair = creature_pair(gap, model)
    for said in evidence_at(pair, pair.i_from_j):
        assert said.front < 0.02 and said.contradict < 0.005 and said.free < 0.01
        assert said.agree > {30: 0.7, 60: 0.4, 90: 0.2}[gap]
        assert said.score > 0.9 * said.agree - 0.03


@pytest.mark.parametrize("model", MODELS)
def test_a_scan_of_itself_agrees_with_itself(model: CameraModel):
    pair = creature_pair(30, model)
    field = pair.fields[0]
    said, back = two_way_evidence(field, field, Pose.identity(), 1e-6 * pair.diameter)
    assert said.agree == back.agree == 1.0
    assert said.score == 1.0 and said.violation == 0.0


@pytest.mark.parametrize("model", MODELS)
def test_a_scan_pulled_towards_the_other_sensor_is_before_its_surface(model: CameraModel):
    """Along i's view: j's samples come to lie before what i saw; i's behind what j saw, or free."""
    pair = creature_pair(30, model)
    pull = Pose(rotation=np.eye(3), translation=np.array([0, 0, -0.08 * pair.diameter]))
    of_i, of_j = evidence_at(pair, pull @ pair.i_from_j)
    assert of_j.front > 0.5 and of_j.agree < 0.2
    assert of_i.occluded + of_i.free > 0.5 and of_i.front < 0.2
    assert mean_evidence(of_i, of_j).score < 0


@pytest.mark.parametrize("model", MODELS)
def test_a_scan_pushed_behind_the_other_is_occluded(model: CameraModel):
    pair = creature_pair(30, model)
    push = Pose(rotation=np.eye(3), translation=np.array([0, 0, 0.08 * pair.diameter]))
    of_i, of_j = evidence_at(pair, push @ pair.i_from_j)
    assert of_j.occluded > 0.5 and of_j.front < 0.2
    assert of_i.front > 0.4 and of_i.agree < 0.2


@pytest.mark.parametrize("model", MODELS)
def test_a_scan_beside_the_other_lies_in_free_space(model: CameraModel):
    pair = creature_pair(30, model)
    camera = pair.scans[0].image.camera
    aside = Pose(rotation=np.eye(3), translation=np.array([3.0 * pair.diameter, 0, 0]))
    _, of_j = evidence_at(pair, aside @ pair.i_from_j)
    assert camera.model is model
    # Beyond the image its border speaks, which the narrow field of view leaves partly unknown.
    assert of_j.free + of_j.unknown == pytest.approx(1.0)
    near = Pose(rotation=np.eye(3), translation=np.array([0.15 * pair.diameter, 0, 0]))
    _, of_j = evidence_at(pair, near @ pair.i_from_j)
    assert of_j.free > 0.2


def test_flipped_normals_contradict():
    pair = creature_pair(30)
    i, j = pair.fields
    flipped = replace(j, normals=-j.normals)
    _, true = two_way_evidence(i, j, pair.i_from_j, TOLERANCE * pair.diameter)
    _, said = two_way_evidence(i, flipped, pair.i_from_j, TOLERANCE * pair.diameter)
    assert said.agree == 0.0 and said.contradict >= true.agree > 0.6
    assert said.front == true.front and said.occluded == true.occluded


def test_what_is_behind_a_pinhole_is_unknown():
    pair = creature_pair(30)
    behind = Pose(rotation=np.eye(3), translation=np.array([0, 0, -20.0 * pair.diameter]))
    _, of_j = evidence_at(pair, behind @ pair.i_from_j)
    assert of_j.unknown == 1.0


def random_poses(pair: PreparedPair, count: int) -> list[Pose]:
    """Wrong poses of all sizes around the truth."""
    rng = np.random.default_rng(9)
    twists = rng.normal(size=(count, 6)) * np.geomspace(0.01, 2, count)[:, None]
    twists[:, 3:] *= 0.2 * pair.diameter
    middle = Pose(rotation=np.eye(3), translation=pair.fields[1].centre)
    return [pair.i_from_j @ middle @ Pose.exp(t) @ middle.inverse() for t in twists]


@pytest.mark.parametrize("model", MODELS)
def test_shares_never_exceed_the_whole(model: CameraModel):
    pair = creature_pair(60, model)
    for pose in random_poses(pair, 40):
        for said in evidence_at(pair, pose):
            assert (shares(said) >= 0).all()
            assert shares(said).sum() <= 1 + 1e-12
            assert said.score <= said.agree
            assert said.violation <= 1


def test_swapping_the_scans_swaps_what_they_say():
    pair = creature_pair(60)
    i, j = pair.fields
    for pose in random_poses(pair, 20):
        of_i, of_j = evidence_at(pair, pose)
        swapped = two_way_evidence(j, i, pose.inverse(), TOLERANCE * pair.diameter)
        # The inverse rounds differently: a sample on a pixel's border may change sides.
        np.testing.assert_allclose(shares(of_i), shares(swapped[1]), atol=0.005)
        np.testing.assert_allclose(shares(of_j), shares(swapped[0]), atol=0.005)


@pytest.mark.parametrize("model", MODELS)
def test_another_unit_says_the_same(model: CameraModel):
    pair, stretched = creature_pair(60, model), creature_pair(60, model, 1000.0)
    for pose in random_poses(pair, 20):
        far = Pose(rotation=pose.rotation, translation=1000.0 * pose.translation)
        for a, b in zip(evidence_at(pair, pose), evidence_at(stretched, far), strict=True):
            np.testing.assert_allclose(shares(a), shares(b), atol=0.008)


def test_a_wider_tolerance_forgives_more():
    pair = creature_pair(60)
    pose = shifted(pair, np.array([0, 0, 0.02]))
    agree, front = [], []
    for tolerance in (0.005, 0.01, 0.02, 0.04):
        of_i, of_j = two_way_evidence(*pair.fields, pose, tolerance * pair.diameter)
        said = mean_evidence(of_i, of_j)
        agree.append(said.agree + said.contradict)
        front.append(said.front)
    assert agree == sorted(agree) and agree[0] < 0.3 * agree[-1]
    assert front == sorted(front, reverse=True) and front[-1] < 0.2 * front[0]


def test_the_truth_scores_better_than_any_wrong_pose():
    for gap in (30, 60, 90):
        pair = creature_pair(gap)
        best = mean_evidence(*evidence_at(pair, pair.i_from_j)).score
        for pose in random_poses(pair, 60):
            degrees, shift = pair.off_by(pose)
            if degrees > 5 or shift > 0.03:
                assert mean_evidence(*evidence_at(pair, pose)).score < best


def test_fewer_samples_say_about_the_same():
    pair = creature_pair(30)
    whole = two_way_evidence(*pair.fields, pair.i_from_j, TOLERANCE * pair.diameter)
    few = two_way_evidence(*pair.fields, pair.i_from_j, TOLERANCE * pair.diameter, 200)
    np.testing.assert_allclose(shares(few[0]), shares(whole[0]), atol=0.06)
    # Shares of exactly 200 samples.
    np.testing.assert_allclose(200 * shares(few[0]) % 1.0 % (1 - 1e-9), 0, atol=1e-9)


def test_the_mean_of_both_directions():
    a = Evidence(agree=0.6, front=0.1, contradict=0.0, free=0.1, occluded=0.2, unknown=0.0)
    b = Evidence(agree=0.2, front=0.0, contradict=0.2, free=0.0, occluded=0.1, unknown=0.5)
    mean = mean_evidence(a, b)
    np.testing.assert_allclose(shares(mean), 0.5 * (shares(a) + shares(b)))
    assert mean.score == pytest.approx(0.5 * (a.score + b.score))
