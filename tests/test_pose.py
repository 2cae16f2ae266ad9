"""Rigid motions: the axioms of a group, exponential and logarithm, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import (
    Pose,
    nearest_rotation,
    random_rotation,
    rotation_exp,
    rotation_log,
)


def vectors(bound: float) -> st.SearchStrategy[FloatArray]:
    return arrays(np.float64, 3, elements=st.floats(-bound, bound, allow_subnormal=False))


@st.composite
def directions(draw: st.DrawFn) -> FloatArray:
    """Unit vectors, the axes of the frame among them."""
    vector = draw(vectors(1.0).filter(lambda v: np.linalg.norm(v) > 1e-3))
    return vector / np.linalg.norm(vector)


@st.composite
def angles(draw: st.DrawFn) -> float:
    """Angles in [0, pi]: any, tiny ones, and ones just short of half a turn."""
    tiny = st.floats(-12.0, -2.0).map(lambda e: 10.0**e)
    near_half = tiny.map(lambda e: np.pi - e)
    ends = st.sampled_from([0.0, np.pi])
    return draw(st.one_of(st.floats(0.0, np.pi), tiny, near_half, ends))


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    rotation = rotation_exp(draw(angles()) * draw(directions()))
    return Pose(rotation=rotation, translation=draw(vectors(1e3)))


def assert_same(p: Pose, q: Pose, atol: float = 1e-9) -> None:
    np.testing.assert_allclose(p.rotation, q.rotation, atol=atol)
    np.testing.assert_allclose(p.translation, q.translation, atol=atol * 1e3)


@given(poses(), poses(), vectors(1e3))
def test_a_product_is_a_pose_that_moves_like_its_factors(a: Pose, b: Pose, point: FloatArray):
    product = a @ b
    np.testing.assert_allclose(product.rotation @ product.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(product.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(product.apply(point), a.apply(b.apply(point)), atol=1e-8)
    np.testing.assert_allclose(product.matrix(), a.matrix() @ b.matrix(), atol=1e-8)


@given(poses(), poses(), poses())
def test_poses_are_a_group_and_come_back_from_matrix_and_logarithm(a: Pose, b: Pose, c: Pose):
    one = Pose.identity()
    assert_same((a @ b) @ c, a @ (b @ c))
    for same in (one @ a, a @ one, a.inverse().inverse(), Pose.from_matrix(a.matrix())):
        assert_same(same, a)
    assert_same(a @ a.inverse(), one)
    assert_same(a.inverse() @ a, one)
    assert_same(Pose.exp(a.log()), a, atol=1e-8)


@given(angles(), directions(), vectors(100.0))
def test_log_undoes_exp(angle: float, axis: FloatArray, generator: FloatArray):
    """Up to the axis' sign at half a turn, where both are the same motion."""
    twist = np.concatenate([angle * axis, generator])
    found = Pose.exp(twist).log()
    assert np.linalg.norm(found[:3]) == pytest.approx(angle, abs=1e-7)
    if angle < np.pi - 1e-5:
        np.testing.assert_allclose(found, twist, atol=1e-7 * (1 + float(np.linalg.norm(generator))))


@given(angles(), directions())
def test_the_logarithm_of_a_rotation_is_its_axis_times_its_angle(angle: float, axis: FloatArray):
    rotation = rotation_exp(angle * axis)
    np.testing.assert_allclose(rotation @ axis, axis, atol=1e-12)
    assert np.trace(rotation) == pytest.approx(1 + 2 * np.cos(angle), abs=1e-12)
    vector = rotation_log(rotation)
    np.testing.assert_allclose(rotation_exp(vector), rotation, atol=1e-9)
    np.testing.assert_allclose(np.abs(vector @ axis), angle, atol=1e-7)


def test_a_screw_moves_along_its_axis():
    """Half a turn about z with a pitch: the point on the axis only slides."""
    screw = Pose.exp([0, 0, np.pi, 0, 0, 5.0])
    np.testing.assert_allclose(screw.apply(np.zeros(3)), [0, 0, 5], atol=1e-12)
    np.testing.assert_allclose(screw.apply(np.array([1.0, 0, 0])), [-1, 0, 5], atol=1e-12)


@given(poses(), vectors(1e3))
def test_angle_and_shift(pose: Pose, point: FloatArray):
    assert pose.angle_deg() == pytest.approx(pose.inverse().angle_deg(), abs=1e-6)
    assert 0 <= pose.angle_deg() <= 180 + 1e-9
    moved = pose.rotation @ point + pose.translation
    assert pose.shift_at(point) == pytest.approx(np.linalg.norm(moved - point))


@given(poses(), arrays(np.float64, (4, 3), elements=st.floats(-10, 10)))
def test_motions_keep_distances_and_turn_only_directions(pose: Pose, points: FloatArray):
    moved = pose.apply(points)
    np.testing.assert_allclose(
        np.linalg.norm(moved - moved[0], axis=1),
        np.linalg.norm(points - points[0], axis=1),
        atol=1e-9,
    )
    np.testing.assert_allclose(pose.turn(points - points[0]), moved - moved[0], atol=1e-9)


def test_a_matrix_rounded_to_four_digits_is_made_orthonormal():
    pose = Pose.exp([0.4, -1.0, 0.3, 5, 6, 7])
    found = Pose.from_matrix(np.round(pose.matrix(), 4))
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-14)
    assert (found.inverse() @ pose).angle_deg() < 0.02


@pytest.mark.parametrize(
    "matrix",
    [
        pytest.param(np.diag([2.0, 2.0, 2.0, 1.0]), id="scaled"),
        pytest.param(np.eye(4) + 0.01 * np.outer([1, 0, 0, 0], [0, 1, 0, 0]), id="sheared"),
        pytest.param(np.diag([-1.0, 1.0, 1.0, 1.0]), id="mirrored"),
        pytest.param(np.diag([-1.0, -1.0, -1.0, 1.0]), id="inverted"),
        pytest.param(np.eye(4) + 0.5 * np.outer([0, 0, 0, 1], [1, 0, 0, 0]), id="projective"),
        pytest.param(np.diag([1.0, np.nan, 1.0, 1.0]), id="not finite"),
        pytest.param(np.zeros((4, 4)), id="nothing"),
        pytest.param(np.eye(3), id="too small"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(matrix: FloatArray):
    with pytest.raises(ValueError):
        Pose.from_matrix(matrix)
    if matrix.shape == (4, 4) and not np.allclose(matrix[:3, :3], np.eye(3)):
        with pytest.raises(ValueError):
            Pose(rotation=matrix[:3, :3], translation=np.zeros(3))


def test_a_pose_is_finite_and_cannot_be_changed():
    with pytest.raises(ValueError):
        Pose(rotation=np.eye(3), translation=np.array([0, np.inf, 0]))
    own = np.zeros(3)
    pose = Pose(rotation=np.eye(3), translation=own)
    own[0] = 7.0
    assert pose.translation[0] == 0.0
    with pytest.raises(ValueError):
        pose.rotation[0, 0] = 2.0


@given(angles(), directions(), arrays(np.float64, (3, 3), elements=st.floats(-1e-3, 1e-3)))
def test_the_nearest_rotation_undoes_a_disturbance(
    angle: float, axis: FloatArray, noise: FloatArray
):
    rotation = rotation_exp(angle * axis)
    found = nearest_rotation(rotation + noise)
    assert np.linalg.norm(found - rotation) <= 2 * np.linalg.norm(noise) + 1e-12
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)


def test_random_rotations_favour_no_direction():
    rng = np.random.default_rng(5)
    turned = np.array([random_rotation(rng) for _ in range(2000)])
    assert np.abs(turned.mean(axis=0)).max() < 0.06
    angle = np.degrees([np.linalg.norm(rotation_log(r)) for r in turned])
    # The angle's density on SO(3) is (1 - cos a) / pi: its mean is 90 + 360 / pi^2 degrees.
    assert np.mean(angle) == pytest.approx(90 + 360 / np.pi**2, abs=2.5)
