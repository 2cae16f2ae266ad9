"""Pair registration from any start pose: exact truth found, and what must not be believed."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from scanweld.config import HeatConfig, PairsConfig
from scanweld.evaluation.primitives import box
from scanweld.evaluation.views import view_of
from scanweld.evidence.icp import IcpSchedule, icp
from scanweld.evidence.information import information_of
from scanweld.evidence.visibility import (
    AGREE,
    CONTRADICT,
    FREE,
    FRONT,
    GRAZING,
    UNKNOWN,
    count_evidence,
    kernel_view,
    pose_rows,
)
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import Features, describe
from scanweld.pairs.anchors import even_anchors, pair_anchors
from scanweld.pairs.distinct import distinct_poses
from scanweld.pairs.hypotheses import SWEEP_WEIGHTS, Anchors, sweep
from scanweld.pairs.problem import to_pose
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairKind, PairResult
from tests.prepared import PreparedPair, creature_pair, pair_of_scene, prepared_pair
from tests.scenes import primitive_scene, scene_of

CONFIG = PairsConfig()
PINHOLE, ORTHOGRAPHIC = CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC


@lru_cache
def features_of(scan: PreparedScan) -> Features:
    return describe(scan, HeatConfig())


def registered(pair: PreparedPair, config: PairsConfig = CONFIG) -> PairResult:
    anchors = [
        pair_anchors(field, features_of(scan), config)
        for field, scan in zip(pair.fields, pair.scans, strict=True)
    ]
    return register_pair(pair.problem(config), list(zip(*anchors, strict=True)))


@lru_cache
def creature_result(gap: float, model: CameraModel = PINHOLE, factor: float = 1.0) -> PairResult:
    return registered(creature_pair(gap, model, factor))


def best_pose(result: PairResult) -> Pose:
    assert result.best is not None
    return result.best.i_from_j


def swapped(pair: PreparedPair) -> PreparedPair:
    i_from_j = pair.i_from_j.inverse()
    return replace(pair, scans=pair.scans[::-1], fields=pair.fields[::-1], i_from_j=i_from_j)


def assert_found(pair: PreparedPair, found: Pose) -> None:
    degrees, shift = pair.off_by(found)
    assert degrees < 0.5 and shift < 0.005


@pytest.mark.parametrize(
    ("gap", "model"), [(30, PINHOLE), (60, PINHOLE), (90, PINHOLE), (90, ORTHOGRAPHIC)]
)
def test_the_truth_is_found_from_any_start_pose(gap: float, model: CameraModel):
    pair, result = creature_pair(gap, model), creature_result(gap, model)
    assert_found(pair, best_pose(result))
    assert result.kind is PairKind.GOOD and result.reason == ""
    assert result.best is not None and result.best.score > CONFIG.min_score
    assert 0 < result.rms < 0.003 * pair.diameter
    information = result.information
    np.testing.assert_allclose(information, information.T, atol=1e-12)
    eigenvalues = np.linalg.eigvalsh(information)
    assert eigenvalues[0] > 0
    assert result.observability == pytest.approx(eigenvalues[0] / eigenvalues[-1])
    # Directions are unit vectors: the translation block of each match has trace 1, less noise.
    assert 0.97 < np.trace(information[3:, 3:]) < 1.0


@pytest.mark.parametrize("keypoints", ["heat", "even"])
def test_either_kind_of_anchors_alone_finds_it(keypoints: str):
    config = CONFIG.model_copy(update={"keypoints": keypoints})
    assert_found(creature_pair(30), best_pose(registered(creature_pair(30), config)))


def test_alternatives_are_distinct_and_in_order():
    pair, result = creature_pair(60), creature_result(60)
    scores = [option.score for option in result.alternatives]
    assert scores == sorted(scores, reverse=True)
    assert 1 < len(scores) <= CONFIG.num_alternatives
    assert result.margin == pytest.approx(min(1.0, (scores[0] - scores[1]) / scores[0]))
    for a, p in enumerate(result.alternatives):
        for q in result.alternatives[:a]:
            apart = p.i_from_j.inverse() @ q.i_from_j
            shift = apart.shift_at(pair.fields[1].centre) / pair.diameter
            assert apart.angle_deg() > 11 or shift > 0.05


@dataclass(frozen=True)
class ToTruth:
    """A refinement that arrives from anywhere."""

    i_from_j: Pose

    def refine(self, i_from_j: Pose) -> Pose:
        return self.i_from_j


def test_an_answer_is_no_rival_of_itself():
    """A refinement from afar brings both of the best poses to the truth."""
    pair = creature_pair(30)
    anchors = [(even_anchors(pair.fields[0], 64), even_anchors(pair.fields[1], 64))]
    result = register_pair(pair.problem(), anchors, ToTruth(pair.i_from_j))
    errors = [pair.off_by(option.i_from_j) for option in result.alternatives]
    assert sum(degrees < 12 and shift < 0.06 for degrees, shift in errors) == 1
    assert result.kind is PairKind.GOOD and result.margin > CONFIG.min_margin


@pytest.mark.parametrize("name", ["sphere", "cylinder", "plate"])
def test_surfaces_that_slide_or_repeat_are_never_good(name: str):
    result = registered(pair_of_scene(primitive_scene(name), 0, 1))
    assert result.kind in (PairKind.SLIDING, PairKind.AMBIGUOUS)
    assert result.reason
    if name != "plate":
        assert result.kind is PairKind.SLIDING
        assert result.observability < CONFIG.min_observability


@pytest.mark.parametrize("gap", [45, 180])
def test_a_cube_is_ambiguous(gap: float):
    mesh = box(80, 80, 80)
    views = [view_of(mesh, azimuth, 25, pixels=100) for azimuth in (20, 20 + gap)]
    result = registered(pair_of_scene(scene_of(mesh, views), 0, 1))
    assert result.kind is PairKind.AMBIGUOUS
    assert result.margin < CONFIG.min_margin and "another pose" in result.reason


@pytest.mark.parametrize("name", ["sphere", "box"])
def test_scans_of_different_objects_are_not_good(name: str):
    mine, theirs = creature_pair(60).scans[0].scan, primitive_scene(name).scans[0]
    result = registered(prepared_pair(mine, theirs, Pose.identity()))
    assert result.kind is not PairKind.GOOD and result.reason


def test_another_unit_changes_nothing_but_the_unit():
    near, far = creature_result(60), creature_result(60, PINHOLE, 1000.0)
    assert far.kind is near.kind
    assert far.observability == pytest.approx(near.observability, rel=1e-3)
    assert far.rms == pytest.approx(1000 * near.rms, rel=1e-3)
    a, b = best_pose(near), best_pose(far)
    np.testing.assert_allclose(b.rotation, a.rotation, atol=1e-4)
    np.testing.assert_allclose(b.translation, 1000 * a.translation, atol=10.0)


def test_swapping_the_scans_inverts_the_pose():
    """Information is about the matches' centroid: swapping turns it, but its spectrum stays."""
    pair = creature_pair(60)
    result = registered(swapped(pair))
    apart = best_pose(result) @ best_pose(creature_result(60))
    assert apart.angle_deg() < 0.3
    assert apart.shift_at(pair.fields[1].centre) < 0.002 * pair.diameter
    assert result.kind is PairKind.GOOD
    spectra, radius = [], 0.012 * pair.diameter
    for each in (pair, swapped(pair)):
        information, rms, count = information_of(*each.fields, each.i_from_j, radius, pair.diameter)
        assert count > 200 and rms < radius
        spectra.append(np.linalg.eigvalsh(information))
    np.testing.assert_allclose(spectra[0], spectra[1], rtol=0.02)


# Refinement


def schedule(pair: PreparedPair, rounds: int = 15, first: float = 0.05) -> IcpSchedule:
    first, last = first * pair.diameter, 0.01 * pair.diameter
    return IcpSchedule(num_rounds=rounds, first_radius=first, last_radius=last, num_samples=400)


@pytest.mark.parametrize("model", [PINHOLE, ORTHOGRAPHIC])
@pytest.mark.parametrize("gap", [30, 90])
def test_icp_stays_at_the_truth(gap: float, model: CameraModel):
    pair = creature_pair(gap, model)
    refined = icp(*pair.fields, pose_rows([pair.i_from_j]), schedule(pair), pair.diameter)
    degrees, shift = pair.off_by(to_pose(refined[0]))
    assert degrees < 0.4 and shift < 0.002


def test_icp_returns_to_the_truth_and_leaves_a_pose_without_matches_alone():
    pair = creature_pair(30)
    rng = np.random.default_rng(2)
    middle = Pose(rotation=np.eye(3), translation=pair.fields[1].centre)
    starts = []
    for _ in range(8):
        turn, shift = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        twist = np.concatenate([np.radians(6) * turn, 0.02 * pair.diameter * shift])
        starts.append(pair.i_from_j @ middle @ Pose.exp(twist) @ middle.inverse())
    wide = schedule(pair, rounds=20, first=0.08)
    refined = icp(*pair.fields, pose_rows(starts), wide, pair.diameter)
    errors = np.array([pair.off_by(to_pose(row)) for row in refined])
    assert (errors[:, 0] < 0.4).all() and (errors[:, 1] < 0.003).all()
    turns = refined[:, :9].reshape(-1, 3, 3)
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), [np.eye(3)] * 8, atol=1e-12)
    far = pose_rows([Pose.exp([0, 0, 0, 50.0 * pair.diameter, 0, 0])])
    np.testing.assert_array_equal(icp(*pair.fields, far, wide, pair.diameter), far)


# Hypotheses


def test_hypotheses_lay_anchor_on_anchor():
    """Point comes upon point and normal upon normal, whatever the turn."""
    pair = creature_pair(30)
    rng = np.random.default_rng(6)
    num_turns = 12
    for _ in range(5):
        a, b = (
            Anchors(points=f.points[k : k + 1], normals=f.normals[k : k + 1])
            for f, k in ((f, int(rng.integers(len(f.points)))) for f in pair.fields)
        )
        rows, scores = sweep(*pair.fields, a, b, num_turns, 1e3 * pair.diameter, num_turns)
        assert (np.diff(scores) <= 0).all()
        poses = [to_pose(row) for row in rows]
        for pose in poses:
            np.testing.assert_allclose(pose.apply(b.points), a.points, atol=1e-9 * pair.diameter)
            np.testing.assert_allclose(pose.turn(b.normals), a.normals, atol=1e-12)
        steps = [(poses[0].inverse() @ pose).angle_deg() for pose in poses]
        np.testing.assert_allclose(np.mod(np.add(steps, 1e-6), 360 / num_turns), 1e-6, atol=1e-5)
        assert len({tuple(np.round(row, 6)) for row in rows}) == len(rows)


def test_the_sweep_finds_hypotheses_near_the_truth_and_without_anchors_none():
    pair = creature_pair(30)
    a, b = (even_anchors(field, CONFIG.num_anchors) for field in pair.fields)
    rows, scores = sweep(*pair.fields, a, b, CONFIG.num_turns, 0.04 * pair.diameter, 200)
    errors = np.array([pair.off_by(to_pose(row)) for row in rows])
    is_near = (errors[:, 0] < 15) & (errors[:, 1] < 0.08)
    assert is_near[:30].any()
    assert scores.max() < 1 and (np.diff(scores) <= 0).all()
    none = Anchors(points=np.zeros((0, 3)), normals=np.zeros((0, 3)))
    rows, scores = sweep(*pair.fields, none, none, 8, 1.0, 10)
    assert rows.shape == (0, 12) and scores.shape == (0,)
    result = register_pair(pair.problem(), [(none, none)])
    assert result.kind is PairKind.NO_OVERLAP and result.best is None


@pytest.mark.parametrize(("model", "count"), [(PINHOLE, 64), (ORTHOGRAPHIC, 20)])
def test_hypotheses_are_scored_by_what_the_evidence_says_of_as_many_samples(
    model: CameraModel, count: int
):
    pair = creature_pair(30, model)
    fields = [
        replace(f, points=f.points[:count], normals=f.normals[:count], diameter=0.1 * f.diameter)
        for f in pair.fields  # Of so small a diameter the sweep's image is no coarser
    ]
    a, b = (even_anchors(field, CONFIG.num_anchors) for field in pair.fields)
    tolerance = 0.04 * pair.diameter
    rows, scores = sweep(fields[0], fields[1], a, b, 12, tolerance, 300)
    assert len(rows) > 20
    counts = count_evidence(
        *kernel_view(fields[0]), *kernel_view(fields[1]), rows, count, tolerance
    ).sum(axis=1)
    weights = np.zeros(8)
    weights[[AGREE, FRONT, CONTRADICT, FREE, UNKNOWN]] = SWEEP_WEIGHTS
    weights[GRAZING] = weights[FREE]
    # But for a few samples that lie on an edge of a pixel, in single precision.
    assert np.mean(np.isclose(counts @ weights / (2 * count), scores)) > 0.9


def test_even_anchors_leave_no_part_of_a_scan_out():
    field = creature_pair(30).fields[0]
    anchors = even_anchors(field, 40).points
    assert len(anchors) == 40
    apart = np.linalg.norm(anchors[:, None] - anchors, axis=2) + np.diag(np.full(40, np.inf))
    reach = np.linalg.norm(field.points[:, None] - anchors, axis=2).min(axis=1)
    assert reach.max() <= apart.min()


def test_distinct_poses_drop_what_is_near_a_better_one():
    centre = np.array([0.0, 0, 5])

    def about_centre(degrees: float, shift: float) -> Pose:
        turn = Pose.exp([0, np.radians(degrees), 0, 0, 0, 0]).rotation
        return Pose(rotation=turn, translation=centre - turn @ centre + [shift, 0, 0])

    poses = [about_centre(*p) for p in [(0, 0), (5, 0.5), (5, 2), (20, 0), (22, 0.9), (0, 1.5)]]
    for most in (10, 2):
        chosen = distinct_poses(pose_rows(poses), centre, np.radians(8), 1.0, most)
        assert chosen.tolist() == [0, 2, 3][:most]
    assert distinct_poses(pose_rows([]), centre, 0.1, 1.0, 5).tolist() == []
    rng = np.random.default_rng(3)
    poses = [Pose(rotation=random_rotation(rng), translation=np.zeros(3)) for _ in range(30)]
    chosen = distinct_poses(pose_rows(poses), np.zeros(3), np.radians(40), 1.0, 30)
    assert (np.diff(chosen) > 0).all() and chosen[0] == 0
    for k, pose in enumerate(poses):
        nearest = min((poses[c].inverse() @ pose).angle_deg() for c in chosen if c <= k)
        assert (nearest < 1e-6) == (k in chosen)
        assert k in chosen or nearest < 40
