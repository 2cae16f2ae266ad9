"""The project's own objects are closed, in one piece, and the same each time."""

import numpy as np
import trimesh
from scipy.spatial import KDTree

from scanweld.evaluation.creature import creature
from scanweld.geometry.mesh import TriangleMesh
from tests.scenes import PRIMITIVES, small_creature


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
