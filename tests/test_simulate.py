"""Simulated folders, whose truth is true, and the objects in them."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from benchmarks.surface.surface_distances import sample_surface
from scanweld.errors import InputError, WriteError
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.simulate import simulate, views_around
from scanweld.evaluation.views import overlap
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.scan import Viewpoint
from scanweld.io.collect import collect
from scanweld.io.poses import read_poses
from scanweld.io.read import read_scan
from tests.scenes import PRIMITIVES, small_creature

CLEAN = NoiseModel()


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize("model", [CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC])
def test_the_truth_puts_the_scans_on_the_mesh(tmp_path: Path, model: CameraModel):
    mesh = small_creature()
    truth = simulate(mesh, tmp_path, num_scans=5, pixels=80, noise=CLEAN, model=model)
    tree = KDTree(sample_surface(mesh, 100_000, np.random.default_rng(0))[0])
    files = collect([tmp_path])
    assert [file.name for file in files] == [f"scan_{k:02d}" for k in range(1, 6)]
    for file in files:
        scan = read_scan(file.path, file.name)
        distance, _ = tree.query(truth.poses[file.name].apply(scan.points))
        assert np.max(distance) < 1.5
        assert scan.viewpoint is Viewpoint.GIVEN
        assert scan.grid is not None and scan.camera is not None
        assert scan.camera.model is model
    written = read_poses(tmp_path / "truth" / "poses.json")
    assert written.components == truth.components
    for name, pose in truth.poses.items():
        np.testing.assert_array_equal(written.poses[name].matrix(), pose.matrix())


def test_same_seed_same_files_whose_names_say_nothing_about_the_views(tmp_path: Path):
    """Numbered in the order of the views, azimuths would rise."""
    for name, seed in (("a", 1), ("b", 1), ("c", 5)):
        truth = simulate(small_creature(), tmp_path / name, num_scans=7, pixels=40, seed=seed)
    first, again, other = (files_of(tmp_path / name) for name in "abc")
    assert first == again
    assert not set(first.values()) & set(other.values())
    azimuths = []
    for name in sorted(truth.poses):
        x, y, _ = (
            truth.poses[name] @ read_scan(tmp_path / f"c/{name}.ply").sensor_pose
        ).translation
        azimuths.append(np.degrees(np.arctan2(y, x)) % 360)
    assert (np.diff(azimuths) < 0).sum() > 1


@pytest.mark.parametrize("num_scans", [8, 12])
def test_neighbouring_views_overlap(num_scans: int):
    """Every view has another that it shares a third with, and these join all of them."""
    views = views_around(small_creature(), num_scans, np.random.default_rng(0), pixels=80)
    near = np.eye(num_scans, dtype=int)
    for i, j in combinations(range(num_scans), 2):
        near[i, j] = near[j, i] = overlap(small_creature(), views[i], views[j]) > 0.3
    assert (np.linalg.matrix_power(near, num_scans) > 0).all()


def test_a_filled_folder_is_left_alone_and_nothing_to_scan_is_an_error(tmp_path: Path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(WriteError, match="not empty"):
        simulate(small_creature(), tmp_path, num_scans=2, pixels=60)
    assert list(files_of(tmp_path)) == ["notes.txt"]
    with pytest.raises(InputError, match="2 or more"):
        simulate(small_creature(), tmp_path, num_scans=1)
    cloud = TriangleMesh(vertices=np.eye(3), faces=np.empty((0, 3), dtype=np.int64))
    with pytest.raises(InputError, match="no faces"):
        simulate(cloud, tmp_path)


# The project's own objects are closed, in one piece, and the same each time.


def as_trimesh(mesh: TriangleMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_objects_are_closed_and_in_one_piece():
    full = creature()
    assert 50_000 < len(full.faces) < 100_000
    assert full.colors is not None and full.colors.std(axis=0).min() > 10
    small = [small_creature(seed) for seed in range(3)]
    assert all(5_000 < len(mesh.faces) < 20_000 for mesh in small)
    plain = [make() for make in PRIMITIVES.values()]
    for mesh in map(as_trimesh, [full, *small, *plain]):
        assert mesh.is_watertight and mesh.body_count == 1 and mesh.volume > 0


def test_a_creature_is_the_same_each_time_and_another_for_each_seed():
    first, again = creature(3, voxels=60), creature(3, voxels=60)
    assert first.vertices.tobytes() == again.vertices.tobytes()
    assert first.faces.tobytes() == again.faces.tobytes()
    volumes = [as_trimesh(small_creature(seed)).volume for seed in range(4)]
    assert np.diff(np.sort(volumes)).min() > 0.001 * max(volumes)


def test_a_creature_has_no_symmetry():
    """Its mirror image and its half turns about the axes leave much of it uncovered."""
    mesh = as_trimesh(small_creature())
    points = mesh.sample(4000, seed=0)
    centred = points - mesh.center_mass
    axes = np.linalg.eigh(np.cov(centred.T))[1]
    tree = KDTree(centred @ axes)
    for signs in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1], [-1, 1, 1], [1, -1, 1], [1, 1, -1]):
        distance, _ = tree.query((centred @ axes) * signs)
        assert np.percentile(distance, 75) > 5
