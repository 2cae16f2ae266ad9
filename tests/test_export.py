"""``scanweld export`` and ``scanweld fuse`` as users meet them."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from scanweld.app import fuse as fuse_module
from scanweld.app import job
from scanweld.errors import ReadError
from scanweld.evaluation.primitives import box
from scanweld.evaluation.views import view_of
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.io import (
    PoseSet,
    read_mesh,
    read_poses,
    read_scan,
    write_mesh_ply,
    write_poses,
    write_scan_ply,
)
from scanweld.io.ply_body import decode_body
from scanweld.io.ply_header import parse_header
from scanweld.io.pose_formats import FORMATS, Frame, match_poses, read_any_poses
from tests.command_line import COARSE, error_line, scanweld
from tests.results import stub_run
from tests.scenes import Scene, primitive_scene, scene_of, write_scans

pytestmark = pytest.mark.slow

NAMES = ["scan_01", "scan_02", "scan_03", "scan_04"]
EVERY_POSE = [word for form in FORMATS for word in ("--poses", form)]
FUSE = ("fuse", "scans", "--config", "coarse.toml")


@pytest.fixture(scope="session")
def scene() -> Scene:
    return primitive_scene("box", pixels=70.0)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def model(scene: Scene) -> Path:
    """A model in the folder ``model`` of scans in the folder ``scans``."""
    return model_of(scene)


def model_of(scene: Scene) -> Path:
    write_scans(Path("scans"), scene.scans)
    Path("coarse.toml").write_text(COARSE)
    folder = Path("model")
    folder.mkdir()
    poses = scene.world_from_scan
    write_poses(folder / "poses.json", PoseSet(poses=poses, components=(tuple(poses),)))
    write_mesh_ply(folder / "model.ply", scene.mesh)
    files = {name: {"file": f"../scans/{name}.ply"} for name in poses}
    (folder / "report.json").write_text(json.dumps({"format": 1, "scans": files}))
    (folder / "config.toml").write_text("unit = 'mm'\n")
    return folder


def snapshot() -> dict[str, bytes | None]:
    return {str(p): p.read_bytes() if p.is_file() else None for p in sorted(Path().rglob("*"))}


def points_of(path: Path) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    data = path.read_bytes()
    header = parse_header(path, data)
    vertex = decode_body(header, data)["vertex"]
    points = np.stack([np.asarray(vertex[key]) for key in "xyz"], axis=1)
    return points, np.asarray(vertex["scan"]), header.comments


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


def far_away(scene: Scene, far: np.ndarray) -> Scene:
    """The same scans, each in map coordinates of its own, in a world of such coordinates."""

    def moved(pose: Pose) -> Pose:
        return Pose(rotation=pose.rotation, translation=pose.translation + far)

    to_near = Pose(rotation=np.eye(3), translation=-far)
    return dataclasses.replace(
        scene,
        mesh=dataclasses.replace(scene.mesh, vertices=scene.mesh.vertices + far),
        scans=tuple(
            dataclasses.replace(
                scan, points=scan.points + far, scan_from_sensor=moved(scan.sensor_pose)
            )
            for scan in scene.scans
        ),
        views=tuple(
            dataclasses.replace(view, world_from_sensor=moved(view.world_from_sensor))
            for view in scene.views
        ),
        world_from_scan={
            name: moved(pose @ to_near) for name, pose in scene.world_from_scan.items()
        },
    )


@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_map_coordinates_are_kept_by_every_format(
    scene: Scene, scale: float, capsys: pytest.CaptureFixture[str]
):
    """To a millionth of the diameter, and about a local origin where programs need that."""
    size = float(np.linalg.norm(np.ptp(scene.mesh.vertices, axis=0)))
    far = scale * size * np.array([450_000.3, -5_400_000.7, 0.0])
    scene = far_away(scene, far)
    model = model_of(scene)
    models = [word for form in ("ply", "obj", "stl", "glb") for word in ("--model", form)]
    assert scanweld("export", model, *EVERY_POSE, *models, "--points", "all.ply", "-o", "out") == 0
    (_, note) = capsys.readouterr().out.splitlines()
    told, shift = note.split(" are about a local origin, for the world lies far off: add ")
    assert set(told.removeprefix("note: ").split(", ")) == {
        *("model.ply", "model.obj", "model.stl", "all.ply"),
        *("poses.tum.txt", "colmap/images.txt", "transforms.json"),
    }
    shift = np.array([float(word) for word in shift.split()])
    assert shift[2] == 0 and np.abs(far - shift).max() < 10 * size
    triangles = scene.mesh.vertices[scene.mesh.faces]
    for form in ("ply", "obj", "stl"):
        again = read_mesh(Path(f"out/model.{form}"))
        assert np.abs(again.vertices[again.faces] - triangles).max() < 1e-6 * size, form
        other = trimesh.load(f"out/model.{form}", process=False, maintain_order=True)
        assert isinstance(other, trimesh.Trimesh)
        assert np.abs(other.triangles + shift - triangles).max() < 1e-6 * size, form
    assert np.array_equal(read_mesh("out/model.ply").vertices, scene.mesh.vertices)
    assert np.array_equal(read_mesh("out/model.obj").vertices, scene.mesh.vertices)
    placed = trimesh.load("out/model.glb", process=False, force="mesh")  # moved with its node
    assert isinstance(placed, trimesh.Trimesh)
    assert np.abs(1000.0 * placed.triangles - triangles).max() < 1e-6 * size
    posed = [scene.world_from_scan[s.name].apply(s.points) for s in scene.scans]
    assert np.abs(read_scan("out/all.ply").points - np.concatenate(posed)).max() < 1e-6 * size
    files = ("poses.conf", "poses.mlp", "poses.aln", "poses.tum.txt", "posegraph.json")
    for name in (*files, "transforms.json", "colmap/images.txt", "colmap", "cloudcompare"):
        found = read_any_poses(Path("out") / name)
        poses = match_poses(Path(name), found, NAMES)
        for scan, points in zip(scene.scans, posed, strict=True):
            pose = poses[scan.name]
            if found.frame is Frame.SENSOR:
                pose = pose @ scan.sensor_pose.inverse()
            assert np.abs(pose.apply(scan.points) - points).max() < 1e-6 * size, name


@pytest.mark.parametrize("name", ["poses.tum.txt", "transforms.json", "model.obj"])
def test_a_broken_shift_is_said(scene: Scene, name: str):
    size = float(np.linalg.norm(np.ptp(scene.mesh.vertices, axis=0)))
    model = model_of(far_away(scene, size * np.array([1e5, 0.0, 0.0])))
    form = [*("--poses", "tum"), *("--poses", "nerfstudio"), *("--model", "obj")]
    assert scanweld("export", model, *form, "-o", "out") == 0
    text = (Path("out") / name).read_text(encoding="utf-8")
    key = "shift" if name.endswith("json") else "scanweld_shift"
    broken = text.replace(f'"{key}": [', '"shift": ["x",').replace(f"{key} ", f"{key} x")
    assert broken != text
    Path(name).write_text(broken, encoding="utf-8")
    with pytest.raises(ReadError, match=f"its {key} is not three numbers"):
        (read_mesh if name.endswith("obj") else read_any_poses)(Path(name))


def check(path: Path, scene: Scene) -> None:
    """The poses in a file are those of the scene."""
    found = read_any_poses(path)
    poses = match_poses(path, found, NAMES)
    for k, scan in enumerate(scene.scans):
        is_scan = found.frame is Frame.SCAN
        want = scene.world_from_scan[scan.name] if is_scan else scene.views[k].world_from_sensor
        assert np.abs(poses[scan.name].matrix() - want.matrix()).max() < 1e-9, path


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
    text = (Path(__file__).parents[1] / "docs/formats.md").read_text(encoding="utf-8")
    assert scanweld("export", model, *EVERY_POSE, "-o", "out") == 0
    names = {path.name for path in Path("out").rglob("*.*")}
    for word in {*FORMATS, "ply", "obj", "stl", "glb"}:
        assert f"| `{word}` |" in text
    for name in {name for name in names if not name.startswith("scan_")}:
        assert name in text, name


# scanweld fuse


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
