"""``scanweld info`` of a capture: what was read, its noise, and what would be cut."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from scanweld.app.capture_info import capture_info
from scanweld.evaluation.turntable import CAMERA, DepthSensor, Shots, turntable
from scanweld.io.depth.capture import DepthImages
from tests.command_line import error_line, scanweld
from tests.html_pages import Page
from tests.scenes import small_creature
from tests.test_depth import put
from tests.test_depth_layouts import bop, open3d, seven_scenes

STEP = 1e-3


@pytest.fixture(scope="module")
def made() -> Shots:
    sensor = DepthSensor(wave=0.002, eaten=1.0, local=2e-3)
    return turntable(small_creature(), (0.0, 25.0, 50.0), sensor=sensor)


@pytest.fixture(scope="module")
def folder(made: Shots, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("capture")
    for scan in made.scans:
        assert scan.grid is not None
        depth = np.where(scan.grid >= 0, scan.points[scan.grid, 2] * 1000, 0)
        put(place / "depth" / f"{scan.name}.png", np.rint(depth).astype(np.uint16))
        put(place / "color" / f"{scan.name}.png", np.full((*depth.shape, 3), 90, np.uint8))
    keys = ("width", "height", "fx", "fy", "cx", "cy")
    told = {key: getattr(CAMERA, key) for key in keys}
    (place / "camera_intrinsic.json").write_text(json.dumps(told))
    return place


def test_a_turntable_is_told_with_its_noise_and_what_would_be_cut(made: Shots, folder: Path):
    info = capture_info(DepthImages(inputs=[folder]).collect())
    rows = info.rows
    assert rows["frames"] == "3 depth images" and rows["layout"] == "Open3D; one camera"
    assert rows["scale"].startswith("1000 depth values") and rows["poses"] == "none"
    assert rows["colours"] == "3 of 3 frames have a colour image"
    depth = np.concatenate([scan.points[:, 2] for scan in made.scans])
    low, high = map(float, re.findall(r"[\d.]+", rows["range"])[:2])
    assert [low, high] == pytest.approx(np.quantile(depth, [0.01, 0.99]).tolist(), rel=0.01)
    for sigma, at in re.findall(r"([\d.]+) mm at ([\d.]+) m", rows["noise"]):
        assert float(sigma) == pytest.approx(2 * (float(at) / 0.4) ** 2, rel=0.4)
    assert "would be kept, of 3 of 3 frames" in rows["object"]
    least, most = map(float, re.findall(r"([\d.]+) to ([\d.]+) %", rows["object"])[0])
    for mask in made.masks:
        assert 0.8 * least <= 100 * mask.mean() <= 1.2 * most


def test_the_page_shows_every_frame(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    page = tmp_path / "capture.html"
    assert scanweld("info", folder, "--html", page) == 0
    told = capsys.readouterr().out
    assert "would be kept" in told and told.index("layout") < told.index("focal length")
    shown = [found["alt"] for tag, found in Page(page.read_text()).elements if tag == "img"]
    assert shown == [f"{what} of {k:03d}" for k in range(3) for what in ("Depths", "Colours")]


def test_whatever_a_capture_is_it_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for make, says in (
        (open3d, "of 2 of 2, tried as start poses and never just believed"),
        (seven_scenes, "nothing would be cut: nothing moved"),
        (bop, "cut to the masks"),
        (bop, "10000 depth values taken for a metre, by the layout of BOP; points are in metres; "),
    ):
        folder = tmp_path / make.__name__
        make(folder)
        assert scanweld("info", folder) == 0
        assert says in capsys.readouterr().out
    put(folder / "depth" / "000001.png", np.zeros((60, 80), np.uint16))
    assert scanweld("info", folder, "--html", tmp_path / "page.html") == 1
    assert "no pixel has a depth" in capsys.readouterr().err
    assert "no pixel has a depth" in (tmp_path / "page.html").read_text()


def test_a_page_is_of_depth_images_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "a.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n")
    assert scanweld("info", tmp_path / "a.xyz", "--html", tmp_path / "page.html") == 1
    assert "leave it out" in error_line(capsys) and not (tmp_path / "page.html").exists()
