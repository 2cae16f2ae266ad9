"""Models in map coordinates: every format keeps all digits, or is about a local origin."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import trimesh

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io import (
    read_mesh,
    read_scan,
)
from scanweld.io.pose_formats import Frame, match_poses, read_any_poses
from tests.command_line import scanweld
from tests.export.made import EVERY_POSE, NAMES, model_of
from tests.scenes import Scene

pytestmark = pytest.mark.slow


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
