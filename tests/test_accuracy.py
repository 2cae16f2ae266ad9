"""How exact poses are: what cycles and points leave of it, whatever the unit and the world."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import pytest

from scanweld.config import PrepareConfig
from scanweld.geometry.gauss_newton import jacobian
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.geometry.prepared import PreparedScan
from scanweld.preparation import prepare
from scanweld.refinement.surface_terms import SurfaceSource, surface_source
from scanweld.sensor.accuracy import carried_twist, pose_deviations
from scanweld.sensor.model import SensorModel
from scanweld.sensor.network import PairNetwork, PairTie
from tests.scenes import creature_scene, random_motion

NUM_SCANS = 6
Ring = tuple[dict[int, SurfaceSource], dict[int, Pose], float]


@pytest.fixture(scope="module")
def ring() -> Ring:
    """Scans around the creature at their true poses, and its diameter."""
    scene = creature_scene(NUM_SCANS, pixels=160)
    scans: list[PreparedScan] = [prepare(scan, PrepareConfig()) for scan in scene.scans]
    poses = {
        k: scene.world_from_scan[scan.name] @ scan.scan_from_sensor for k, scan in enumerate(scans)
    }
    sources = {k: surface_source(scan, 2000) for k, scan in enumerate(scans)}
    return sources, poses, float(np.median([scan.diameter for scan in scans]))


def deviations(
    ring: Ring,
    edges: Sequence[tuple[int, int]] | None = None,
    world: Pose | None = None,
    **shares: float,
) -> Mapping[int, PoseTolerance]:
    """By a sensor whose errors are these shares of the diameter."""
    sources, poses, diameter = ring
    told = {"white": 1e-4, "correlated": 1e-5} | shares
    sensor = SensorModel(
        num_certain=9,
        sigma=1e-3 * diameter,
        white=told["white"] * diameter,
        correlated=told["correlated"] * diameter,
        tolerance=0.01 * diameter,
        max_contradiction=0.1,
        diameter=diameter,
    )
    moved = {k: (world or Pose.identity()) @ pose for k, pose in poses.items()}
    held = {k: moved[k] for edge in edges for k in edge} if edges else moved
    return pose_deviations(
        {k: sources[k] for k in held}, held, edges or list(combinations(held, 2)), sensor
    )


def drawn_network(edges: Sequence[tuple[int, int]], error: float, seed: int = 0) -> PairNetwork:
    """Pairs that points hold most firmly, each of which is amiss by an error of its own."""
    rng = np.random.default_rng(seed)
    num_scans, firm = 1 + max(k for edge in edges for k in edge), np.full(6, 1e8)
    ties = [
        PairTie(
            a=a,
            b=b,
            firmness=firm,
            directions=np.eye(6),
            pull=firm * error / np.sqrt(6.0) * rng.normal(size=6),
            by_a=np.eye(6),
            by_b=np.eye(6),
        )
        for a, b in edges
    ]
    alike = np.tile(np.eye(6), (num_scans, 1)) / np.sqrt(num_scans)
    free = np.linalg.svd(alike, full_matrices=True)[0][:, 6:]
    return PairNetwork(ties=ties, free=free, diameter=1.0)


def test_pairs_that_miss_each_other_tell_their_error_however_exact_their_points():
    edges = list(combinations(range(10), 2))
    found = [drawn_network(edges, 0.01, seed).pair_error(apart=1e-4) for seed in range(5)]
    assert np.mean(found) == pytest.approx(0.01, rel=0.1)
    assert drawn_network(edges, 0.0).pair_error(apart=1e-4) < 1e-4
    assert drawn_network(edges, 0.5).pair_error(apart=0.0) < 0.06, "farther off is another pose"
    chain = [(k, k + 1) for k in range(9)]
    assert drawn_network(chain, 0.01).redundancy == 0
    usual = drawn_network(chain, 0.01).pair_error(apart=0.002)
    assert usual == drawn_network(chain, 0.02).pair_error(apart=0.002) > 0, "a chain tells nothing"


def test_a_pair_is_no_surer_than_its_error_however_exact_its_points():
    """A displacement in six directions alike, half of it in either scan."""
    covariance = drawn_network([(0, 1)], 0.0).covariance(0.01)
    shifts = np.sqrt(np.diag(covariance).reshape(2, 2, 3).sum(axis=2))
    np.testing.assert_allclose(shifts, 0.01 * np.sqrt(3.0 / 6.0) / 2.0, rtol=1e-2)
    exact = drawn_network([(0, 1)], 0.0).covariance(0.0)
    assert np.trace(exact) < 1e-3 * np.trace(covariance)


def test_more_pairs_make_poses_surer_and_the_end_of_a_chain_is_least_sure():
    chain = [(k, k + 1) for k in range(NUM_SCANS - 1)]
    alone, closed = (
        np.diag(drawn_network(edges, 0.0).covariance(0.01))[::6]
        for edges in (chain, [*chain, (0, NUM_SCANS - 1)])
    )
    assert all(closed < alone)
    assert alone[0] > 1.3 * alone[NUM_SCANS // 2]
    np.testing.assert_allclose(closed, closed[0], rtol=1e-3, err_msg="a ring has no ends")


def test_shared_errors_count_more_than_noise_and_neither_world_nor_pairs_order_matter(ring: Ring):
    noisy, bent = deviations(ring, white=1e-3), deviations(ring, correlated=1e-3)
    assert all(bent[k].shift > 2.0 * noisy[k].shift for k in noisy)
    world = random_motion(np.random.default_rng(4), 100.0)
    for k, one in deviations(ring, world=world, correlated=1e-3, white=1e-3).items():
        other = deviations(ring, correlated=1e-3, white=1e-3)[k]
        assert one.angle_deg == pytest.approx(other.angle_deg, rel=1e-6)
        assert one.shift == pytest.approx(other.shift, rel=1e-6)


def test_a_twist_about_one_point_moves_points_like_the_one_it_is_carried_to():
    rng = np.random.default_rng(5)
    points, directions, (here, there) = *rng.normal(size=(2, 20, 3)), rng.normal(size=(2, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    about_here = jacobian(points, directions, here, 2.0)
    carried = jacobian(points, directions, there, 2.0) @ carried_twist(here - there, 2.0)
    np.testing.assert_allclose(about_here, carried, atol=1e-12)


def test_scans_without_any_error_have_poses_almost_without_any(ring: Ring):
    for one in deviations(ring, white=0.0, correlated=0.0).values():
        assert 0 < one.shift < 1e-3 * ring[2] and np.isfinite(one.angle_deg)
