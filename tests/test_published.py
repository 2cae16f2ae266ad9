"""The method as published, end to end: what it finds, and that it does not claim more."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import pytest

from scanweld.app.outputs import report_json
from scanweld.app.summary import summary
from scanweld.config import CoarseConfig, Config
from scanweld.evaluation.metrics import Standing
from scanweld.geometry.scan import RangeScan
from scanweld.pairs.result import PairKind
from scanweld.pipeline import run as pipeline
from scanweld.reconstruction import Reconstruction, ScanVerdict, Verdict
from scanweld.work.progress import Cache
from tests.scenes import MILD_NOISE, Scene, creature_scene, primitive_scene
from tests.test_pipeline import CONFIG, Memory, assert_sound, errors_of

pytestmark = pytest.mark.slow

PAPER = CONFIG.model_copy(update={"method": "paper"})
REPAIRED = PAPER.model_copy(update={"coarse": CoarseConfig(start="evidence", trim="auto")})


@lru_cache
def scene() -> Scene:
    return creature_scene(8, pixels=170, noise=MILD_NOISE, seed=8)


def three() -> Sequence[RangeScan]:
    return scene().scans[:3]


def run(
    scans: Sequence[RangeScan], config: Config, workers: int = 1, cache: Cache | None = None
) -> Reconstruction:
    result = pipeline.run(scans, config, workers=workers, cache=cache)
    assert_sound(result, scans)
    return result


@lru_cache
def repaired() -> Reconstruction:
    return run(three(), REPAIRED)


@pytest.mark.parametrize("config", [PAPER, REPAIRED], ids=["as published", "repaired"])
def test_no_wrong_pose_is_called_good_and_evidence_at_the_start_finds_all(
    config: Config, tmp_path: Path
):
    result = repaired() if config is REPAIRED else run(three(), config)
    errors = errors_of(result, scene().world_from_scan, three())
    wrong = {name for name, at in errors.scans.items() if at.standing is Standing.WRONG}
    good = {name for name, scan in result.scans.items() if scan.verdict is ScanVerdict.GOOD}
    assert not wrong & good
    assert (result.verdict is Verdict.GOOD) == (good == set(result.scans))
    for pair in result.pairs:
        assert pair.accepted or pair.reason
    if config is REPAIRED:
        assert errors.count(Standing.RIGHT) == 3
        assert {"features", "search", "graph", "refine", "fuse"} <= set(result.stages)
    assert report_json(result)["settings"]["method"] == "paper"
    assert "(method: paper)" in summary(result, tmp_path).splitlines()[0]


def test_a_symmetric_object_is_not_good():
    """Scans of a box: one pose a pair, and its evidence without rivals would be believed."""
    result = run(primitive_scene("box").scans[:3], REPAIRED)
    assert result.verdict is not Verdict.GOOD
    assert any(pair.kind is PairKind.AMBIGUOUS for pair in result.pairs)


def test_the_same_bytes_at_two_workers():
    one, two = repaired(), run(three(), REPAIRED, workers=2)
    assert one.mesh is not None and two.mesh is not None
    assert one.mesh.vertices.tobytes() == two.mesh.vertices.tobytes()
    for name, pose in one.poses.items():
        assert pose.matrix().tobytes() == two.poses[name].matrix().tobytes()


def test_finished_pairs_are_kept_for_their_own_reading_only():
    memory, two = Memory(), three()[:2]
    first = run(two, PAPER, cache=memory)
    kept = len(memory.kept)
    again = run(two, PAPER, cache=memory)
    assert len(memory.kept) == kept
    assert [p.score for p in again.pairs] == [p.score for p in first.pairs]
    other = PAPER.model_copy(update={"coarse": CoarseConfig(mutual=True)})
    run(two, other, cache=memory)
    assert len(memory.kept) == kept + 1
