"""The coarse step as published: eq. 1, ICP point to point, and what must be refused."""

from dataclasses import replace

import numpy as np
import pytest

from scanweld.config import CoarseConfig, HeatConfig
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.point_fit import num_trusted
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.heat import Features, describe
from scanweld.published.coarse import CoarseAnswer, register_as_published
from scanweld.published.point_icp import point_icp
from scanweld.published.signature_matching import match_signatures
from tests.prepared import PreparedPair, creature_pair

KEYPOINTS = CoarseConfig(icp="keypoints")


def test_each_signature_finds_its_nearest():
    s = np.array([[0.0, 0.0], [5.0, 5.0], [9.0, 9.0]])
    t = np.array([[5.0, 5.2], [0.1, 0.0]])
    found = match_signatures(s, t, quantile=1.0)
    assert found.s.tolist() == [0, 1, 2] and found.t.tolist() == [1, 0, 0]
    expected = [np.sqrt(0.01 / 2), np.sqrt(0.04 / 2), np.sqrt((16 + 3.8**2) / 2)]
    assert found.distances == pytest.approx(expected)
    mutual = match_signatures(s, t, quantile=1.0, mutual=True)
    assert mutual.s.tolist() == [0, 1] and mutual.t.tolist() == [1, 0]


def test_matches_above_the_threshold_are_refused_and_of_equals_the_first_is_taken():
    s, t = np.array([[0.0], [1.0], [2.0], [10.0]]), np.array([[0.1], [1.2], [2.3], [14.0]])
    assert match_signatures(s, t, max_distance=0.25).s.tolist() == [0, 1]
    assert match_signatures(s, t, quantile=0.5).s.tolist() == [0, 1]
    assert match_signatures(s, t, max_distance=0.05).s.tolist() == []
    assert len(match_signatures(s, t, quantile=1.0)) == 4
    t = np.array([[1.0], [-1.0], [1.0]])
    found = match_signatures(np.array([[0.0], [1.0]]), t, quantile=1.0)
    assert found.t.tolist() == [0, 0]
    assert match_signatures(t, t, quantile=1.0, mutual=True).s.tolist() == [0, 1]
    for k, m in ((0, 4), (4, 0), (0, 0)):
        found = match_signatures(np.zeros((k, 3)), np.zeros((m, 3)))
        assert len(found) == 0 and found.s.dtype == np.int64


def blob(num: int = 400, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).normal(size=(num, 3)) * [3.0, 2.0, 1.0]


def small_motion(seed: int = 1) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose.exp(np.concatenate([0.05 * rng.normal(size=3), 0.05 * rng.normal(size=3)]))


def error_of(found: Pose, true: Pose) -> float:
    return float(np.abs(found.matrix() - true.matrix()).max())


def test_icp_finds_a_small_motion_exactly_and_no_pose_from_matches_in_one_point():
    true = small_motion()
    found = point_icp(blob(), true.apply(blob()), Pose.identity())
    assert error_of(found.target_from_source, true) < 1e-9
    assert found.converged and found.num_matches == 400 and found.rms < 1e-9
    # All of the source finds the same target: what was known stays, and did not converge.
    found = point_icp(blob(), np.array([[0.0, 0.0, 0.0], [1e3, 0.0, 0.0], [0.0, 1e3, 0.0]]), true)
    assert found.target_from_source is true and not found.converged
    with pytest.raises(ValueError, match="three points"):
        point_icp(blob(2), blob(), Pose.identity())


def test_trimming_leaves_out_what_the_target_lacks():
    """A third of the source has no counterpart: all matches pull it off, the closest do not."""
    true, stray = small_motion(), np.array([15.0, 0.0, 0.0])
    source, target = np.concatenate([blob(), blob(200, seed=5) + stray]), true.apply(blob())
    errors = {
        trim: error_of(point_icp(source, target, Pose.identity(), trim).target_from_source, true)
        for trim in (None, 0.5, "auto")
    }
    assert errors[0.5] < 1e-9 and errors["auto"] < 1e-9
    assert errors[None] > 0.1


def test_automatic_trim_counts_the_matches_that_fit():
    squares = np.concatenate([np.full(70, 1e-4), np.full(30, 1.0)])
    assert num_trusted(squares, "auto") == 70
    assert num_trusted(squares, None) == 100 and num_trusted(squares, 0.255) == 26
    assert num_trusted(np.full(10, 0.0), "auto") >= 3 and num_trusted(np.zeros(0), "auto") == 0


def made_features(
    pair: PreparedPair, num: int, num_wrong: int = 0, spread: tuple[float, ...] = (1.0, 1.0, 1.0)
) -> tuple[Features, Features]:
    """Keypoints of both scans at the same places; some have the signature of another."""
    rng = np.random.default_rng(3)
    points = 0.3 * pair.diameter * rng.uniform(-1, 1, size=(num, 3)) * spread
    normals = np.array([random_rotation(rng)[0] for _ in range(num)]).reshape(-1, 3)
    signatures = rng.normal(size=(num, 10))
    mixed = signatures.copy()
    mixed[:num_wrong] = np.roll(signatures[:num_wrong], 1, axis=0)
    one = Features(
        points=points,
        normals=normals,
        signatures=signatures,
        strengths=np.zeros(num),
        times=np.arange(10.0),
        found_at=points,
    )
    moved, turned = pair.i_from_j.apply(points), pair.i_from_j.turn(normals)
    return replace(one, points=moved, normals=turned, signatures=mixed, found_at=moved), one


def register(
    pair: PreparedPair, features: tuple[Features, Features], config: CoarseConfig
) -> CoarseAnswer:
    return register_as_published(*pair.scans, *features, config)


def found_pose(answer: CoarseAnswer) -> Pose:
    assert answer.i_from_j is not None and not answer.reason
    return answer.i_from_j


@pytest.mark.parametrize("mutual", [False, True])
def test_right_matches_give_the_pose(mutual: bool):
    pair = creature_pair(60)
    config = KEYPOINTS.model_copy(update={"mutual": mutual})
    answer = register(pair, made_features(pair, 15), config)
    angle, shift = pair.off_by(found_pose(answer))
    assert angle < 1e-6 and shift < 1e-9
    assert answer.num_matches == 15 and answer.rms < 1e-9 * pair.diameter


def test_icp_of_the_surfaces_stays_where_right_matches_put_it():
    pair = creature_pair(30)
    answer = register(pair, made_features(pair, 15), CoarseConfig(trim="auto"))
    angle, shift = pair.off_by(found_pose(answer))
    assert angle < 2 and shift < 0.01
    assert 0 < answer.rms < 0.02 * pair.diameter


def test_a_consensus_survives_wrong_matches_and_a_fit_does_not():
    pair = creature_pair(30)
    features = made_features(pair, 20, num_wrong=13)
    fitted = found_pose(register(pair, features, CoarseConfig()))
    config = CoarseConfig(start="consensus", num_nearest=2, trim="auto")
    answer = register(pair, features, config)
    assert pair.off_by(fitted)[0] > 10
    assert pair.off_by(found_pose(answer))[0] < 2
    assert answer.num_matches >= 7


def test_real_keypoints_and_the_sensors_evidence_find_a_wide_gap():
    pair = creature_pair(60)
    one, other = (describe(scan, HeatConfig()) for scan in pair.scans)
    answer = register(pair, (one, other), CoarseConfig(start="evidence", trim="auto"))
    angle, shift = pair.off_by(found_pose(answer))
    assert angle < 5 and shift < 0.02


@pytest.mark.parametrize(
    ("start", "num"), [("fit", 0), ("fit", 2), ("consensus", 0), ("consensus", 2), ("evidence", 0)]
)
def test_too_few_keypoints_or_such_on_a_line_are_no_pose(start: str, num: int):
    pair = creature_pair(60)
    answer = register(pair, made_features(pair, num), CoarseConfig.model_validate({"start": start}))
    assert answer.i_from_j is None and answer.reason and np.isnan(answer.rms)
    answer = register(pair, made_features(pair, 12, spread=(1.0, 0.0, 0.0)), KEYPOINTS)
    assert answer.i_from_j is None and "line" in answer.reason
