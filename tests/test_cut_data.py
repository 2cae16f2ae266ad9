"""The cut on real frames, and real sets that it must leave alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanweld.cut import cut_out, with_only
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_scan
from tests.data import require_data
from tests.depth_scans import scan_of_depth
from tests.scenes import creature_scene
from tests.turntables import iou

pytestmark = pytest.mark.slow


def frames(folder: Path, every: int = 1) -> list[RangeScan]:
    """The depth images of a folder as scans."""
    told = json.loads((folder / "intrinsics.json").read_text())
    sizes = {key: told[key] for key in ("width", "height", "fx", "fy", "cx", "cy")}
    camera = Camera(model=CameraModel.PINHOLE, **sizes)
    made = []
    for path in sorted((folder / "depth").glob("*.png"))[::every]:
        depth = pixels(path) / told.get("depth_scale", 1000.0)
        scan = scan_of_depth(np.where((depth > 0) & (depth < 20), depth, np.nan), camera)
        made.append(replace(scan, name=path.stem))
    return made


def pixels(path: Path) -> np.ndarray:
    image = pytest.importorskip("PIL.Image")
    with image.open(path) as opened:
        return np.asarray(opened).astype(float)


def masks(folder: Path, scans: list[RangeScan]) -> list[BoolArray]:
    return [pixels(folder / "mask" / f"{scan.name}.png") > 0 for scan in scans]


def test_a_plush_dog_is_cut_out_of_its_frames_in_every_one():
    folder = require_data("depth/turntable-d435-dog")
    scans = frames(folder)
    cut = cut_out(scans, "auto")
    for scan, mask in zip(scans, masks(folder, scans), strict=True):
        assert scan.grid is not None
        assert iou(cut.kept[scan.name], mask & (scan.grid >= 0)) >= 0.9
    given = [with_only(scan, mask) for scan, mask in zip(scans, masks(folder, scans), strict=True)]
    assert all(a is b for a, b in zip(cut_out(given, "auto").scans, given, strict=True))


@pytest.mark.parametrize("name, every", [("kitchen", 1), ("kitchen", 10), ("redwood5", 1)])
def test_frames_of_a_camera_in_a_hand_stay_the_very_same(name: str, every: int):
    scans = frames(require_data(f"depth/video-{VIDEOS[name]}"), every)[:8]
    assert all(a is b for a, b in zip(cut_out(scans, "auto").scans, scans, strict=True))


VIDEOS = {"kitchen": "kinect-kitchen", "redwood5": "xtion-redwood5"}


def test_range_grids_and_virtual_scans_of_one_object_stay_the_very_same():
    found = sorted(require_data("stanford-bunny").glob("bun[0-9]*.ply"))
    for scans in ([read_scan(path) for path in found], list(creature_scene(6).scans)):
        assert len(scans) > 3
        assert all(a is b for a, b in zip(cut_out(scans, "auto").scans, scans, strict=True))
