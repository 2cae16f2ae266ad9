"""``scanweld fuse`` as users meet it."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from scanweld.app import fuse as fuse_module
from scanweld.evaluation.primitives import box
from scanweld.evaluation.views import view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.io import (
    read_mesh,
    read_poses,
)
from tests.command_line import error_line, scanweld
from tests.export.made import EVERY_POSE, FUSE, NAMES, snapshot
from tests.scenes import Scene, scene_of, write_scans

pytestmark = pytest.mark.slow


def distance_to_truth(scene: Scene, mesh: TriangleMesh) -> float:
    """Share of the diameter within which 95 % of the posed scans' points lie from the mesh."""
    points = np.concatenate([scene.world_from_scan[s.name].apply(s.points) for s in scene.scans])
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    return float(np.quantile(KDTree(mesh.vertices).query(points)[0], 0.95)) / size


def test_known_poses_are_fused_in_their_frame(
    model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
):
    poses = model / "poses.json"
    assert scanweld(*FUSE, "--poses", poses, "-o", "fused", "-q", "--unit", "mm") == 0
    out, err = capsys.readouterr()
    assert "given: all 4 scans are fused" in out and err == ""
    assert distance_to_truth(scene, read_mesh("fused/model.ply")) < 0.03
    assert_true(scene, Path("fused/poses.json"))
    # What fuse makes is a model like any other, but that it says nothing of pairs.
    page = Path("fused/report.html").read_text(encoding="utf-8")
    assert "All 4 scans are fused with the poses that were given." in page
    assert 'id="residuals"' in page and 'id="graph"' not in page and 'id="contours"' not in page
    assert scanweld("report", "fused") == 0
    assert Path("fused/report.html").read_text(encoding="utf-8") == page
    assert scanweld("export", "fused", "--poses", "conf", "--model", "glb", "-o", "again") == 0
    assert (
        Path("again/poses.conf").read_text(encoding="utf-8")
        and "note" not in capsys.readouterr().out
    )


def assert_true(scene: Scene, file: Path) -> None:
    found = read_poses(file).poses
    for name, pose in scene.world_from_scan.items():
        assert np.abs(found[name].matrix() - pose.matrix()).max() < 1e-9


@pytest.mark.parametrize("form", ["poses.tum.txt", "poses.mlp", "transforms.json"])
def test_poses_of_any_format_are_fused_alike(
    model: Path, scene: Scene, form: str, monkeypatch: pytest.MonkeyPatch
):
    """Of a scan or of its sensor, all come down to the same poses; what follows is seen above."""
    posed: list[Pose] = []

    def fused(_: object, poses: list[Pose], *__: object, **___: object) -> TriangleMesh:
        posed.extend(poses)
        return scene.mesh

    monkeypatch.setattr(fuse_module, "fuse", fused)
    monkeypatch.setattr(fuse_module, "write_html_report", lambda *_: None)
    assert scanweld("export", model, *EVERY_POSE, "-o", "out") == 0
    assert scanweld(*FUSE, "--poses", Path("out") / form, "-o", "fused", "-q") == 0
    assert_true(scene, Path("fused/poses.json"))
    for view in scene.views:
        want = view.world_from_sensor.matrix()
        assert min(np.abs(pose.matrix() - want).max() for pose in posed) < 1e-9


def test_scans_without_a_pose_are_left_out_and_named(
    model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
):
    poses = {name: scene.world_from_scan[name].matrix().tolist() for name in NAMES[:3]}
    Path("some.json").write_text(json.dumps(poses))
    assert scanweld(*FUSE, "--poses", "some.json", "-o", "fused", "-q") == 3
    told = capsys.readouterr().out
    assert "partial: 3 of 4 scans" in told and "unplaced scan_04: no pose in some.json" in told
    assert read_poses("fused/poses.json").unplaced == {"scan_04": "no pose in some.json"}
    assert set(read_poses("fused/poses.json").poses) == set(NAMES[:3])


BROKEN = {  # a file of poses -> what stands before a number without which one pose is none
    "poses.json": r'"scan_02": \[\s*\[',
    "poses.conf": r"scan_02.ply \S+ \S+ \S+ ",
    "poses.mlp": r'scan_02.ply" visible="1">\s*<MLMatrix44>\s*',
    "poses.aln": r"scan_02.ply\n#\n",
    "poses.tum.txt": r"\n1 \S+ \S+ \S+ ",
    "colmap/images.txt": r"\n2 ",
    "posegraph.json": r'"pose": \[\s*',
    "cloudcompare/scan_02.txt": "",
    "transforms.json": r'scan_02.png"[^[]*\[\s*\[\s*',
}


@pytest.mark.parametrize("name", BROKEN)
def test_one_broken_matrix_leaves_out_its_scan_alone(
    model: Path, scene: Scene, name: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(fuse_module, "fuse", lambda *_, **__: scene.mesh)
    monkeypatch.setattr(fuse_module, "write_html_report", lambda *_: None)
    assert scanweld("export", model, *EVERY_POSE, "-o", "out") == 0
    shutil.copy(model / "poses.json", "out/poses.json")
    path = Path("out") / name
    text = path.read_text(encoding="utf-8")
    path.write_text(
        re.sub(f"({BROKEN[name]})[-.0-9e]+", r"\g<1>9", text, count=1), encoding="utf-8"
    )
    given = path.parent if "cloudcompare" in name else path
    assert scanweld(*FUSE, "--poses", given, "-o", "fused", "-q") == 3
    found = read_poses("fused/poses.json")
    (left_out,) = found.unplaced
    assert set(found.poses) == set(NAMES) - {left_out}
    assert left_out == ("scan_01" if name == "posegraph.json" else "scan_02")
    assert path.name in found.unplaced[left_out]


def test_a_sensor_of_which_the_poses_cannot_speak_leaves_out_its_scan(
    model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
):
    assert scanweld("export", model, "--poses", "colmap", "-o", "out") == 0
    turned = view_of(box(), 20, 25, pixels=70, model=CameraModel.ORTHOGRAPHIC)
    write_scans(Path("scans"), scene_of(box(), [turned]).scans)
    capsys.readouterr()
    assert scanweld(*FUSE, "--poses", "out/colmap", "-o", "fused", "-q") == 3
    assert "unplaced scan_01: scan_01: its sensor is orthographic" in capsys.readouterr().out
    assert set(read_poses("fused/poses.json").poses) == set(NAMES[1:])


@pytest.mark.parametrize(
    ("poses", "says"),
    [
        ("missing.json", "missing.json: cannot be read"),
        ("prose.txt", "prose.txt: unknown format of poses"),
        ("strange.json", "none of its 1 poses"),
        ("single.json", "1 usable scan"),
        ("three.txt", "3 poses for 4 scans"),
        ("out", "holds no CloudCompare matrices"),
    ],
)
def test_bad_poses_are_one_line_and_nothing_is_written(
    model: Path, poses: str, says: str, capsys: pytest.CaptureFixture[str]
):
    rows = Pose.identity().matrix().tolist()
    Path("prose.txt").write_text("once upon a time\n")
    Path("strange.json").write_text(json.dumps({"x": rows}))
    Path("single.json").write_text(json.dumps({"scan_01": rows}))
    Path("three.txt").write_text("".join(f"{k} 0 0 0 0 0 0 1\n" for k in range(3)))
    Path("out").mkdir()
    before = snapshot()
    assert scanweld("fuse", "scans", "--poses", poses, "-o", "fused", "-q", "--no-cache") == 1
    assert says in error_line(capsys)
    assert snapshot() == before
