"""Posed scans -> one mesh: accuracy, carving, trimming, topology, colours, invariances."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from scanweld.config import FusionConfig, PrepareConfig
from scanweld.errors import InputError
from scanweld.evaluation.primitives import plate, sphere
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.turntable import joined
from scanweld.fusion import fuse
from scanweld.fusion.cases import edge_corners, triangle_table
from scanweld.fusion.surface import extract_surface
from scanweld.fusion.volume import BLOCK, Volume
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.shading import render_shaded, side_by_side, write_png
from scanweld.preparation import prepare
from tests.meshes import edges_of, is_closed
from tests.posed_scans import RADIUS, Posed, off_sphere, scanned, views_of

CONFIG = FusionConfig()


@lru_cache
def sphere_scans(model: CameraModel = CameraModel.ORTHOGRAPHIC) -> Posed:
    return scanned(sphere(RADIUS), views_of(sphere(RADIUS), model=model))


def voxel_of(scans: Sequence[PreparedScan]) -> float:
    return CONFIG.voxel_resolutions * float(np.median([scan.resolution for scan in scans]))


def moved(mesh: TriangleMesh, *shift: float) -> TriangleMesh:
    return replace(mesh, vertices=mesh.vertices + np.array(shift))


@pytest.mark.parametrize("model", [CameraModel.ORTHOGRAPHIC, CameraModel.PINHOLE])
def test_six_scans_close_a_sphere(model: CameraModel):
    scans, poses = sphere_scans(model)
    mesh = fuse(scans, poses, CONFIG)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radius - RADIUS).max() < 0.2 * voxel_of(scans)
    assert is_closed(mesh.faces)
    assert len(mesh.vertices) - len(edges_of(mesh.faces)[0]) + len(mesh.faces) == 2
    assert mesh.normals is not None and mesh.colors is None
    assert np.einsum("vk,vk->v", mesh.normals, mesh.vertices / radius[:, None]).min() > 0.95
    outward = face_normals(mesh.vertices, mesh.faces) * mesh.vertices[mesh.faces[:, 0]]
    assert outward.sum(axis=1).min() > 0


def test_same_bytes_whatever_the_blocks_at_a_time(monkeypatch: pytest.MonkeyPatch):
    """Taken a block at a time, many of the blocks hold nothing to draw."""
    expected = fuse(*sphere_scans(), CONFIG)
    for chunk in (None, 1):
        if chunk is not None:
            monkeypatch.setattr("scanweld.fusion.integrate.CHUNK", chunk)
        mesh = fuse(*sphere_scans(), CONFIG)
        assert mesh.vertices.tobytes() == expected.vertices.tobytes()
        assert mesh.faces.tobytes() == expected.faces.tobytes()


@pytest.mark.parametrize("model", [CameraModel.ORTHOGRAPHIC, CameraModel.PINHOLE])
def test_blocks_that_are_passed_over_hold_nothing(
    model: CameraModel, monkeypatch: pytest.MonkeyPatch
):
    """The same bytes as of all blocks, seen by every image as far as it goes."""
    expected = fuse(*sphere_scans(model), CONFIG)
    no_ends = tuple(np.full((99, 99), np.inf, np.float32) for _ in range(2))
    monkeypatch.setattr("scanweld.fusion.integrate._tiles", lambda *_: no_ends)
    mesh = fuse(*sphere_scans(model), CONFIG)
    assert mesh.vertices.tobytes() == expected.vertices.tobytes()
    assert mesh.faces.tobytes() == expected.faces.tobytes()


@pytest.mark.parametrize("factor", [2.0**-10, 2.0**10])
def test_unit_does_not_matter(factor: float):
    """Every decision must fall the same way; images hold single precision."""
    mesh = sphere(RADIUS)
    large = replace(mesh, vertices=factor * mesh.vertices)
    expected = fuse(*scanned(mesh, views_of(mesh)[:3]), CONFIG)
    fused = fuse(*scanned(large, views_of(large)[:3]), CONFIG)
    np.testing.assert_array_equal(fused.faces, expected.faces)
    np.testing.assert_allclose(fused.vertices / factor, expected.vertices, atol=1e-6 * RADIUS)


def test_world_frame_does_not_matter():
    scans, poses = sphere_scans()
    rotation = random_rotation(np.random.default_rng(3))
    motion = Pose(rotation=rotation, translation=np.array([3000.0, -200.0, 1000.0]))
    mesh = fuse(scans, [motion @ pose for pose in poses], CONFIG)
    radius = np.linalg.norm(motion.inverse().apply(mesh.vertices), axis=1)
    assert np.abs(radius - RADIUS).max() < 0.2 * voxel_of(scans)
    assert is_closed(mesh.faces)


def test_free_space_carves_what_one_scan_made_up():
    """A ball floats over the sphere in one scan; three others look through where it would be."""
    ball = moved(sphere(6.0), 0.0, 0.0, 80.0)
    whole = joined(sphere(RADIUS), ball)
    views = views_of(whole, pixels=180.0)
    scans, poses = scanned(sphere(RADIUS), views)
    (liar,), _ = scanned(whole, views[:1])
    mesh = fuse([liar, *scans[1:]], poses, CONFIG)
    assert np.linalg.norm(mesh.vertices, axis=1).max() < RADIUS + voxel_of(scans)
    believed = fuse([liar], poses[:1], CONFIG)
    assert np.linalg.norm(believed.vertices, axis=1).max() > 75.0


def test_space_before_a_surface_is_carved():
    """A wall behind everything: no pixel is free, the ball is denied by what is seen behind it."""
    wall = moved(plate(300.0, 300.0, 10.0), 0.0, 0.0, -60.0)
    ball = moved(sphere(12.0), 0.0, 0.0, 30.0)
    scene = joined(wall, ball)
    # Beside the ball's vertices the wall's eight are strays: pixels count across the ball.
    views = views_of(scene, [(0, 89), (30, 60), (150, 60), (270, 60)], pixels=20.0)
    (liar,), _ = scanned(scene, views[:1])
    scans, poses = scanned(wall, views)
    mesh = fuse([liar, *scans[1:]], poses, CONFIG)
    assert mesh.vertices[:, 2].max() < -50.0
    scans, poses = scanned(scene, views)
    assert fuse(scans, poses, CONFIG).vertices[:, 2].max() > 40.0


def test_parts_that_nobody_saw_are_not_bridged():
    """One scan of a sphere: the front stays open, and reaches no farther than it was seen."""
    scans, poses = sphere_scans()
    mesh = fuse(scans[:1], poses[:1], CONFIG)
    toward = -poses[0].rotation[:, 2]
    assert (mesh.vertices @ toward).min() > -voxel_of(scans)
    assert np.abs(off_sphere(mesh.vertices)).max() < 0.5 * voxel_of(scans)
    assert (edges_of(mesh.faces)[1] == 1).any()


def test_two_plates_stay_apart():
    """Two plates side by side, seen from before and behind: nothing spans the gap or the rims."""
    pair = joined(
        moved(plate(60.0, 80.0, 20.0), -45, 0, 0), moved(plate(60.0, 80.0, 20.0), 45, 0, 0)
    )
    scans, poses = scanned(pair, views_of(pair, [(0, 89), (0, -89)]))
    mesh = fuse(scans, poses, CONFIG)
    voxel = voxel_of(scans)
    assert np.abs(mesh.vertices[:, 0]).min() > 15.0 - voxel
    assert (np.abs(np.abs(mesh.vertices[:, 2]) - 10.0) < voxel).all()


def test_what_one_scan_lost_does_not_eat_what_another_saw():
    views = views_of(sphere(RADIUS))
    whole, poses = sphere_scans()
    holed, _ = scanned(sphere(RADIUS), views, NoiseModel(dropout=0.3))
    mesh = fuse([*whole, *holed], [*poses, *poses], CONFIG)
    assert is_closed(mesh.faces)
    assert np.abs(off_sphere(mesh.vertices)).max() < 0.5 * voxel_of(whole)
    scans, poses = sphere_scans()
    view = views_of(sphere(RADIUS))[0]
    seen = scan_mesh(sphere(RADIUS), view.camera, view.world_from_sensor)
    assert seen.grid is not None
    half = np.where(np.arange(seen.grid.shape[1]) < seen.grid.shape[1] // 2, seen.grid, -1)
    halved = prepare(replace(seen, grid=half), PrepareConfig())
    mesh = fuse([halved, *scans[1:]], poses, CONFIG)
    assert np.linalg.norm(mesh.vertices, axis=1).min() > RADIUS - voxel_of(scans)
    toward = -poses[0].rotation[:, 2]
    assert (mesh.vertices @ toward).max() > RADIUS - voxel_of(scans)


def test_colors_are_those_of_the_nearest_surface():
    mesh = sphere(RADIUS)
    red = mesh.vertices[:, 2] > 0
    colored = replace(mesh, colors=np.where(red[:, None], [250, 10, 10], [10, 10, 250]))
    fused = fuse(*scanned(colored, views_of(mesh)), CONFIG)
    assert fused.colors is not None
    off_seam = np.abs(fused.vertices[:, 2]) > 5.0
    is_red = fused.colors[:, 0] > fused.colors[:, 2]
    assert (is_red == (fused.vertices[:, 2] > 0))[off_seam].all()
    assert set(np.unique(fused.colors[off_seam])) <= {10, 250}


def test_nothing_to_fuse_is_refused():
    with pytest.raises(InputError, match="no surface"):
        fuse([], [], CONFIG)


def test_every_cell_case_is_closed_and_has_its_corners_on_the_right_side():
    """Each crossed edge is used, by as many segments as its two faces and its fans ask for."""
    table, ends = triangle_table(), edge_corners()
    for case in range(256):
        inside = np.array([case >> corner & 1 for corner in range(8)], dtype=bool)
        used = np.unique(table[case][table[case] >= 0])
        crossed = np.flatnonzero(inside[ends[:, 0]] != inside[ends[:, 1]])
        np.testing.assert_array_equal(used, crossed)


@pytest.mark.parametrize("seed", range(3))
def test_any_field_gives_a_manifold(seed: int):
    """White noise meets every case and every ambiguous face; blocks join without cracks."""
    rng = np.random.default_rng(seed)
    corners = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    shape = (len(corners), BLOCK, BLOCK, BLOCK)
    volume = Volume(
        origin=np.zeros(3),
        voxel=1.0,
        truncation=4.0,
        blocks=corners,
        keys=((corners[:, 0] << 20 | corners[:, 1]) << 20) | corners[:, 2],
        distance=rng.uniform(-1, 1, size=shape).astype(np.float32),
        weight=np.ones(shape, np.float32),
        empty=np.zeros(shape, np.float32),
    )
    vertices, faces = extract_surface(volume)
    edges, counts = edges_of(faces)
    assert counts.max() == 2
    border = vertices[edges[counts == 1]]
    on_hull = (border == 0) | (border == 3 * BLOCK - 1)
    assert on_hull.any(axis=2).all()


def test_pictures(tmp_path: Path):
    picture = render_shaded(sphere(RADIUS), (1, 2, 3), size=80)
    assert picture.shape == (80, 80, 3) and (picture[0, 0] == 255).all()
    middle, rim = picture[40, 40].astype(int), picture[40, 6].astype(int)
    assert (middle > rim + 50).all()
    row = side_by_side([picture, picture[:40]])
    assert row.shape == (80, 160, 3)
    write_png(tmp_path / "row.png", row)
    found = np.rint(255 * imread(tmp_path / "row.png"))
    np.testing.assert_array_equal(found, row)
