"""One folder with everything that can be wrong with a file, beside the scans of one object."""

import json
import math
import shutil
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scanweld.evaluation.metrics import Standing, evaluate_poses
from scanweld.io import read_poses, write_scan_ply
from tests.command_line import COARSE, scanweld
from tests.prepared import scaled
from tests.scenes import Scene, creature_scene, write_scans

pytestmark = pytest.mark.slow

GOOD = ["scan_01", "scan_02", "scan_03", "scan_04"]
IN_MILLIMETRES = 1000.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    whole = creature_scene(8, pixels=140)
    return replace(whole, scans=whole.scans[:4])


@pytest.fixture(scope="module")
def folder(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_scans(tmp_path_factory.mktemp("bad") / "scans", scene.scans)
    whole = (folder / "scan_01.ply").read_bytes()
    shutil.copy(folder / "scan_02.ply", folder / "scan_02_copy.ply")
    (folder / "truncated.ply").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.ply").write_bytes(b"")
    (folder / "text.ply").write_text("Dear diary, today I scanned a creature.\n")
    (folder / "ten_points.xyz").write_text("\n".join(f"{k} {k * k} {-k}" for k in range(10)))
    write_scan_ply(folder / "millimetres.ply", scaled(scene.scans[2], IN_MILLIMETRES))
    other = creature_scene(3, pixels=140, object_seed=5).scans[1]
    write_scan_ply(folder / "stranger.ply", replace(other, name="stranger"))
    spoil_first_point(folder / "scan_04.ply")
    (folder.parent / "coarse.toml").write_text(COARSE)
    return folder


def spoil_first_point(path: Path) -> None:
    data = path.read_bytes()
    header = data[: data.index(b"end_header\n") + len(b"end_header\n")]
    assert b"binary_little_endian" in header
    not_a_number = struct.pack("<d" if b"property double x" in header else "<f", math.nan)
    start = len(header)
    path.write_bytes(header + not_a_number + data[start + len(not_a_number) :])


@pytest.fixture(scope="module")
def outcome(folder: Path) -> tuple[int, Path]:
    model = folder.parent / "model"
    coarse = folder.parent / "coarse.toml"
    return scanweld("run", folder, "-o", model, "-q", "--workers", "1", "--config", coarse), model


def load(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def test_the_rest_goes_on_and_the_exit_code_tells(outcome: tuple[int, Path]):
    code, model = outcome
    assert code == 3
    assert (model / "model.ply").exists()
    assert load(model / "report.json")["verdict"] == "partial"
    assert len(load(model / "poses.json")["unplaced"]) == 7


def test_the_good_scans_are_placed_rightly(outcome: tuple[int, Path], scene: Scene):
    estimate = read_poses(outcome[1] / "poses.json")
    assert sorted(estimate.poses) == GOOD
    centroids = {scan.name: scan.points.mean(axis=0) for scan in scene.scans}
    truth = {name: scene.world_from_scan[name] for name in GOOD}
    errors = evaluate_poses(estimate, truth, centroids=centroids, diameter=170.0)
    assert errors.count(Standing.RIGHT) == len(GOOD)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("empty", "the file is empty"),
        ("text", "not a PLY file"),
        ("truncated", "truncated.ply"),
        ("ten_points", "10 points"),
        ("scan_02_copy", "same content as scan_02"),
        ("millimetres", "1e+03 times larger than the other scans; units mixed up (m and mm)?"),
        ("stranger", "no pair with another scan holds"),
    ],
)
def test_what_cannot_be_used_is_named_with_the_reason(
    outcome: tuple[int, Path], name: str, says: str
):
    unplaced = load(outcome[1] / "poses.json")["unplaced"]
    assert says in unplaced[name]
    report = load(outcome[1] / "report.json")["scans"][name]
    assert (report["verdict"], report["reason"]) == ("unplaced", unplaced[name])


def test_points_that_are_not_finite_are_dropped_and_counted(outcome: tuple[int, Path]):
    scans = load(outcome[1] / "report.json")["scans"]
    assert scans["scan_04"]["num_dropped"] == 1
    assert scans["scan_03"]["num_dropped"] == 0


def test_every_pair_is_reported_once_in_the_order_of_names(outcome: tuple[int, Path]):
    pairs = load(outcome[1] / "graph.json")["pairs"]
    registered = sorted([*GOOD, "stranger"])
    assert [(pair["i"], pair["j"]) for pair in pairs] == [
        (i, j) for i in registered for j in registered if i < j
    ]
