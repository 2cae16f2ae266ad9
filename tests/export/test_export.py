"""``scanweld export`` as users meet it."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from scanweld.app import job
from scanweld.evaluation.primitives import box
from scanweld.evaluation.views import view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.io import (
    PoseSet,
    read_mesh,
    read_scan,
    write_mesh_ply,
    write_poses,
    write_scan_ply,
)
from scanweld.io.pose_formats import FORMATS, match_poses, read_any_poses
from tests.command_line import error_line, scanweld
from tests.export.made import EVERY_POSE, NAMES, check, points_of, snapshot
from tests.results import stub_run
from tests.scenes import Scene, scene_of, write_scans

pytestmark = pytest.mark.slow


def test_everything_at_once(model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]):
    models = [word for form in ("ply", "obj", "stl", "glb") for word in ("--model", form)]
    assert scanweld("export", model, *EVERY_POSE, *models, "--points", "all.ply", "-o", "out") == 0
    (line,) = capsys.readouterr().out.splitlines()  # nothing to be noted
    names = [
        path.relative_to("out").as_posix() for path in Path("out").rglob("*") if path.is_file()
    ]
    assert line.startswith("out: ") and set(line[5:].split(", ")) == set(names)
    assert {"poses.mlp", "colmap/cameras.txt", "transforms.json", "model.glb", "all.ply"} < set(
        names
    )
    for name in ("poses.conf", "poses.mlp", "poses.aln", "poses.tum.txt", "posegraph.json"):
        check(Path("out") / name, scene)
    for name in ("transforms.json", "colmap/images.txt", "colmap", "cloudcompare"):
        check(Path("out") / name, scene)
    assert Path("out/model.ply").read_bytes() == (model / "model.ply").read_bytes()
    for form in ("obj", "stl"):
        again = read_mesh(Path(f"out/model.{form}"))
        close = np.abs(again.vertices[again.faces] - scene.mesh.vertices[scene.mesh.faces])
        assert close.max() < 1e-4


def test_colmap_opens_the_model_and_sees_points_where_the_sensors_did(model: Path, scene: Scene):
    pycolmap = pytest.importorskip("pycolmap", exc_type=ImportError)
    assert scanweld("export", model, "--poses", "colmap", "-o", "out") == 0
    opened = pycolmap.Reconstruction("out/colmap")
    images = {image.name: image for image in opened.images.values()}
    for k, scan in enumerate(scene.scans):
        image, view = images[f"{scan.name}.png"], scene.views[k]
        want = view.world_from_sensor.inverse().matrix()[:3]
        assert np.allclose(image.cam_from_world().matrix(), want, atol=1e-9)
        seen = view.world_from_sensor.inverse().apply(
            scene.world_from_scan[scan.name].apply(scan.points[:1])
        )
        pixel = opened.cameras[image.camera_id].img_from_cam(seen[0])
        assert np.allclose(pixel, view.camera.project(seen)[0][0] + 0.5)


def test_files_are_named_as_seen_from_the_poses(model: Path, monkeypatch: pytest.MonkeyPatch):
    assert scanweld("export", model, "--poses", "aln", "-o", "far/away/out") == 0
    lines = Path("far/away/out/poses.aln").read_text(encoding="utf-8").splitlines()
    assert lines[1] == "../../../scans/scan_01.ply"
    assert (Path("far/away/out") / lines[1]).is_file()
    monkeypatch.setattr(job.pipeline, "run", stub_run)
    assert scanweld("run", "scans", "-o", "there/result") == 0
    assert scanweld("export", "there/result", "--poses", "mlp", "-o", "there/out") == 0
    assert "../../scans/scan_01.ply" in Path("there/out/poses.mlp").read_text(encoding="utf-8")


def test_points_lie_together_and_know_their_scan_and_its_colours(
    model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
):
    assert scanweld("export", model, "--points", "merged.ply", "-o", "out") == 0
    points, labels, comments = points_of(Path("out/merged.ply"))
    assert comments == tuple(f"scan {k} = {name}" for k, name in enumerate(NAMES))
    counts = [len(scan.points) for scan in scene.scans]
    assert np.bincount(labels).tolist() == counts
    for k, scan in enumerate(scene.scans):
        assert np.allclose(points[labels == k], scene.world_from_scan[scan.name].apply(scan.points))
    assert read_scan("out/merged.ply").colors is None
    capsys.readouterr()
    scan = read_scan("scans/scan_02.ply")
    red = np.tile(np.array([200, 0, 0], np.uint8), (len(scan.points), 1))
    write_scan_ply("scans/scan_02.ply", dataclasses.replace(scan, colors=red))
    assert scanweld("export", model, "--points", "merged.ply", "-o", "out", "--force") == 0
    (_, note) = capsys.readouterr().out.splitlines()
    assert note.endswith("scan_01, scan_03, scan_04")
    _, labels, _ = points_of(Path("out/merged.ply"))
    colors = read_scan("out/merged.ply").colors
    assert colors is not None
    assert (colors[labels == 1] == [200, 0, 0]).all() and (colors[labels != 1] == 128).all()


def test_unit_of_the_glb(model: Path, capsys: pytest.CaptureFixture[str]):
    assert scanweld("export", model, "--model", "glb", "-o", "known") == 0
    assert "note" not in capsys.readouterr().out
    (model / "config.toml").unlink()
    assert scanweld("export", model, "--model", "glb", "-o", "unknown") == 0
    (_, note) = capsys.readouterr().out.splitlines()
    assert "unit" in note and "--unit" in note
    assert scanweld("export", model, "--model", "glb", "--unit", "mm", "-o", "said") == 0
    assert "note" not in capsys.readouterr().out
    known, unknown, said = (Path(d, "model.glb").read_bytes() for d in ("known", "unknown", "said"))
    assert known == said != unknown
    assert scanweld("export", model, "--model", "glb", "--up", "-z", "-o", "turned") == 0
    assert Path("turned/model.glb").read_bytes() != known


def test_names_that_not_every_system_can_have_are_said(
    model: Path, capsys: pytest.CaptureFixture[str]
):
    names = ["Con", "scan", "Scan", "l" * 251, "l" * 252]
    poses = {name: Pose.identity() for name in names}
    write_poses(model / "poses.json", PoseSet(poses=poses, components=(tuple(names),)))
    assert scanweld("export", model, "--poses", "cloudcompare", "-o", "out") == 3
    told = capsys.readouterr().out
    assert {path.stem for path in Path("out/cloudcompare").iterdir()} == set(names[:4])
    assert "note: cloudcompare/Con.txt: Windows can have no files of such names" in told
    assert re.search(r"note: cloudcompare/[sS]can.txt, cloudcompare/[sS]can.txt: for Windows", told)
    assert f"left out of CloudCompare: {'l' * 252}: cannot be the name of a file" in told


def test_other_components_and_unplaced_scans_are_said(
    model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
):
    poses = {name: scene.world_from_scan[name] for name in NAMES[:3]}
    components = (("scan_01", "scan_02"), ("scan_03",))
    told = PoseSet(poses=poses, components=components, unplaced={"scan_04": "too far"})
    write_poses(model / "poses.json", told)
    assert scanweld("export", model, "--poses", "cloudcompare", "-o", "a") == 0
    (_, first, second) = capsys.readouterr().out.splitlines()
    assert "component 1 of 2" in first and "scan_04" in second
    assert {path.stem for path in Path("a/cloudcompare").iterdir()} == {"scan_01", "scan_02"}
    assert scanweld("export", model, "--poses", "cloudcompare", "--component", "2", "-o", "b") == 0
    assert {path.stem for path in Path("b/cloudcompare").iterdir()} == {"scan_03"}


def test_scans_of_one_file_are_not_posed_by_its_name(
    model: Path, scene: Scene, capsys: pytest.CaptureFixture[str]
):
    texts, files = [], {}
    for k, scan in enumerate(scene.scans):
        head = f"{len(scan.points)}\n1\n" + "0 0 0\n" * 4 + "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
        texts.append(head + "".join(f"{x!r} {y!r} {z!r} 0.5\n" for x, y, z in scan.points.tolist()))
        files[scan.name] = {"file": "../scans/all.ptx", "part": k}
    Path("scans/all.ptx").write_text("".join(texts))
    (model / "report.json").write_text(json.dumps({"format": 1, "scans": files}))
    wanted = ("--poses", "mlp", "--poses", "open3d", "--points", "all.ply", "-o", "out")
    assert scanweld("export", model, *wanted) == 3
    assert "shares its file with other scans" in capsys.readouterr().out
    assert not Path("out/poses.mlp").exists()
    check(Path("out/posegraph.json"), scene)
    points, of_scan, _ = points_of(Path("out/all.ply"))
    for k, scan in enumerate(scene.scans):
        moved = scene.world_from_scan[scan.name].apply(scan.points)
        np.testing.assert_allclose(points[of_scan == k], moved, atol=1e-9)


def test_scans_that_moved_are_found_where_said(model: Path, capsys: pytest.CaptureFixture[str]):
    shutil.move("scans", "moved")
    before = snapshot()
    assert scanweld("export", model, "--poses", "tum", "-o", "out") == 1
    assert "scan_01: its file is not where" in (line := error_line(capsys)) and "--scans" in line
    assert snapshot() == before
    export = ("export", model, "--poses", "tum", "--poses", "conf", "--poses", "open3d")
    assert scanweld(*export, "--model", "stl", "-o", "rest") == 3
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "rest: posegraph.json, model.stl"
    assert told[1].startswith("left out TUM, Stanford .conf: scan_01: its file is not where")
    assert len(told) == 2 and told[1].endswith("(3 more scans likewise)")
    shutil.copytree("moved", "scans")
    Path("scans/scan_03.ply").unlink()
    capsys.readouterr()
    assert scanweld(*export, "--points", "all.ply", "-o", "most") == 3
    (_, line) = capsys.readouterr().out.splitlines()
    assert line.startswith("left out of TUM, Stanford .conf, all.ply: scan_03: its file is not")
    kept = [name for name in NAMES if name != "scan_03"]
    for name in ("poses.tum.txt", "poses.conf"):
        found = read_any_poses(Path("most") / name)
        assert set(match_poses(Path(name), found, kept)) == set(kept)
    told = points_of(Path("most/all.ply"))[2]
    assert told == tuple(f"scan {k} = {name}" for k, name in enumerate(kept))
    assert "scan_03" in Path("most/posegraph.json").read_text(encoding="utf-8")
    assert scanweld("export", model, "--poses", "tum", "-o", "out", "--scans", "moved") == 0
    assert scanweld("export", model, "--poses", "open3d", "-o", "more") == 0  # needs no files


def test_a_sensor_that_is_no_pinhole(model: Path, capsys: pytest.CaptureFixture[str]):
    views = [
        view_of(box(), 90.0 * k, 25, pixels=70, model=CameraModel.ORTHOGRAPHIC) for k in range(4)
    ]
    write_scans(Path("scans"), scene_of(box(), views).scans)
    before = snapshot()
    for form in ("tum", "colmap", "nerfstudio"):
        assert scanweld("export", model, "--poses", form, "-o", "out") == 1
        assert "scan_01: its sensor is orthographic" in error_line(capsys)
    assert snapshot() == before
    for form in ("tum", "colmap", "nerfstudio"):
        assert scanweld("export", model, "--poses", "mlp", "--poses", form, "-o", form) == 3
        told = capsys.readouterr().out.splitlines()
        assert told[0] == f"{form}: poses.mlp" and len(told) == 2
        assert re.match("left out .*: scan_01: its sensor is orthographic", told[1])
        assert told[1].endswith("(3 more scans likewise)")
    Path("tum.txt").write_text("".join(f"{k} 0 0 0 0 0 0 1\n" for k in range(4)))
    assert scanweld("fuse", "scans", "--poses", "tum.txt", "-o", "fused", "-q") == 1
    assert "its sensor is orthographic, and TUM speaks of pinholes only" in error_line(capsys)
    assert not Path("fused").exists()


@pytest.mark.parametrize(
    ("break_it", "arguments", "says"),
    [
        ("", [], "nothing to export"),
        ("", ["--points", "merged.xyz"], "merged.xyz: points are written as PLY"),
        ("", ["--points", "../merged.ply"], "points are written as PLY"),
        ("", ["--points", "model.ply", "--model", "ply"], "is the model's name"),
        ("", ["--poses", "mlp", "--component", "2"], "has no component 2"),
        ("poses.json", ["--model", "glb"], "holds no poses.json"),
        ("model.ply", ["--model", "obj", "--model", "glb"], "holds no model.ply"),
        ("report.json", ["--poses", "conf"], "scan_01: its file is not where"),
        ("config.toml=[pairs", ["--model", "glb"], "config.toml"),
        ("report.json={", ["--poses", "mlp"], "report.json: not valid JSON"),
        ("report.json={}", ["--poses", "mlp"], "report.json: scans: field required"),
        ("poses.json=[]", ["--poses", "mlp"], "poses.json"),
        ('poses.json={"format": 1, "scans": {}}', ["--poses", "mlp"], "no scan is placed"),
        ("no faces", ["--model", "stl"], "has no faces"),
        ("no faces", ["--model", "ply"], "has no faces"),
        ("model.ply=ply", ["--model", "obj"], "model.ply"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    model: Path, break_it: str, arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
):
    name, equals, text = break_it.partition("=")
    if break_it == "no faces":
        bare = TriangleMesh(vertices=np.eye(3), faces=np.zeros((0, 3), np.int64))
        write_mesh_ply(model / "model.ply", bare)
    elif equals:
        (model / name).write_text(text)
    elif name:
        (model / name).unlink()
    before = snapshot()
    assert scanweld("export", model, *arguments, "-o", "out") == 1
    assert says in error_line(capsys)
    assert snapshot() == before


def test_a_missing_model_leaves_the_rest(model: Path, capsys: pytest.CaptureFixture[str]):
    (model / "model.ply").unlink()
    assert scanweld("export", model, "--poses", "mlp", "--model", "glb", "-o", "out") == 3
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "out: poses.mlp"
    assert told[1].startswith("left out model.glb: ") and "holds no model.ply" in told[1]


def test_no_output_is_replaced_unasked_and_no_input_ever(
    model: Path, capsys: pytest.CaptureFixture[str]
):
    for output in (model, Path("scans")):
        before = snapshot()
        assert scanweld("export", model, "--poses", "mlp", "-o", output, "--force") == 1
        assert "holds the input" in error_line(capsys)
        assert snapshot() == before
    Path("full").mkdir()
    Path("full/mine").touch()
    assert scanweld("export", model, "--poses", "mlp", "-o", "full") == 1
    assert "--force" in error_line(capsys)
    assert scanweld("export", model, "--poses", "cloudcompare", "-o", "out") == 0
    capsys.readouterr()
    before = snapshot()
    folder = "out/cloudcompare"
    assert scanweld("fuse", "scans", "--poses", folder, "-o", folder, "-q", "--force") == 1
    assert "holds the input" in error_line(capsys)
    assert snapshot() == before


@pytest.mark.parametrize("option", [["--poses", "fbx"], ["--model", "fbx"], ["--up", "w"]])
def test_an_unknown_format_is_wrong_usage_and_told_the_known(
    model: Path, option: list[str], capsys: pytest.CaptureFixture[str]
):
    assert scanweld("export", model, *option, "-o", "out") == 2
    told = capsys.readouterr().err
    assert repr(option[1]) in told and ("mlp" in told or "glb" in told or "-z" in told)
    assert not Path("out").exists()


def test_every_format_and_file_is_documented(model: Path):
    text = (Path(__file__).parents[2] / "docs/formats.md").read_text(encoding="utf-8")
    assert scanweld("export", model, *EVERY_POSE, "-o", "out") == 0
    names = {path.name for path in Path("out").rglob("*.*")}
    for word in {*FORMATS, "ply", "obj", "stl", "glb"}:
        assert f"| `{word}` |" in text
    for name in {name for name in names if not name.startswith("scan_")}:
        assert name in text, name


@pytest.mark.parametrize("arguments", [["--poses", "mlp"], ["--points", "all.ply"]])
def test_scans_that_have_changed_since_are_left_out(
    model: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]
):
    report = json.loads((model / "report.json").read_text(encoding="utf-8"))
    for name, entry in report["scans"].items():
        entry["content_hash"] = read_scan(Path("scans") / f"{name}.ply", name).content_hash()
    (model / "report.json").write_text(json.dumps(report), encoding="utf-8")
    assert scanweld("export", model, *arguments, "-o", "same") == 0
    capsys.readouterr()
    first, second, third, fourth = (Path("scans") / f"{name}.ply" for name in report["scans"])
    first.write_bytes(second.read_bytes())
    assert scanweld("export", model, *arguments, "-o", "most") == 3
    assert f"{first.stem}: is not the scan that model was made of" in capsys.readouterr().out
    for path in (second, third, fourth):
        shutil.copy(first if path is fourth else fourth, path)
    assert scanweld("export", model, *arguments, "-o", "changed") == 1
    assert f"{first.stem}: is not the scan that model was made of" in error_line(capsys)
    assert not Path("changed").exists()
