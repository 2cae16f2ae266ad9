"""End to end on small rendered scenes: scans to poses, model and verdict."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from scanweld.app.export import export
from scanweld.app.html_report import write_html_report
from scanweld.app.options import MeshFormat, PoseFormat, Wanted
from scanweld.app.outputs import write_outputs
from scanweld.app.summary import summary
from scanweld.config import ConfidenceConfig, Config, FusionConfig, HeatConfig, PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.metrics import (
    Standing,
    evaluate_poses,
    object_diameter,
    scan_centroids,
)
from scanweld.evaluation.scanner import NoiseModel
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.io import PoseSet
from scanweld.pairs import registrar
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import PairResult
from scanweld.pipeline import run as pipeline
from scanweld.pipeline import stages as steps
from scanweld.reconstruction import Reconstruction, ScanVerdict, Verdict
from scanweld.work.progress import Cache
from tests.prepared import scaled
from tests.results import Memory
from tests.scenes import MILD_NOISE, Scene, creature_scene, primitive_scene

CONFIG = Config(
    prepare=PrepareConfig(num_samples=500),
    heat=HeatConfig(num_modes=60, max_front_vertices=600),
    fusion=FusionConfig(max_voxels_across=60),
)
"""Smaller than the defaults, for speed; what decides between right and wrong is untouched."""


@lru_cache
def creature() -> Scene:
    return creature_scene(6, pixels=170, noise=MILD_NOISE, seed=3)


@lru_cache
def few_run() -> tuple[Reconstruction, Memory]:
    """A run of a few scans, and what it kept."""
    memory = Memory()
    return run(few(), cache=memory), memory


def few() -> tuple[RangeScan, ...]:
    """Four neighbouring scans."""
    return creature().scans[:4]


def mesh_bytes(result: Reconstruction) -> tuple[bytes, bytes]:
    assert result.mesh is not None
    return result.mesh.vertices.tobytes(), result.mesh.faces.tobytes()


def run(scans: Sequence[RangeScan], workers: int = 1, cache: Cache | None = None) -> Reconstruction:
    result = pipeline.run(scans, CONFIG, workers=workers, cache=cache)
    assert_sound(result, scans)
    return result


def assert_sound(result: Reconstruction, scans: Sequence[RangeScan]) -> None:
    """Every scan is accounted for once; what has no pose has a reason."""
    names = {scan.name for scan in scans}
    assert set(result.poses) | set(result.unplaced) == names == set(result.scans)
    assert not set(result.poses) & set(result.unplaced)
    assert sorted(name for c in result.components for name in c) == sorted(result.poses)
    for component in result.components:
        assert result.poses[component[0]].angle_deg() == 0.0
    for name, report in result.scans.items():
        assert (report.verdict is ScanVerdict.UNPLACED) == (name in result.unplaced)
        assert report.reason
    assert (result.verdict is Verdict.GOOD) == (not result.reasons)


def errors_of(result: Reconstruction, truth: dict[str, Pose], scans: Sequence[RangeScan]):
    return evaluate_poses(
        PoseSet(poses=dict(result.poses), components=result.components),
        truth,
        centroids=scan_centroids(scans),
        diameter=object_diameter(scans, truth),
    )


@pytest.mark.slow
def test_all_scans_are_placed_exactly_and_the_report_names_every_pair():
    """The model's vertices lie on the object, in the frame of the component's first scan."""
    scene, (result, _) = creature(), few_run()
    assert result.verdict is Verdict.GOOD and result.verdict.exit_code == 0
    assert len(result.components) == 1 and len(result.poses) == 4
    truth = {scan.name: scene.world_from_scan[scan.name] for scan in few()}
    errors = errors_of(result, truth, few())
    assert errors.count(Standing.RIGHT) == 4
    assert errors.rotations_deg.max() < 0.5
    assert errors.translations_percent.max() < 0.5
    assert result.mesh is not None
    posed = scene.world_from_scan[result.components[0][0]].apply(result.mesh.vertices)
    surface = scene.mesh.vertices[scene.mesh.faces].mean(axis=1)
    apart = KDTree(surface).query(posed)[0]
    assert np.median(apart) < 0.015 * 210 and len(result.mesh.faces) > 1000
    every = list(combinations(sorted(result.poses), 2))
    assert [(pair.i, pair.j) for pair in result.pairs] == every
    for pair in result.pairs:
        if pair.accepted:
            assert pair.i_from_j is not None
            said = result.poses[pair.i].inverse() @ result.poses[pair.j]
            assert (said.inverse() @ pair.i_from_j).angle_deg() < 5
            assert pair.i in result.scans[pair.j].edges
        else:
            assert pair.reason
    assert {"prepare", "pairs", "graph", "refine", "fuse"} <= set(result.stages)
    assert all(stage.counts for stage in result.stages.values())


@pytest.mark.slow
def test_workers_order_and_names_do_not_change_a_byte():
    """Two workers, four scans reversed, renamed so that their order by name turns round too."""
    result, _ = few_run()
    renamed = {scan.name: f"view_{9 - k}" for k, scan in enumerate(few())}
    again = run([replace(s, name=renamed[s.name]) for s in few()[::-1]], workers=2)
    assert again.verdict is result.verdict
    for name, pose in result.poses.items():
        assert again.poses[renamed[name]].matrix().tobytes() == pose.matrix().tobytes()
    assert again.components == tuple(tuple(renamed[n] for n in c) for c in result.components)
    assert mesh_bytes(again) == mesh_bytes(result)


@pytest.mark.slow
def test_pairs_are_registered_once_whatever_scans_are_added(monkeypatch: pytest.MonkeyPatch):
    scans, (whole, memory), edges = few(), few_run(), []
    register = registrar.search_quickly

    def counted(problem: PairProblem, *arguments: Any) -> PairResult:
        edges.append(problem.edge)
        return register(problem, *arguments)

    monkeypatch.setattr(registrar, "search_quickly", counted)
    kept = memory.num_put
    again = run(scans[::-1], cache=memory)
    assert not edges and memory.num_put == kept >= 6
    assert mesh_bytes(whole) == mesh_bytes(again)
    for name, pose in whole.poses.items():
        assert again.poses[name].matrix().tobytes() == pose.matrix().tobytes()
    memory = Memory()
    run(scans[:2], cache=memory)
    assert len(edges) == 1
    run(scans[:3], cache=memory)
    assert len(edges) == 3


@pytest.mark.slow
def test_another_unit_changes_nothing_but_the_unit():
    near, far = run(few()[:3], cache=few_run()[1]), run([scaled(scan, 1e3) for scan in few()[:3]])
    assert far.verdict is near.verdict is Verdict.GOOD
    first = near.components[0][0]
    for name in near.poses:
        a, b = (result.poses[first].inverse() @ result.poses[name] for result in (near, far))
        np.testing.assert_allclose(b.rotation, a.rotation, atol=1e-3)
        np.testing.assert_allclose(b.translation, 1000 * a.translation, atol=1000 * 0.3)


# What does not belong


@pytest.mark.slow
def test_two_objects_become_two_components_and_a_scan_of_something_else_is_left_out():
    other = creature_scene(6, pixels=170, noise=MILD_NOISE, seed=4, object_seed=5)
    theirs = [replace(scan, name=f"other_{k}") for k, scan in enumerate(other.scans[:2])]
    mine, stranger = few()[:3], replace(primitive_scene("box").scans[0], name="stranger")
    result = run([*theirs, *mine, stranger], cache=few_run()[1])
    assert len(result.components) == 2 and set(result.unplaced) == {"stranger"}
    assert result.verdict is Verdict.PARTIAL and result.verdict.exit_code == 3
    truths = (
        {s.name: creature().world_from_scan[s.name] for s in mine},
        {f"other_{k}": other.world_from_scan[s.name] for k, s in enumerate(other.scans[:2])},
    )
    for scans, truth in zip((mine, theirs), truths, strict=True):
        (component,) = (c for c in result.components if c[0] in truth)
        assert set(component) <= set(truth)
        poses = {name: result.poses[name] for name in component}
        part = replace(result, poses=poses, components=(component,))
        assert errors_of(part, truth, scans).count(Standing.RIGHT) == len(scans)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "cylinder"])
def test_of_objects_that_slide_nothing_is_asserted(name: str):
    result = run(primitive_scene(name, pixels=60).scans[:2])
    assert result.verdict is Verdict.NOTHING
    assert not result.poses and result.mesh is None
    assert len(result.unplaced) == 2


@pytest.mark.slow
def test_a_scan_of_another_scale_is_doubtful_and_part_of_the_model_only_if_asked_for():
    """Of six scans the third one is too large; what only it saw is what the model grows by."""
    noise = NoiseModel(depth_diameters=5e-4)
    scans = list(creature_scene(6, noise=noise, seed=3).scans)
    scans[2] = scaled(scans[2], 1.015)
    memory, results = Memory(), []
    for asked in (False, True):
        fusion = FusionConfig(max_voxels_across=80, with_doubtful=asked)
        config = CONFIG.model_copy(update={"fusion": fusion})
        results.append(pipeline.run(scans, config, workers=1, cache=memory))
    without, with_it = results
    accused = {name for name, scan in without.scans.items() if "times too" in scan.reason}
    assert accused == {"scan_03"} <= set(without.poses)
    assert without.scans["scan_03"].verdict is ScanVerdict.DOUBTFUL
    accused_of = without.scans["scan_03"].doubts
    assert "times too large" in without.scans["scan_03"].reason == accused_of[0].text
    assert accused_of[0].code == "scale" and not without.scans["scan_01"].doubts
    assert without.verdict is Verdict.DOUBTFUL
    assert without.reasons[0].startswith("doubtful: scan_03")
    assert without.reasons[0].endswith(" (placed, but left out of the model)")
    assert without.mesh is not None and with_it.mesh is not None
    assert "left out" not in with_it.reasons[0]
    assert len(with_it.mesh.faces) > 1.02 * len(without.mesh.faces)
    for name, pose in without.poses.items():
        np.testing.assert_array_equal(pose.matrix(), with_it.poses[name].matrix())


@pytest.mark.slow
def test_where_all_scans_are_doubtful_there_is_a_preview_and_no_model(tmp_path: Path):
    strict = CONFIG.model_copy(update={"confidence": ConfidenceConfig(min_good=1.0)})
    good, memory = few_run()
    result = pipeline.run(few(), strict, workers=1, cache=memory)
    assert {scan.verdict for scan in result.scans.values()} == {ScanVerdict.DOUBTFUL}
    assert {d.code for scan in result.scans.values() for d in scan.doubts} == {"confidence"}
    assert result.mesh is None and result.verdict is Verdict.DOUBTFUL and good.preview is None
    assert result.preview is not None and good.mesh is not None
    np.testing.assert_array_equal(result.preview.vertices, good.mesh.vertices)
    assert result.reasons[1:] == (
        "no model: all scans that it would be made of are doubtful",
        "preview.ply shows how the doubtful scans lie; it is no model",
    )
    write_outputs(result, tmp_path)
    assert not (tmp_path / "model.ply").exists()
    head = (tmp_path / "preview.ply").read_bytes().split(b"end_header")[0].decode()
    assert "comment preview of doubtful scans, not a model" in head
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["preview"]
    assert "preview.ply shows how the doubtful" in write_html_report(tmp_path).read_text("utf-8")
    told = summary(result, tmp_path)
    assert "no model: all of its scans are doubtful; preview.ply shows" in told
    assert "preview.ply (" in told.splitlines()[-1] and "model.ply" not in told
    wanted = Wanted(poses=[PoseFormat.OPEN3D], model=[MeshFormat.STL])
    (line,) = export(tmp_path, tmp_path / "out", wanted).left_out
    assert line.startswith("left out model.stl: ") and "preview.ply is of doubtful" in line
    asked = strict.model_copy(
        update={"fusion": FusionConfig(max_voxels_across=60, with_doubtful=True)}
    )
    result = pipeline.run(few(), asked, workers=1, cache=memory)
    assert result.mesh is not None and result.preview is None


def test_a_model_that_cannot_be_fused_is_not_passed_over(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object, **__: object) -> None:
        raise InputError("no surface")

    monkeypatch.setattr(steps, "fuse", refuse)
    result = run(few()[:2])
    assert len(result.poses) == 2 and result.mesh is None
    assert result.verdict is Verdict.PARTIAL
    assert result.reasons == ("the placed scans could not be fused into a model",)


def test_a_scan_in_another_unit_is_named():
    scans = list(few()[:3])
    scans[2] = replace(scaled(scans[2], 0.001), name="in_metres")
    result = run(scans)
    assert "smaller" in result.unplaced["in_metres"] and "m and mm" in result.unplaced["in_metres"]
    assert len(result.poses) == 2 and result.verdict is Verdict.PARTIAL


def test_a_duplicate_and_what_could_not_be_read_are_named():
    scans = list(few()[:2])
    result = run([replace(scans[0], name="zz_copy"), *scans])
    assert result.unplaced == {"zz_copy": "same content as scan_01, which is kept"}
    assert set(result.poses) == {"scan_01", "scan_02"}
    scans = few()[:2]
    result = pipeline.run(scans, CONFIG, unreadable={"broken": "the file ends early"}, workers=1)
    assert result.unplaced == {"broken": "the file ends early"}
    assert result.scans["broken"].verdict is ScanVerdict.UNPLACED
    assert result.verdict is Verdict.PARTIAL


def test_fewer_than_two_usable_scans_are_an_error():
    (scan,) = few()[:1]
    dots = RangeScan(name="dots", points=60 * np.random.default_rng(0).normal(size=(10, 3)))
    copy = replace(scan, name="copy")
    for scans in ([], [scan], [scan, copy], [scan, dots]):
        with pytest.raises(InputError) as raised:
            pipeline.run(scans, CONFIG, workers=1)
        told = str(raised.value)
        assert "at least 2" in told and len(told.splitlines()) == 1
    with pytest.raises(InputError, match=r"dots: a scan of 10 points"):
        pipeline.run([scan, dots], CONFIG, workers=1)
    scans = [replace(scan, name="same") for scan in few()[:2]]
    with pytest.raises(InputError, match="same name"):
        pipeline.run(scans, CONFIG)
