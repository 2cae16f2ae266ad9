"""Models and their files, for the tests of this folder."""

import json
from pathlib import Path

import numpy as np

from scanweld.io import (
    PoseSet,
    write_mesh_ply,
    write_poses,
)
from scanweld.io.ply_body import decode_body
from scanweld.io.ply_header import parse_header
from scanweld.io.pose_formats import FORMATS, Frame, match_poses, read_any_poses
from tests.command_line import COARSE
from tests.scenes import Scene, write_scans

NAMES = ["scan_01", "scan_02", "scan_03", "scan_04"]
EVERY_POSE = [word for form in FORMATS for word in ("--poses", form)]
FUSE = ("fuse", "scans", "--config", "coarse.toml")


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


def check(path: Path, scene: Scene) -> None:
    """The poses in a file are those of the scene."""
    found = read_any_poses(path)
    poses = match_poses(path, found, NAMES)
    for k, scan in enumerate(scene.scans):
        is_scan = found.frame is Frame.SCAN
        want = scene.world_from_scan[scan.name] if is_scan else scene.views[k].world_from_sensor
        assert np.abs(poses[scan.name].matrix() - want.matrix()).max() < 1e-9, path
