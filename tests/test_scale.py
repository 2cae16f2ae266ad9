"""Scans whose unit is a little off are found, and by how much; the others are not blamed."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import numpy as np
import pytest

from scanweld.config import PrepareConfig, RefineConfig
from scanweld.evaluation.scanner import NoiseModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.preparation import prepare
from scanweld.refinement.refine import refine_poses
from scanweld.sensor.model import SensorModel
from scanweld.sensor.scale import ScaleEstimate, estimate_scales
from tests.prepared import scaled
from tests.scenes import creature_scene

NOISE = NoiseModel(depth_diameters=5e-4)


@lru_cache
def placed(factor: float, unit: float = 1.0) -> tuple[list[PreparedScan], dict[int, Pose]]:
    """Six scans at their refined poses, the third one too large by a factor."""
    scene = creature_scene(6, noise=NOISE, seed=3)
    scans, poses = [], {}
    for k, scan in enumerate(scene.scans):
        larger = factor if k == 2 else 1.0
        scans.append(prepare(scaled(scan, larger * unit), PrepareConfig()))
        true = scene.world_from_scan[scan.name] @ scan.sensor_pose
        middle = scan.sensor_pose.inverse().apply(scan.points).mean(axis=0)
        shift = true.rotation @ (middle - larger * middle)
        poses[k] = Pose(rotation=true.rotation, translation=unit * (true.translation + shift))
    return scans, refine_poses(scans, poses, list(combinations(poses, 2)), RefineConfig()).poses


def scales_of(
    scans: list[PreparedScan], poses: Mapping[int, Pose], times: float = 1.0
) -> dict[int, ScaleEstimate]:
    """By a sensor that is known to err so many times as much as those of the scans do."""
    diameter = float(np.median([scan.diameter for scan in scans]))
    white, correlated = times * 7e-4 * diameter, times * 1e-4 * diameter
    sensor = SensorModel(
        num_certain=9,
        sigma=white,
        white=white,
        correlated=correlated,
        tolerance=0.01 * diameter,
        max_contradiction=0.1,
        diameter=diameter,
    )
    return estimate_scales(scans, poses, list(combinations(poses, 2)), sensor)


def estimates(factor: float, unit: float = 1.0) -> dict[int, ScaleEstimate]:
    return scales_of(*placed(factor, unit))


@pytest.mark.parametrize("factor", [1.015, 0.985])
def test_the_scan_that_is_off_is_named_with_its_factor(factor: float):
    found = estimates(factor)
    assert [k for k, estimate in found.items() if estimate.is_off] == [2]
    assert found[2].factor == pytest.approx(factor, abs=0.25 * abs(factor - 1))


def test_scans_in_one_unit_are_not_blamed():
    found = estimates(1.0)
    assert not any(estimate.is_off for estimate in found.values())
    assert max(abs(estimate.factor - 1) for estimate in found.values()) < 0.002
    assert all(0 < estimate.deviation < 0.005 for estimate in found.values())
    scans, poses = placed(1.0)
    apart = {k: Pose.exp([0, 0, 0, 1e4 * k, 0, 0]) @ pose for k, pose in poses.items()}
    assert scales_of(scans, apart) == {}, "scans that touch nothing have no scale"


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_depth_that_is_bent_makes_scales_less_sure_and_accuses_nobody():
    """Each scan seems to have another scale, so that none of them stands out."""
    scene = creature_scene(6, noise=NOISE, seed=3)
    rng = np.random.default_rng(5)
    scans, poses = [], {}
    for k, scan in enumerate(scene.scans):
        seen = scan.sensor_pose.inverse().apply(scan.points)
        size = np.ptp(seen[:, :2])
        waves = np.sin(seen[:, :2] @ rng.normal(size=2) * 9.0 / size + rng.uniform(0, 6))
        rays = seen / np.linalg.norm(seen, axis=1, keepdims=True)
        bent = scan.sensor_pose.apply(seen + 0.006 * size * waves[:, None] * rays)
        scans.append(prepare(replace(scan, points=bent), PrepareConfig()))
        poses[k] = scene.world_from_scan[scan.name] @ scan.sensor_pose
    poses = refine_poses(scans, poses, list(combinations(poses, 2)), RefineConfig()).poses
    found = scales_of(scans, poses)
    surest = max(estimate.deviation for estimate in estimates(1.0).values())
    assert min(estimate.deviation for estimate in found.values()) > 2 * surest
    assert not any(estimate.is_off for estimate in found.values())


def test_the_unit_of_all_does_not_matter():
    mm, m = estimates(1.01), estimates(1.01, 1e-3)
    for k, estimate in mm.items():
        assert m[k].factor == pytest.approx(estimate.factor, abs=1e-4)
        assert m[k].deviation == pytest.approx(estimate.deviation, rel=0.01)


def test_the_coarser_the_sensor_the_less_sure_are_scales():
    exact, coarse = estimates(1.01), scales_of(*placed(1.01), 10.0)
    assert all(coarse[k].deviation > 3.0 * exact[k].deviation for k in exact)
    assert exact[2].is_off and not coarse[2].is_off


def test_an_uncertain_scale_is_no_accusation_and_words_give_the_factor_to_apply():
    assert not ScaleEstimate(factor=1.02, deviation=0.01).is_off
    assert not ScaleEstimate(factor=1.003, deviation=1e-5).is_off
    assert ScaleEstimate(factor=np.exp(-0.01), deviation=0.002).is_off
    words = ScaleEstimate(factor=1.0101, deviation=0.0011).words()
    assert "1.010 times too large" in words and "0.001" in words
    assert "1.010 times too small" in ScaleEstimate(factor=0.99, deviation=0.001).words()
