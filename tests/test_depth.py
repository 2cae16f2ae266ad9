"""Depth images as scans: whatever form they and their intrinsics have, the points are the same."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scanweld.errors import ReadError, ScanweldError
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io import read_mesh, read_scan
from scanweld.io.depth.capture import DepthImages, DepthOptions, as_named, collect_named
from scanweld.io.depth.intrinsics import Intrinsics, read_intrinsics
from scanweld.io.depth.lens import _through, undistorted
from tests.command_line import COARSE, scanweld
from tests.depth_scans import bumps, scan_of_depth
from tests.scenes import scene_of, small_creature

CAMERA = Camera(
    model=CameraModel.PINHOLE, width=80, height=60, fx=90.5, fy=91.25, cx=39.5, cy=28.75
)
PLAIN = Intrinsics(fx=90.5, fy=91.25, cx=39.5, cy=28.75)
SIZED = Intrinsics(fx=90.5, fy=91.25, cx=39.5, cy=28.75, width=80, height=60)
DEPTH = np.rint(4 * bumps(60, 80, 9)) / 1000
"""Metres, whole millimetres."""
TRUE = scan_of_depth(DEPTH, CAMERA)
RED = (200, 60, 30)
TEXT = "90.5 91.25 39.5 28.75"


def put(path: Path, values: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".npy":
        np.save(path, values)
    elif path.suffix == ".npz":
        np.savez(path, depth=values)
    else:
        Image.fromarray(values).save(path)
    return path


def stored(per_meter: float, dtype: type = np.uint16, nothing: float = 0) -> np.ndarray:
    values = np.where(np.isfinite(DEPTH), DEPTH * per_meter, nothing)
    return (np.rint(values) if np.issubdtype(dtype, np.integer) else values).astype(dtype)


def rotated(values: np.ndarray) -> np.ndarray:
    return ((values << 3) | (values >> 13)).astype(np.uint16)


def capture(folder: Path, values: np.ndarray, name: str = "depth/000.png") -> Path:
    put(folder / name, values)
    (folder / "intrinsics.txt").write_text(TEXT)
    return folder


def read(inputs: Path, **options: object) -> RangeScan:
    (file,) = DepthImages(inputs=[inputs], options=DepthOptions(**options)).collect()  # type: ignore[arg-type]
    return file.read()


@pytest.mark.parametrize(
    ("name", "values", "per_meter"),
    [
        ("a.png", stored(1000), 1000),
        ("a.png", stored(1000, nothing=65535), 1000),
        ("a.tif", stored(1000), 1000),
        ("a.npy", stored(1000)[..., None], 1000),
        ("a.png", stored(5000), 5000),
        ("a.tif", stored(100_000, np.int32), 10_000),
        ("b.png", rotated(stored(1000)), 1000),
        ("a.npz", stored(1, np.float32, np.nan), 1),
        ("a.tiff", stored(1, np.float32), 1),
        ("a.npy", stored(1000, np.float64, np.inf), 1000),
    ],
)
def test_every_form_of_depths_gives_the_same_points(
    name: str, values: np.ndarray, per_meter: float, tmp_path: Path
):
    folder = capture(tmp_path, values, f"depth/{name}")
    scan = read(folder)
    factor = 10.0 if values.dtype == np.int32 else 1.0  # a scene at 8 m
    np.testing.assert_allclose(scan.points, factor * TRUE.points, rtol=1e-6)
    np.testing.assert_array_equal(scan.grid, TRUE.grid)
    assert scan.camera == CAMERA and scan.viewpoint is Viewpoint.GIVEN
    assert any(note.startswith(f"{per_meter:g} depth values") for note in scan.notes)
    assert ("SUN3D" in scan.notes[0]) == (name == "b.png")
    given = read(folder, scale=2.0 * per_meter)
    np.testing.assert_allclose(given.points, factor * TRUE.points / 2, rtol=1e-6)


def matrix(order: str) -> list[float]:
    rows = np.array([[90.5, 0, 39.5], [0, 91.25, 28.75], [0, 0, 1]])
    return rows.flatten(order=order).tolist()  # type: ignore[arg-type]


ROS = """image_width: 80
image_height: 60
camera_matrix:
  rows: 3
  cols: 3
  data: [90.5, 0, 39.5, 0, 91.25,
    28.75, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [%s]}
"""


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (TEXT, PLAIN),
        (f"# fx fy cx cy width height\n{TEXT} 80 60\n", SIZED),
        (f"{TEXT.replace(' ', ', ')}, 80, 60", SIZED),
        ("fx=90.5 fy=91.25\ncx: 39.5\ncy: 28.75\nwidth = 80, height = 60", SIZED),
        ("90.5 0 39.5\n0 91.25 28.75\n0 0 1\n", PLAIN),
        ("90.5 0 39.5 0\n0 91.25 28.75 0\n0 0 1 0\n0 0 0 1", PLAIN),
        (json.dumps({"width": 80, "height": 60, "intrinsic_matrix": matrix("F")}), SIZED),
        (json.dumps({"width": 80, "height": 60, "intrinsic_matrix": matrix("C")}), SIZED),
        (json.dumps({"intrinsic": {"K": np.reshape(matrix("C"), (3, 3)).tolist()}}), PLAIN),
        (json.dumps({"fx": 90.5, "fy": 91.25, "cx": 39.5, "cy": 28.75, "w": 80, "h": 60}), SIZED),
        ("# CAMERA_ID\n1 PINHOLE 80 60 90.5 91.25 40 29.25\n", SIZED),
        (ROS % "0, 0, 0, 0, 0", SIZED),
        ("header:\n  seq: 1\nheight: 60\nwidth: 80\nD: []\nK: [90.5, 0.0, 39.5, 0.0, 91.25, 28.75, "
         "0.0, 0.0, 1.0]\nR: [1.0, 0.0]\n", SIZED),
    ],
)  # fmt: skip
def test_intrinsics_of_every_form_are_the_same(text: str, wanted: Intrinsics, tmp_path: Path):
    for encoding in ("utf-8", "utf-16"):
        (tmp_path / "a").write_text(text, encoding=encoding)
        assert read_intrinsics(tmp_path / "a") == wanted


def test_lens_and_scale_come_with_the_intrinsics(tmp_path: Path):
    path = tmp_path / "a"
    path.write_text(ROS % "0.1, -0.2, 1e-3, -2e-3, 0.05")
    assert read_intrinsics(path).distortion == (0.1, -0.2, 1e-3, -2e-3, 0.05, 0, 0, 0)
    path.write_text("1 RADIAL 80 60 90 40 30 0.1 -0.2\n2 RADIAL 80 60 90 40 30 0.1 -0.2")
    assert read_intrinsics(path).distortion == (0.1, -0.2, 0, 0, 0, 0, 0, 0)
    path.write_text(json.dumps({"cam_K": matrix("C"), "depth_scale": 0.1}))  # BOP's tenths of mm
    assert read_intrinsics(path).depth_scale == 10_000


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no numbers in it"),
        ("1 2 3", "3 numbers, not 4"),
        ("90 91 39 28 1e999 60", "infinity"),
        ("525 525 319 239 640 480 0", "7 numbers"),
        (f"80 60 {TEXT}", "width and height are no whole numbers"),
        ("fx=525 fy=525", "no cx cy"),
        ("-525 525 319 239", "must be positive"),
        ("{", "no intrinsics that can be used"),
        ("{}", "neither fx fy cx cy nor a matrix"),
        (json.dumps({"fx": 9, "fy": 9, "cx": 1, "cy": 1, "K": matrix("C")}), "differ"),
        ("90 1 40\n0 90 30\n0 0 1", "skewed"),
        ("1 OPENCV_FISHEYE 80 60 90 90 40 30 0 0 0 0", "OPENCV_FISHEYE cannot be undone"),
        ("1 PINHOLE 80 60 90 90 40 30\n2 PINHOLE 80 60 95 95 40 30", "several cameras"),
        (
            (ROS % "0.1, 0, 0, 0").replace("plumb_bob", "equidistant"),
            "equidistant cannot be undone",
        ),
    ],
)
def test_what_are_no_intrinsics_is_said(text: str, says: str, tmp_path: Path):
    (tmp_path / "a").write_text(text)
    with pytest.raises(ReadError, match=says) as caught:
        read_intrinsics(tmp_path / "a")
    assert "\n" not in str(caught.value)


def test_a_plane_behind_a_lens_is_a_plane_again():
    lens = (0.12, -0.05, 2e-3, -1e-3, 0.01, 0.0, 0.0, 0.0)
    rows, columns = np.mgrid[:60, :80].astype(float)
    a, b = (columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy
    x, y = a, b
    for _ in range(50):  # the ray that the lens sends to each pixel
        p, q = _through(x, y, lens)
        x, y = x + a - p, y + b - q
    plane = lambda x, y: 1.0 / (1.0 + 0.4 * x - 0.3 * y)  # noqa: E731
    seen: FloatArray = plane(x, y)
    found = undistorted(seen, CAMERA, lens)
    inside = np.isfinite(found)
    assert inside.mean() > 0.8
    np.testing.assert_allclose(found, np.where(inside, plane(a, b), np.nan),
                               atol=1e-5)  # fmt: skip
    assert np.abs(seen - plane(a, b)).max() > 1e-2
    seen[:, 40:] += 1.0  # neighbours of two surfaces are not mixed
    found = undistorted(seen, CAMERA, lens)
    assert not ((found > 1.45) & (found < 1.7)).any()


def test_masks_and_depth_limits_cut_and_are_told(tmp_path: Path):
    folder = capture(tmp_path, stored(1000), "depth/frame-000007.depth.png")
    mask = np.zeros((60, 80), np.uint8)
    mask[20:40, 20:60] = 255
    put(tmp_path / "masks" / "frame-000007.mask.png", mask)
    put(tmp_path / "masks" / "frame-000008.mask.png", mask)
    scan = read(folder, masks=tmp_path / "masks")
    assert scan.grid is not None and scan.name == "frame-000007"
    np.testing.assert_array_equal(scan.grid >= 0, (mask > 0) & np.isfinite(DEPTH))
    np.testing.assert_array_equal(scan.seen_beyond, (mask == 0) & np.isfinite(DEPTH))
    assert f"{100 * (mask > 0).sum() / np.isfinite(DEPTH).sum():.0f} % of it kept" in scan.notes[-1]
    limit = float(np.nanmedian(DEPTH))
    scan = read(folder, max_depth=limit)
    assert scan.points[:, 2].max() <= limit
    assert f"{(limit < DEPTH).sum()} points beyond" in scan.notes[-1]
    np.testing.assert_array_equal(scan.seen_beyond, limit < DEPTH)
    assert read(folder).seen_beyond is None


def test_layouts_are_known_by_their_files(tmp_path: Path):
    tum = capture(tmp_path / "tum", stored(5000) * 2)
    for name in ("depth.txt", "rgb.txt"):
        (tum / name).write_text("# timestamps\n")
    np.testing.assert_allclose(read(tum).points, 2 * TRUE.points)
    apc = tmp_path / "apc"
    put(apc / "frame-000000.depth.png", rotated(stored(10_000)))
    put(apc / "frame-000000.color.png", np.zeros((60, 80, 3), np.uint8))
    (apc / "cam.info.txt").write_text(
        "# Color camera intrinsic matrix\n90.5 0 39.5\n0 91.25 28.75\n0 0 1\n\n"
        "# Depth camera intrinsic matrix\n80 0 39\n0 80 28\n0 0 1\n"
    )
    np.testing.assert_allclose(read(apc).points, TRUE.points, rtol=1e-6)
    none = DepthOptions()
    assert isinstance(as_named([apc], none), DepthImages)
    assert isinstance(as_named([apc / "frame-000000.depth.png"], none), DepthImages)
    plain = capture(tmp_path / "plain", stored(1000), "a.png")
    assert isinstance(as_named([plain], none), DepthImages)
    (plain / "a.xyz").write_text("0 0 0\n")  # then it is a folder of scans as ever
    assert [file.name for file in collect_named(as_named([plain], none))] == ["a"]


def bad_sets(folder: Path) -> list[tuple[list[str], str]]:
    """Arguments, and what is said of them."""
    good, cam = str(capture(folder / "good", stored(1000))), str(folder / "cam.txt")
    alone = put(folder / "alone" / "a.png", stored(1000))
    small = put(folder / "small" / "000.png", np.ones((6, 8), np.uint8)).parent
    other = put(folder / "other" / "5.png", np.ones((60, 80), np.uint8)).parent
    black = put(folder / "black" / "000.png", np.zeros((60, 80), np.uint8)).parent
    empty = str(capture(folder / "empty", stored(1000) * 0))
    photo = put(folder / "photo.png", np.zeros((60, 80, 3), np.uint8))
    np.save(black / "bytes.npy", np.ones((60, 80), np.uint8))
    pages = [Image.fromarray(stored(1000))] * 2
    pages[0].save(black / "two.tif", save_all=True, append_images=pages[1:])
    torn = folder / "torn.png"
    torn.write_bytes(alone.read_bytes()[:200])
    (folder / "cam.txt").write_text(f"{TEXT} 640 480")
    return [
        ([str(alone)], "needs its camera's intrinsics"),
        ([str(alone.parent)], "needs its camera's intrinsics"),
        ([good, "--intrinsics", str(folder / "none.txt")], "cannot be read"),
        ([good, "--intrinsics", cam], "has 80 x 60 pixels, the intrinsics are for 640 x 480"),
        ([good, "--masks", str(small)], "has 8 x 6 pixels, 000.png 80 x 60"),
        ([good, "--masks", str(other)], "1 of 1 depth images have not exactly one mask"),
        ([good, "--masks", cam], "is no folder"),
        ([good, "--masks", str(black)], "has no pixel with a depth"),
        ([good, "--depth-scale", "1"], "its depths are 794 m in the median"),
        ([good, "--depth-scale", "1e6"], "its depths are 0.000794 m in the median"),
        ([good, "--depth-max", "0.5"], "all depths lie beyond --depth-max 0.5 m"),
        ([empty], "no pixel has a depth"),
        ([str(photo), "--intrinsics", cam], "a picture"),
        ([str(torn), "--intrinsics", cam], "cannot be read as an image"),
        ([str(folder), "--intrinsics", cam, "--depth-max", "1"], "a picture"),
        ([str(black / "bytes.npy"), "--intrinsics", cam], "holds uint8"),
        ([str(black / "two.tif"), "--intrinsics", cam], "holds 2 images"),
        ([str(folder / "none.png")], "there is no such file"),
        ([cam, "--depth-max", "1"], "no depth image"),
    ]


def test_bad_input_ends_with_one_line_and_nothing_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    for arguments, says in bad_sets(tmp_path):
        for command in (["info"], ["run", "-o", tmp_path / "out", "--no-cache", "-q"]):
            assert scanweld(*command, *arguments) == 1, arguments
            (line,) = (each for each in capsys.readouterr().err.splitlines() if "error" in each)
            assert says in line, arguments
            assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_frames_become_a_model_that_is_opened_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    views = [view_of(small_creature(), 35 * k, 20, 0, pixels=110) for k in range(3)]
    largest = max((view.camera for view in views), key=lambda camera: camera.width)
    views = [replace(view, camera=largest) for view in views]
    scene = scene_of(small_creature(), views, in_sensor_frames=True)
    camera = scene.scans[0].camera
    assert camera is not None
    per_meter = 60_000 / max(scan.points[:, 2].max() for scan in scene.scans)
    for scan in scene.scans:
        assert scan.grid is not None
        depth = np.where(scan.grid >= 0, scan.points[scan.grid, 2] * per_meter, 0)
        put(tmp_path / "depth" / f"{scan.name}.png", np.rint(depth).astype(np.uint16))
        put(tmp_path / "masks" / f"{scan.name}.png", (depth > 0).astype(np.uint8))
        put(tmp_path / "color" / f"{scan.name}.png", np.full((*depth.shape, 3), RED, np.uint8))
    cam = tmp_path / "depth" / "cam.txt"
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
    cam.write_text(" ".join(map(str, numbers)))
    model = tmp_path / "model"
    said = ["--intrinsics", cam, "--masks", tmp_path / "masks", "--depth-scale", 100 * per_meter]
    said += ["--color", tmp_path / "color"]
    (tmp_path / "a.toml").write_text(COARSE)
    scanweld("run", tmp_path / "depth", *said, "-o", model, "--config", tmp_path / "a.toml")
    true = {name: pose.matrix() for name, pose in scene.world_from_scan.items()}
    for matrix in true.values():
        matrix[:3, 3] /= 100  # in the units of the frames
    (tmp_path / "true.json").write_text(json.dumps({k: m.tolist() for k, m in true.items()}))
    assert scanweld("evaluate", model / "poses.json", tmp_path / "true.json") == 0
    colors = read_mesh(model / "model.ply").colors
    assert colors is not None and (np.abs(colors - np.array(RED, dtype=float)) < 3).all()
    before = (model / "report.html").read_text()
    assert before.count('alt="Colours of') == 3
    assert scanweld("report", model) == 0 and (model / "report.html").read_text() == before
    moved = (tmp_path / "depth").rename(tmp_path / "moved")
    out = ["--poses", "tum", "--points", "all.ply", "--scans", moved]
    assert scanweld("export", model, "-o", tmp_path / "out", *out) == 0, capsys.readouterr().err
    points = sum(len(scan.points) for scan in scene.scans)
    assert len(read_scan(tmp_path / "out" / "all.ply").points) == points


def test_damaged_images_and_arrays_are_refused(tmp_path: Path):
    rng = np.random.default_rng(4)
    for suffix in ("png", "tif", "npy", "npz"):
        data = put(tmp_path / f"whole.{suffix}", stored(1000)).read_bytes()
        path = tmp_path / f"a.{suffix}"
        for _ in range(60):
            damaged = bytearray(data[: rng.integers(len(data) + 1)])
            for at in rng.integers(0, max(1, len(damaged)), 3) if damaged else ():
                damaged[at] = rng.integers(256)
            path.write_bytes(bytes(damaged))
            options = DepthOptions(intrinsics=put_text(tmp_path / "cam.txt"))
            try:
                for file in DepthImages(inputs=[path], options=options).collect():
                    file.read()
            except ScanweldError as error:
                assert "\n" not in str(error)


def put_text(path: Path) -> Path:
    path.write_text(TEXT)
    return path
