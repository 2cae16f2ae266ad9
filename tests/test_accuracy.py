"""How exact poses are: what cycles and points leave of it, whatever the unit and the world."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import pytest

from scanweld.config import PrepareConfig
from scanweld.geometry.gauss_newton import jacobian, lever_arm
from scanweld.geometry.pose import Pose
from scanweld.geometry.pose_tolerance import PoseTolerance
from scanweld.geometry.prepared import PreparedScan
from scanweld.preparation import prepare
from scanweld.refinement.surface_terms import SurfaceSource, surface_source
from scanweld.sensor.accuracy import carried_twist, pose_deviations
from scanweld.sensor.model import SensorModel
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
    told = {"white": 1e-4, "correlated": 1e-5, "closure": 0.0} | shares
    sensor = SensorModel(
        num_certain=9,
        sigma=1e-3 * diameter,
        white=told["white"] * diameter,
        correlated=told["correlated"] * diameter,
        tolerance=0.01 * diameter,
        max_contradiction=0.1,
        diameter=diameter,
        closure=told["closure"] * diameter,
        num_cycles=1000,
    )
    moved = {k: (world or Pose.identity()) @ pose for k, pose in poses.items()}
    held = {k: moved[k] for edge in edges for k in edge} if edges else moved
    return pose_deviations(
        {k: sources[k] for k in held}, held, edges or list(combinations(held, 2)), sensor
    )


def test_a_pair_is_no_surer_than_cycles_close_however_exact_its_points(ring: Ring):
    """A displacement c in six directions alike, half of it in either scan."""
    closure, diameter = 0.01, ring[2]
    (a, b) = deviations(ring, [(0, 1)], closure=closure).values()
    expected = closure * diameter * np.sqrt(3.0 / 6.0) / 2.0
    for one in (a, b):
        turned = np.radians(one.angle_deg) * lever_arm(diameter)
        assert turned == pytest.approx(expected, rel=0.1)
        assert one.shift == pytest.approx(expected, rel=0.5)
    exact, _ = deviations(ring, [(0, 1)]).values()
    assert exact.shift < 0.1 * a.shift


def test_more_pairs_make_poses_surer_and_the_end_of_a_chain_is_least_sure(ring: Ring):
    chain = [(k, k + 1) for k in range(NUM_SCANS - 1)]
    alone = deviations(ring, chain, closure=0.01)
    closed = deviations(ring, [*chain, (0, NUM_SCANS - 1)], closure=0.01)
    assert all(closed[k].shift < alone[k].shift for k in (0, NUM_SCANS - 1))
    assert alone[0].angle_deg > 1.3 * alone[NUM_SCANS // 2].angle_deg
    angles = [one.angle_deg for one in closed.values()]
    assert max(angles) < 1.2 * min(angles), "a ring has no ends"


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
