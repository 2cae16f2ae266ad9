"""Users' knowledge: it helps where it is right, is refused and named where it is not."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.outputs import report_json
from scanweld.app.summary import summary
from scanweld.confidence.assess import MAX_UNDECIDED_CONFIDENCE
from scanweld.config import Config, FusionConfig, PairsConfig, PrepareConfig
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import PoseSet
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline import run as pipeline
from scanweld.reconstruction import FactVerdict, Reconstruction, Verdict
from scanweld.work.progress import Cache
from tests.results import Memory
from tests.scenes import MILD_NOISE, Scene, scene_of, small_creature, view_of

pytestmark = pytest.mark.slow

CONFIG = Config(
    prepare=PrepareConfig(num_samples=500),
    pairs=PairsConfig(keypoints="even", num_anchors=40, num_turns=18, num_survivors=(600, 60)),
    fusion=FusionConfig(max_voxels_across=60),
)
HASTY = CONFIG.model_copy(
    update={
        "pairs": PairsConfig(keypoints="even", num_anchors=8, num_turns=8, num_survivors=(20, 5))
    }
)
"""A search so small that it misses pairs of thin overlap."""
STRICT = CONFIG.model_copy(update={"pairs": CONFIG.pairs.model_copy(update={"min_score": 0.10})})
"""Pairs of little overlap are refused unless a fact speaks for them."""
THOROUGH = STRICT.model_copy(update={"prepare": PrepareConfig(num_samples=1500)})
"""Samples enough to tell a pair of thin overlap from one that slides."""
FIRST, SECOND = "scan_01", "scan_02"
THIN = (20, 122)
"""Azimuths of a pair that alone is good by little."""
TOO_THIN = (300, 42)
"""Azimuths of a pair with the right pose first and too low a score."""
OPPOSITE = (110, 215)
"""Azimuths of a pair whose best pose is wrong, and contradicted."""


SHARED = Memory()
"""Pairs do not depend on knowledge other than start poses: they are registered once."""
ASIDE = [Pose.exp([0, 0, turn, 20, 0, 0]) for turn in (1.2, -0.9)]


@lru_cache
def seen_from(*azimuths: float, tilted: float | None = None, noisy: bool = False) -> Scene:
    """The creature on a turntable, each scan in a random frame; one more from above, if tilted."""
    mesh = small_creature()
    views = [view_of(mesh, azimuth, 10, pixels=160) for azimuth in azimuths]
    if tilted is not None:
        views.append(view_of(mesh, tilted, 50, pixels=160))
    return scene_of(mesh, views, seed=5, noise=MILD_NOISE if noisy else None)


def run(
    scans: Sequence[RangeScan],
    knowledge: Knowledge | None = None,
    config: Config = CONFIG,
    cache: Cache | None = None,
    workers: int = 1,
) -> Reconstruction:
    cache = SHARED if cache is None else cache
    return pipeline.run(scans, config, knowledge=knowledge, cache=cache, workers=workers)


def poses_of(scene: Scene, off: Mapping[str, Pose] | None = None) -> PoseSet:
    """The true poses of a scene in a frame of their own, some moved away from the truth."""
    world, off = Pose.exp([0.3, -0.2, 1.0, 40.0, 5.0, -30.0]), off or {}
    poses = {
        name: world @ off.get(name, Pose.identity()) @ pose
        for name, pose in scene.world_from_scan.items()
    }
    return PoseSet(poses=poses, components=(tuple(poses),))


def assert_right(result: Reconstruction, scene: Scene, a: str = FIRST, b: str = SECOND) -> None:
    """The pose of b relative to a: degrees, and shift of b's middle in diameters."""
    names = [scan.name for scan in scene.scans]
    true = scene.i_from_j(names.index(a), names.index(b))
    apart = true.inverse() @ result.poses[a].inverse() @ result.poses[b]
    middle = np.mean(scene.scans[names.index(b)].points, axis=0)
    assert apart.angle_deg() < 3 and apart.shift_at(middle) / 210.0 < 0.015


def verdicts(result: Reconstruction) -> dict[str, FactVerdict]:
    return {fact.fact: fact.verdict for fact in result.knowledge}


def reason_of(result: Reconstruction, fact: str) -> str:
    return next(f.reason for f in result.knowledge if f.fact == fact)


def poses_bytes(result: Reconstruction) -> list[bytes]:
    return [pose.matrix().tobytes() for _, pose in sorted(result.poses.items())]


def test_a_start_rescues_a_pair_that_the_search_misses_unless_it_is_wrong():
    """Also from 8 deg and a few percent off: the evidence is that of the refined pose."""
    scene = seen_from(*THIN)
    assert run(scene.scans, config=HASTY).verdict is Verdict.NOTHING
    rough = {SECOND: Pose.exp([0, 0, np.radians(8.0), 2.0, -2.0, 1.0])}
    for start in (poses_of(scene), poses_of(scene, rough)):
        result = run(scene.scans, Knowledge(start=start), HASTY)
        # How sure so little overlap is, the confidence says.
        assert len(result.poses) == 2 and result.verdict is not Verdict.NOTHING
        assert_right(result, scene)
        assert verdicts(result) == {"start poses": FactVerdict.HELD}
    wrong = poses_of(scene, {SECOND: ASIDE[0]})
    result = run(scene.scans, Knowledge(start=wrong), HASTY)
    assert result.verdict is Verdict.NOTHING and not result.poses
    assert verdicts(result) == {"start poses": FactVerdict.OPEN}
    assert not run(scene.scans, Knowledge(turntable=True), HASTY).poses


def test_a_right_start_rescues_a_pair_that_the_published_method_gets_wrong():
    scene, paper = seen_from(42, 100), CONFIG.model_copy(update={"method": "paper"})
    assert run(scene.scans, config=paper).verdict is Verdict.NOTHING
    upside_down = poses_of(scene, {SECOND: Pose.exp([np.pi, 0, 0, 0, 0, 0])})
    assert run(scene.scans, Knowledge(start=upside_down), paper).verdict is Verdict.NOTHING
    result = run(scene.scans, Knowledge(start=poses_of(scene)), paper)
    assert result.verdict is Verdict.GOOD
    assert_right(result, scene)


@pytest.mark.parametrize("wrong", [("scan_03",), ("scan_02",), ("scan_02", "scan_04")])
def test_wrong_starts_change_nothing_and_are_named_even_where_the_reference_is_one(
    wrong: tuple[str, ...],
):
    scene = seen_from(42, 100, 150, 200)
    alone = run(scene.scans)
    start = poses_of(scene, dict(zip(wrong, ASIDE, strict=False)))
    result = run(scene.scans, Knowledge(start=start))
    assert result.components[0][0] == "scan_02" and len(result.poses) == 4
    assert alone.verdict is Verdict.GOOD and result.verdict is Verdict.DOUBTFUL
    for scan in scene.scans:
        off = alone.poses[scan.name].inverse() @ result.poses[scan.name]
        # The right starts among them may lead to the same poses from another side.
        assert off.angle_deg() < 0.05
        assert off.shift_at(scan.points.mean(axis=0)) < 5e-4 * np.ptp(scan.points, axis=0).max()
    assert verdicts(result) == {"start poses": FactVerdict.CONTRADICTED}
    reason = reason_of(result, "start poses")
    assert f"{4 - len(wrong)} of 4" in reason and any(reason in told for told in result.reasons)
    assert [scan.name for scan in scene.scans if f"{scan.name} is" in reason] == list(wrong)


def test_a_fixed_scan_stays_and_two_that_cannot_both_stay_are_named():
    """At its start pose, or at its own frame: two of which are not one, being drawn at random."""
    scene = seen_from(42, 100)
    start = poses_of(scene)
    for name in (FIRST, SECOND):
        result = run(scene.scans, Knowledge(fix=(name,)))
        assert result.components[0][0] == name and result.verdict is Verdict.GOOD
        assert np.array_equal(result.poses[name].matrix(), np.eye(4))
        assert verdicts(result) == {f"fix {name}": FactVerdict.HELD}
        assert_right(result, scene)
    result = run(scene.scans, Knowledge(fix=(SECOND,), start=start))
    assert np.array_equal(result.poses[SECOND].matrix(), start.poses[SECOND].matrix())
    assert_right(result, scene)
    assert result.mesh is not None
    points = start.poses[SECOND].apply(scene.scans[1].points)
    apart = np.linalg.norm(result.mesh.vertices.mean(axis=0) - points.mean(axis=0))
    assert apart < 0.2 * 210
    both = run(scene.scans, Knowledge(fix=(SECOND, FIRST)))
    held, contradicted = FactVerdict.HELD, FactVerdict.CONTRADICTED
    assert verdicts(both) == {f"fix {SECOND}": held, f"fix {FIRST}": contradicted}
    assert both.verdict is Verdict.DOUBTFUL
    agreed = run(scene.scans, Knowledge(fix=(SECOND, FIRST), start=start))
    assert set(verdicts(agreed).values()) == {held} and agreed.verdict is Verdict.GOOD


def test_together_lets_a_pair_through_that_is_just_refused():
    scene = seen_from(*TOO_THIN)
    alone = run(scene.scans, config=STRICT)
    assert alone.verdict is Verdict.NOTHING
    assert "below" in alone.pairs[0].reason
    result = run(scene.scans, Knowledge(together=((SECOND, FIRST),)), STRICT)
    # That they are together lets them be placed; how sure that is, their confidence says.
    assert len(result.poses) == 2 and result.verdict is not Verdict.NOTHING
    assert_right(result, scene)
    assert "said to be together" in result.pairs[0].reason and result.pairs[0].accepted
    assert verdicts(result) == {f"together {FIRST} {SECOND}": FactVerdict.HELD}


def test_together_lets_no_contradicted_pair_through():
    scene = seen_from(*OPPOSITE)
    result = run(scene.scans, Knowledge(together=((FIRST, SECOND),)))
    assert result.verdict is Verdict.NOTHING and not result.poses
    (fact,) = result.knowledge
    assert fact.verdict is not FactVerdict.HELD
    assert "too little overlap" in fact.reason or "saw through" in fact.reason


def test_facts_about_scans_far_from_each_other():
    scene = seen_from(42, 100, 150, 200)
    result = run(scene.scans, Knowledge(together=((FIRST, "scan_04"), (FIRST, SECOND))))
    assert len(result.poses) == 4 and result.verdict is Verdict.DOUBTFUL
    assert list(verdicts(result).values()) == [FactVerdict.CONTRADICTED, FactVerdict.HELD]
    result = run(scene.scans, Knowledge(apart=((FIRST, "scan_04"),)))
    assert len(result.components[0]) == 4 and result.verdict is Verdict.GOOD
    assert verdicts(result) == {f"apart {FIRST} scan_04": FactVerdict.HELD}


@lru_cache
def twins() -> tuple[RangeScan, ...]:
    """Two scans each of two objects that look alike: by the scans alone they are one."""
    one, other = seen_from(42, 100, noisy=True), seen_from(44, 103, noisy=True)
    names = ("a1", "a2", "b1", "b2")
    scans = (*one.scans, *other.scans)
    return tuple(replace(scan, name=name) for scan, name in zip(scans, names, strict=True))


def test_apart_keeps_two_objects_apart_that_look_alike():
    assert len(run(twins()).components) == 1
    apart = tuple((a, b) for a in ("a1", "a2") for b in ("b1", "b2"))
    result = run(twins(), Knowledge(apart=apart))
    assert sorted(sorted(c) for c in result.components) == [["a1", "a2"], ["b1", "b2"]]
    assert result.verdict is not Verdict.GOOD
    assert "good pair" in reason_of(result, "apart a1 b1")
    for pair in result.pairs:
        is_across = pair.i[0] != pair.j[0]
        assert pair.accepted is not is_across
        assert not is_across or pair.reason == "said to be apart"
    # Only a1 and b1 are apart; through a2 or b2 they would come to lie on each other.
    homes = [set(c) for c in run(twins(), Knowledge(apart=(("b1", "a1"),))).components]
    assert homes and all(not {"a1", "b1"} <= home for home in homes)


def test_a_turntable_supports_a_thin_pair():
    scene = seen_from(42, 100, 150, 303)
    assert set(run(scene.scans, None, THOROUGH).unplaced) == {"scan_04"}
    result = run(scene.scans, Knowledge(turntable=True), THOROUGH)
    assert result.verdict is not Verdict.PARTIAL and len(result.poses) == 4
    assert (result.scans["scan_04"].confidence or 0.0) > MAX_UNDECIDED_CONFIDENCE
    for scan in scene.scans[1:]:
        assert_right(result, scene, FIRST, scan.name)
    assert verdicts(result) == {"turntable": FactVerdict.HELD}
    assert "3 good pairs turn about one axis to within 0." in reason_of(result, "turntable")


def test_a_scan_off_the_axis_is_refused_and_named():
    """From above it has as many good pairs as the others have among themselves."""
    scene = seen_from(42, 100, 150, tilted=70)
    assert len(run(scene.scans).poses) == 4
    result = run(scene.scans, Knowledge(turntable=True))
    assert set(result.unplaced) == {"scan_04"}
    assert "off the turntable's axis by 4" in result.unplaced["scan_04"]
    assert verdicts(result) == {"turntable": FactVerdict.CONTRADICTED}
    assert reason_of(result, "turntable").count("scan_04") == 3
    assert result.verdict is Verdict.DOUBTFUL


def test_order_and_workers_do_not_change_a_byte():
    scene = seen_from(42, 100, 150, 300)
    known = Knowledge(
        fix=(SECOND,),
        start=poses_of(scene, {"scan_03": ASIDE[0]}),
        together=((FIRST, "scan_04"),),
        apart=(("scan_04", SECOND),),
        turntable=True,
    )
    result = run(scene.scans, known, cache=Memory())
    again = run(scene.scans[::-1], known, cache=Memory(), workers=2)
    assert poses_bytes(result) == poses_bytes(again)
    assert result.knowledge == again.knowledge and result.reasons == again.reasons


def test_facts_are_in_the_report_and_the_summary():
    """Two scans say nothing of an axis."""
    scene = seen_from(42, 100)
    result = run(scene.scans, Knowledge(fix=(FIRST,), turntable=True))
    assert result.verdict is Verdict.GOOD
    told = json.loads(json.dumps(report_json(result)["knowledge"]))
    assert [set(fact) for fact in told] == [{"fact", "verdict", "reason"}] * 2
    assert told[0]["verdict"] == "held" and told[1]["verdict"] == "open"
    lines = summary(result, Path("model")).splitlines()
    assert any(line.startswith(f"  held fix {FIRST}: ") for line in lines)
    assert "knowledge" not in report_json(run(scene.scans, Knowledge()))
