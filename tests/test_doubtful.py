"""Doubtful scans are placed and marked, but are no part of the model unless that is asked for."""

import numpy as np
import pytest

from scanweld.config import Config, FusionConfig
from scanweld.evaluation.scanner import NoiseModel
from scanweld.pipeline.run import run
from scanweld.reconstruction import ScanVerdict, Verdict
from tests.prepared import scaled
from tests.results import Memory
from tests.scenes import creature_scene

TOO_LARGE = 1.015


@pytest.mark.slow
def test_a_scan_of_another_scale_is_doubtful_and_part_of_the_model_only_if_asked_for():
    """Of six scans the third one is too large; what only it saw is what the model grows by."""
    scene = creature_scene(6, noise=NoiseModel(depth_diameters=5e-4), seed=3)
    scans = [scaled(s, TOO_LARGE) if k == 2 else s for k, s in enumerate(scene.scans)]
    fusion = FusionConfig(max_voxels_across=80)
    memory = Memory()
    without, with_it = (
        run(
            scans,
            Config(fusion=fusion.model_copy(update={"with_doubtful": asked})),
            workers=1,
            cache=memory,
        )
        for asked in (False, True)
    )
    accused = {name for name, scan in without.scans.items() if "times too" in scan.reason}
    assert accused == {"scan_03"} <= set(without.poses)
    assert without.scans["scan_03"].verdict is ScanVerdict.DOUBTFUL
    assert "times too large" in without.scans["scan_03"].reason
    assert without.verdict is Verdict.DOUBTFUL
    assert without.reasons[0].startswith("doubtful: scan_03")
    assert without.reasons[0].endswith(" (placed, but left out of the model)")
    assert without.mesh is not None and with_it.mesh is not None
    assert "left out" not in with_it.reasons[0]
    assert len(with_it.mesh.faces) > 1.02 * len(without.mesh.faces)
    for name, pose in without.poses.items():
        np.testing.assert_array_equal(pose.matrix(), with_it.poses[name].matrix())
