"""Captures are recognised by their files, and read alike whatever their layout."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanweld.app import job
from scanweld.errors import InputError, ReadError, ScanweldError
from scanweld.geometry.scan import RangeScan
from scanweld.io.depth.capture import DepthImages, DepthOptions, as_named
from scanweld.io.depth.layouts.registry import layout_rows, layouts_markdown
from scanweld.io.poses import PoseSet
from scanweld.knowledge.facts import Knowledge
from tests.command_line import error_line, scanweld
from tests.scenes import random_motion
from tests.test_depth import CAMERA, DEPTH, TEXT, TRUE, matrix, put, rotated, stored

RNG = np.random.default_rng(7)
POSES = [random_motion(RNG, 1.0) for _ in range(2)]
"""world_from_camera of two frames, in metres."""
COLORS = RNG.integers(0, 256, (60, 80, 3)).astype(np.uint8)
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""From a camera with y down to one with y up."""


def text(folder: Path, name: str, content: object) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))


def rows(matrix: np.ndarray) -> str:
    return "\n".join(" ".join(map(repr, row.tolist())) for row in matrix)


def open3d(folder: Path) -> None:
    for k in range(2):
        put(folder / "depth" / f"{k:06d}.png", stored(1000))
        put(folder / "color" / f"{k:06d}.png", COLORS)
    text(folder, "camera_intrinsic.json", {"intrinsic_matrix": matrix("F")})
    lines = [f"{k} {k} {k + 1}\n{rows(pose.matrix())}" for k, pose in enumerate(POSES)]
    text(folder, "trajectory.log", "\n".join(lines) + "\n")


def tum(folder: Path) -> None:
    for k in range(2):
        put(folder / "depth" / f"{k}.500000.png", stored(5000))
        put(folder / "rgb" / f"{k}.510000.png", COLORS)
    text(folder, "depth.txt", "# time file\n0.5 depth/0.500000.png\n1.5 depth\\1.500000.png\n")
    text(folder, "rgb.txt", "0.51 rgb/0.510000.png\n1.51 rgb\\1.510000.png\n3.0 rgb/gone.png\n")
    lines = ["# time tx ty tz qx qy qz qw", "0.1 0 0 0 0 0 0 1"]
    for time, pose in zip((0.495, 1.505), POSES, strict=True):
        numbers = [*pose.translation, *Rotation.from_matrix(pose.rotation).as_quat()]
        lines.append(f"{time} {' '.join(map(repr, map(float, numbers)))}")
    text(folder, "groundtruth.txt", "\n".join(lines))
    text(folder, "intrinsics.txt", TEXT)


def seven_scenes(folder: Path) -> None:
    for k, pose in enumerate(POSES):
        put(folder / f"frame-{k:06d}.depth.png", stored(1000, nothing=65535))
        put(folder / f"frame-{k:06d}.color.png", COLORS)
        text(folder, f"frame-{k:06d}.pose.txt", rows(pose.matrix()))
    text(folder, "camera-intrinsics.txt", TEXT)


def apc(folder: Path) -> None:
    told = "# Color camera intrinsic matrix\n90.5 0 39.5\n0 91.25 28.75\n0 0 1\n"
    for k, pose in enumerate(POSES):
        put(folder / f"frame-{k:06d}.depth.png", rotated(stored(10_000)))
        put(folder / f"frame-{k:06d}.color.png", COLORS)
        head = f"# Camera-to-world extrinsic matrix (camera pose) for frame-{k:06d}"
        told += f"\n{head}\n {rows(pose.matrix())}\n"
    text(folder, "cam.info.txt", told)


def bop(folder: Path, objects: int = 1) -> None:
    cameras, poses = {}, {}
    for k, pose in enumerate(POSES):
        scale = 0.1 * (k + 1)  # another one for each image
        put(folder / "depth" / f"{k:06d}.png", stored(round(1000 / scale)))
        put(folder / "rgb" / f"{k:06d}.png", COLORS)
        for n in range(objects):
            put(folder / "mask_visib" / f"{k:06d}_{n:06d}.png", np.full((60, 80), 255, np.uint8))
        back = pose.inverse()
        turn, shift = back.rotation.ravel().tolist(), (1000 * back.translation).tolist()
        cameras[str(k)] = {"cam_K": matrix("C"), "depth_scale": scale}
        if objects > 1:
            cameras[str(k)] |= {"cam_R_w2c": turn, "cam_t_w2c": shift}
        poses[str(k)] = [{"obj_id": 5, "cam_R_m2c": turn, "cam_t_m2c": shift}] * objects
    text(folder, "scene_camera.json", cameras)
    text(folder, "scene_gt.json", poses)


def bop_of_several(folder: Path) -> None:
    bop(folder, objects=2)


def doubled() -> dict[str, float]:
    """The camera of a colour image of twice the size."""
    size = {"width": 160, "height": 120, "fx": 2 * CAMERA.fx, "fy": 2 * CAMERA.fy}
    return size | {"cx": 2 * CAMERA.cx + 0.5, "cy": 2 * CAMERA.cy + 0.5}


def record3d(folder: Path) -> None:
    poses = []
    for k, pose in enumerate(POSES):
        put(folder / "depth" / f"{k}.npy", stored(1, np.float64, np.nan))
        put(folder / "rgb" / f"{k}.png", COLORS.repeat(2, axis=0).repeat(2, axis=1))
        up = pose.matrix() @ FLIP
        poses.append([*Rotation.from_matrix(up[:3, :3]).as_quat().tolist(), *up[:3, 3].tolist()])
    c = doubled()
    k_matrix = [c["fx"], 0, 0, 0, c["fy"], 0, c["cx"], c["cy"], 1]
    told = {"K": k_matrix, "w": 160, "h": 120, "poses": poses}
    text(folder, "metadata.json", told)


def polycam(folder: Path) -> None:
    for k, pose in enumerate(POSES):
        put(folder / "keyframes" / "depth" / f"{k}7.png", stored(1000))
        image = COLORS.repeat(2, axis=0).repeat(2, axis=1)
        put(folder / "keyframes" / "images" / f"{k}7.png", image)
        up = pose.matrix() @ FLIP
        told = {f"t_{i}{j}": up[i, j] for i in range(3) for j in range(4)}
        text(folder, f"keyframes/cameras/{k}7.json", doubled() | told)
    text(folder, "raw.glb", "a mesh of it all")


MADE: dict[str, Callable[[Path], None]] = {
    "Open3D": open3d,
    "TUM": tum,
    "7-Scenes": seven_scenes,
    "APC": apc,
    "BOP": bop,
    "BOP ": bop_of_several,
    "Record3D": record3d,
    "Polycam": polycam,
}


def scans_of(folder: Path, **options: object) -> list[RangeScan]:
    images = DepthImages(inputs=[folder], options=DepthOptions(**options))  # type: ignore[arg-type]
    return [frame.read() for frame in images.collect()]


@pytest.mark.parametrize("name", MADE)
def test_every_layout_gives_the_same_points_poses_and_colours(name: str, tmp_path: Path):
    MADE[name](tmp_path)
    assert isinstance(as_named([tmp_path], DepthOptions()), DepthImages)
    scans = scans_of(tmp_path)
    assert len(scans) == 2
    for scan, pose in zip(scans, POSES, strict=True):
        np.testing.assert_allclose(scan.points, TRUE.points, rtol=1e-6)
        assert scan.camera is not None and TRUE.camera is not None
        for key in ("fx", "fy", "cx", "cy"):
            assert getattr(scan.camera, key) == pytest.approx(getattr(TRUE.camera, key))
        assert scan.world_from_scan is not None
        assert (scan.world_from_scan.inverse() @ pose).angle_deg() < 1e-4
        np.testing.assert_allclose(scan.world_from_scan.translation, pose.translation, atol=1e-9)
        told = " ".join(scan.notes)
        assert f"{name.strip()} layout, with a pose" in told and "never just believed" in told
        if name == "7-Scenes":
            assert scan.colors is None and "another camera's view" in told
        else:
            np.testing.assert_array_equal(scan.colors, COLORS[np.isfinite(DEPTH)])
        assert ("masks of several objects" in told) == (name == "BOP ")
        assert ("cut to its mask" in told) == (name == "BOP")


def test_exr_is_read_with_its_library(tmp_path: Path):
    library = pytest.importorskip("OpenEXR")
    record3d(tmp_path)
    head = {"type": library.scanlineimage}
    for path in sorted((tmp_path / "depth").iterdir()):
        values = np.load(path).astype(np.float32)
        library.File(head, {"R": values}).write(str(path.with_suffix(".exr")))
        path.unlink()
    np.testing.assert_allclose(scans_of(tmp_path)[1].points, TRUE.points, rtol=1e-6)
    (tmp_path / "depth" / "0.exr").write_bytes(b"torn")
    with pytest.raises(ReadError, match="cannot be read as EXR"):
        scans_of(tmp_path)


def test_images_named_one_by_one_get_what_their_layout_knows(tmp_path: Path):
    bop(tmp_path)
    (frame,) = DepthImages(inputs=[tmp_path / "depth" / "000001.png"]).collect()
    np.testing.assert_allclose(frame.read().points, TRUE.points, rtol=1e-6)
    assert frame.world_from_scan is not None


def test_one_of_several_objects_is_chosen_by_a_pattern(tmp_path: Path):
    bop_of_several(tmp_path)
    put(
        tmp_path / "mask_visib" / "000000_000001.png", (np.arange(80) < 40) * np.ones((60, 1), bool)
    )
    scans = scans_of(tmp_path, masks=tmp_path / "mask_visib" / "*_000001.png")
    assert len(scans[0].points) < len(TRUE.points) == len(scans[1].points)
    with pytest.raises(InputError, match="2 of 2 depth images have not exactly one mask"):
        scans_of(tmp_path, masks=tmp_path / "mask_visib")


def test_the_rows_of_the_table_are_the_modules(tmp_path: Path):
    assert len(layout_rows()) == len({key.strip() for key in MADE})
    for row in layout_rows():
        assert all(row) and "|" not in "".join(row)
    page = (Path(__file__).parents[1] / "docs" / "depth.md").read_text(encoding="utf-8")
    assert layouts_markdown() in page, layouts_markdown()


def test_broken_poses_are_none_and_said(tmp_path: Path):
    seven_scenes(tmp_path)
    text(tmp_path, "frame-000000.pose.txt", " ".join(["nan"] * 16))
    first, second = scans_of(tmp_path)
    assert first.world_from_scan is None and "without a pose" in " ".join(first.notes)
    assert second.world_from_scan is not None
    open3d(tmp_path / "o")
    text(tmp_path, "o/metadata.json", {"device": "of no other layout"})
    text(tmp_path, "o/trajectory.log", f"0 0 1\n{rows(np.eye(4))}")
    scans = scans_of(tmp_path / "o")
    assert all("not one pose for each" in " ".join(scan.notes) for scan in scans)


@pytest.mark.parametrize("name", ["TUM", "7-Scenes", "BOP", "Polycam"])
def test_images_that_a_layout_lists_and_that_are_gone_are_told(name: str, tmp_path: Path):
    MADE[name](tmp_path)
    assert not any("not there" in note for scan in scans_of(tmp_path) for note in scan.notes)
    depths = [p for p in tmp_path.rglob("*.png") if "depth" in str(p.relative_to(tmp_path))]
    gone = min(depths)
    gone.unlink()
    (left,) = scans_of(tmp_path, color=Path("none"))
    (told,) = [note for note in left.notes if "lists images that are not there: " in note]
    number = told.rsplit(": ", 1)[1].split(".")[0].removeprefix("frame-")
    assert int(number) == int(gone.name.split(".")[0].removeprefix("frame-"))


def test_the_poses_of_a_layout_are_tried_and_what_came_of_them_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    told: list[Knowledge] = []

    def run(scans: list[RangeScan], *_: object, knowledge: Knowledge, **more: object) -> object:
        told.append(knowledge)
        raise InputError("enough")

    monkeypatch.setattr(job.pipeline, "run", run)
    apc(tmp_path / "apc")
    given = PoseSet(poses={"frame-000000": POSES[1]}, components=(("frame-000000",),))
    for known in (None, Knowledge(turntable=True), Knowledge(start=given)):
        with pytest.raises(InputError, match="enough"):
            images = DepthImages(inputs=[tmp_path / "apc"])
            job.run_job(images, tmp_path / "out", knowledge=known)
    starts = [each.start for each in told]
    assert starts[2] is given and told[1].turntable
    for start in starts[:2]:
        assert start is not None and start.components == (("frame-000000", "frame-000001"),)
        np.testing.assert_allclose(start.poses["frame-000001"].matrix(), POSES[1].matrix())


def test_poses_that_are_all_the_same_are_not_used(tmp_path: Path):
    seven_scenes(tmp_path)
    for k in range(2):
        text(tmp_path, f"frame-{k:06d}.pose.txt", rows(POSES[0].matrix()))
    for scan in scans_of(tmp_path):
        assert scan.world_from_scan is None and "all poses of the capture" in " ".join(scan.notes)


def test_usual_cameras_are_taken_where_no_file_has_one(tmp_path: Path):
    values = np.full((480, 640), 800, np.uint16)
    put(tmp_path / "frame-000000.depth.png", values)
    text(tmp_path, "frame-000000.pose.txt", rows(np.eye(4)))
    (scan,) = scans_of(tmp_path)
    assert scan.camera is not None and (scan.camera.fx, scan.camera.cx) == (585, 320)
    assert any("no file of intrinsics" in note for note in scan.notes)
    put(tmp_path / "frame-000000.depth.png", values[:240])
    with pytest.raises(ReadError, match="has 640 x 240 pixels, the intrinsics are for 640 x 480"):
        scans_of(tmp_path)


def test_colours_of_another_size_are_left_out_and_said(tmp_path: Path):
    open3d(tmp_path)
    put(tmp_path / "color" / "000001.png", COLORS[:40])
    first, second = scans_of(tmp_path)
    assert first.colors is not None and second.colors is None
    assert any("not aligned to the depths" in note for note in second.notes)
    assert scans_of(tmp_path, color=Path("none"))[0].colors is None


def without_color(folder: Path) -> None:
    open3d(folder)
    (folder / "color" / "000001.png").unlink()


def of_another_name(folder: Path) -> None:
    bop(folder)
    (folder / "rgb" / "000001.png").rename(folder / "rgb" / "000007.png")


def of_two(folder: Path) -> None:
    bop(folder)
    text(folder, "depth.txt", "")


def packed(folder: Path) -> None:
    record3d(folder)
    (folder / "depth").rename(folder / "rgbd")


def turned(folder: Path) -> None:
    record3d(folder)
    for k in range(2):
        put(folder / "depth" / f"{k}.npy", stored(1, np.float64, np.nan).T)


def beside_a_mesh(folder: Path) -> None:
    open3d(folder)
    text(folder, "a.xyz", "0 0 0\n")


def unlisted(folder: Path) -> None:
    bop(folder)
    put(folder / "depth" / "000009.png", stored(1000))


def without_images(folder: Path) -> None:
    tum(folder)
    for path in (folder / "depth").iterdir():
        path.unlink()


BAD: dict[str, tuple[Callable[[Path], None], str]] = {
    "counts differ": (without_color, "1 colour images for 2 depth images"),
    "a partner is missing": (of_another_name, "1 of 2 depth images have no colour image"),
    "two layouts": (of_two, "has the files of BOP"),
    "packed depths": (packed, "export EXR + RGB from the app"),
    "another view": (turned, "they do not show the same view"),
    "other scans": (beside_a_mesh, "and other scans, such as a.xyz"),
    "no camera": (unlisted, "has no camera of it"),
    "no images": (without_images, "holds no depth images"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_captures_end_with_one_line_and_nothing_written(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    make, says = BAD[name]
    make(tmp_path / "capture")
    for command in (["info"], ["run", "-o", tmp_path / "out", "--no-cache", "-q"]):
        assert scanweld(*command, tmp_path / "capture") == 1
        assert says in error_line(capsys)
        assert not (tmp_path / "out").exists()


def test_color_names_a_folder(tmp_path: Path):
    open3d(tmp_path)
    (tmp_path / "color").rename(tmp_path / "photos")
    for k in range(2):
        name = tmp_path / "photos" / f"{k:06d}.png"
        name.rename(name.with_name(f"{k:06d}.color.png"))
    for scan in scans_of(tmp_path, color=tmp_path / "photos"):
        np.testing.assert_array_equal(scan.colors, COLORS[np.isfinite(DEPTH)])
    (tmp_path / "photos" / "000001.color.png").unlink()
    with pytest.raises(InputError, match="1 of 2 depth images have no colour image"):
        scans_of(tmp_path, color=tmp_path / "photos")
    with pytest.raises(InputError, match="is no folder"):
        scans_of(tmp_path, color=tmp_path / "none such")


def test_damaged_files_of_layouts_are_refused_in_one_line(tmp_path: Path):
    rng = np.random.default_rng(11)
    for name, make in MADE.items():
        folder = tmp_path / name.strip()
        make(folder)
        files = [path for path in folder.rglob("*") if path.suffix in (".json", ".txt", ".log")]
        for path in files:
            whole = path.read_bytes()
            for _ in range(8):
                damaged = bytearray(whole[: rng.integers(len(whole) + 1)])
                for at in rng.integers(0, max(1, len(damaged)), 3) if damaged else ():
                    damaged[at] = rng.integers(32, 127)
                path.write_bytes(bytes(damaged))
                try:
                    scans_of(folder)
                except ScanweldError as error:
                    assert "\n" not in str(error)
            path.write_bytes(whole)
