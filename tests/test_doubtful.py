"""Doubtful scans are placed and marked, but are no part of the model unless that is asked for."""

from functools import lru_cache

import numpy as np
import pytest

from scanweld.config import Config, FusionConfig
from scanweld.evaluation.scanner import NoiseModel
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction, ScanVerdict, Verdict
from tests.prepared import scaled
from tests.scenes import creature_scene

pytestmark = pytest.mark.slow

TOO_LARGE = 1.015


@lru_cache
def reconstruction(with_doubtful: bool) -> Reconstruction:
    """Six scans, the third one too large."""
    scene = creature_scene(6, noise=NoiseModel(depth_diameters=5e-4), seed=3)
    scans = [scaled(s, TOO_LARGE) if k == 2 else s for k, s in enumerate(scene.scans)]
    fusion = FusionConfig(max_voxels_across=80, with_doubtful=with_doubtful)
    return run(scans, Config(fusion=fusion))


def test_a_scan_of_another_scale_is_placed_and_doubtful_and_its_factor_named():
    result = reconstruction(False)
    accused = {name for name, scan in result.scans.items() if "times too" in scan.reason}
    assert accused == {"scan_03"} <= set(result.poses)
    assert result.scans["scan_03"].verdict is ScanVerdict.DOUBTFUL
    assert "times too large" in result.scans["scan_03"].reason
    assert result.verdict is Verdict.DOUBTFUL
    assert result.reasons[0].startswith("doubtful: scan_03")
    assert result.reasons[0].endswith(" (placed, but left out of the model)")


def test_the_model_grows_by_what_only_the_doubtful_scan_saw():
    without, with_it = reconstruction(False), reconstruction(True)
    assert without.mesh is not None and with_it.mesh is not None
    assert "left out" not in with_it.reasons[0]
    assert len(with_it.mesh.faces) > 1.02 * len(without.mesh.faces)
    for name, pose in without.poses.items():
        np.testing.assert_array_equal(pose.matrix(), with_it.poses[name].matrix())
