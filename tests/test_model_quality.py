"""What a fused model says of itself, and what becomes of it: support, deviation, colours, holes."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.surface.surface_defects import surface_defects
from scanweld.config import FusionConfig, PrepareConfig
from scanweld.evaluation.primitives import plate, sphere
from scanweld.evaluation.turntable import joined
from scanweld.evaluation.views import view_of
from scanweld.fusion import fuse, voxel_edge
from scanweld.fusion.agreement import Agreement
from scanweld.fusion.color import exposure_gains
from scanweld.fusion.noise import scan_noise
from scanweld.fusion.posed_image import PosedImage, pose_image
from scanweld.fusion.sheets import second_sheets, without_second_sheets
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh, border_edges, face_normals, smoothed_normals
from scanweld.geometry.pose import Pose
from scanweld.io import read_mesh, write_mesh_ply
from scanweld.preparation import prepare
from tests.meshes import is_closed
from tests.posed_scans import RADIUS, Posed, off_sphere, one_scan, scanned, views_of

APART = np.array([32.0, 0.0, 0.0])
FROM_ABOVE = [(0, 50), (120, 50), (240, 50), (0, 89)]
OPEN = FusionConfig()


def images_of(scans: Posed) -> list[PosedImage]:
    return [pose_image(s, p, s.resolution, PrepareConfig()) for s, p in zip(*scans, strict=True)]


@lru_cache
def ball(noise: float = 0.0) -> Posed:
    return scanned(sphere(RADIUS), noise=noise)


@lru_cache
def cup() -> Posed:
    """A ball of which the lower part was not seen."""
    return scanned(sphere(RADIUS), views_of(sphere(RADIUS), FROM_ABOVE))


def border_points(mesh: TriangleMesh) -> np.ndarray:
    used = np.unique(np.concatenate(border_edges(mesh.faces, len(mesh.vertices))))
    points = mesh.vertices[used]
    return points[np.lexsort(points.T)]


def same(first: TriangleMesh, second: TriangleMesh) -> bool:
    names = ("vertices", "faces", "normals", "colors", "support", "stdev", "filled")
    pairs = [(getattr(first, name), getattr(second, name)) for name in names]
    return all(a is b is None or a.tobytes() == b.tobytes() for a, b in pairs)


def test_order_and_workers_do_not_matter():
    scans, poses = ball(0.001)
    config = FusionConfig(holes="fill", smooth=1, faces=3000)
    expected = fuse(scans, poses, config)
    assert same(fuse(scans[::-1], poses[::-1], config), expected)
    assert same(fuse(scans, poses, config, workers=3), expected)


def test_full_resolution_is_used_though_the_working_image_is_coarse():
    """A scan of 450 pixels, prepared at 100: the voxels are those of the scan."""
    view = view_of(sphere(RADIUS), 0, 0, pixels=450.0, model=CameraModel.ORTHOGRAPHIC)
    scan = prepare(one_scan(sphere(RADIUS), view, 0, 0.0), PrepareConfig(image_pixels=100))
    mesh = fuse([scan], [view.world_from_sensor], OPEN)
    edges = np.linalg.norm(
        mesh.vertices[mesh.faces[:, 0]] - mesh.vertices[mesh.faces[:, 1]], axis=1
    )
    assert np.median(edges) < 1.1 * voxel_edge([scan], OPEN) < 0.5 * scan.image.pixel
    bounded = fuse([scan], [view.world_from_sensor], FusionConfig(max_voxels_across=50))
    assert len(bounded.faces) < 0.1 * len(mesh.faces)


def test_support_counts_the_scans_that_see_a_place():
    """A plate under three cameras of which each sees another strip."""
    flat = plate(100.0, 80.0, 30.0)
    scans, poses = scanned(flat, views_of(flat, [(0, 89.9)] * 3))
    limits = [-20.0, 0.0, 20.0]
    cut = []
    for scan, pose, limit in zip(scans, poses, limits, strict=True):
        world = (pose @ scan.scan_from_sensor.inverse()).apply(scan.scan.points)
        cut.append(prepare(scan.scan.only(world[:, 0] > limit), PrepareConfig()))
    mesh = fuse(cut, poses, OPEN)
    x = mesh.vertices[:, 0]
    off_limits = np.min(np.abs(x[:, None] - limits), axis=1) > 2.5 * scans[0].resolution
    inner = off_limits & (np.abs(mesh.vertices[:, 1]) < 35) & (x < 45)
    assert inner.sum() > 1000
    expected = (x[inner, None] > limits).sum(axis=1)
    assert mesh.support is not None
    np.testing.assert_array_equal(mesh.support[inner], expected)


@pytest.mark.parametrize("sigma", [0.0005, 0.002])
def test_deviation_is_that_of_the_vertices(sigma: float):
    mesh = fuse(*ball(sigma), OPEN)
    assert mesh.stdev is not None and mesh.support is not None
    error = off_sphere(mesh.vertices)
    for count in (2, 3, 4):
        chosen = mesh.support == count
        if chosen.sum() < 300:
            continue
        actual = float(np.sqrt(np.mean(error[chosen] ** 2)))
        told = float(np.sqrt(np.mean(mesh.stdev[chosen] ** 2)))
        assert 0.7 < told / actual < 1.4, (count, told, actual)


def test_each_scan_has_its_own_noise():
    """Noisier scans are told from the overlaps alone, and count for less."""
    sigmas = [0.0005, 0.0005, 0.003, 0.0005, 0.0005, 0.0005]
    scans, poses = scanned(sphere(RADIUS), noise=sigmas)
    noise = scan_noise(images_of((scans, poses)))
    others = np.delete(noise, 2)
    assert others.max() < 2.0 * others.min()
    assert 3.5 < noise[2] / np.median(others) < 9.0
    error = off_sphere(fuse(scans, poses, OPEN).vertices)
    even = off_sphere(fuse(*ball(0.003), OPEN).vertices)
    assert np.std(error) < 0.5 * np.std(even)
    scans, poses = ball(0.001)
    (alone,) = scan_noise(images_of((scans[:1], poses[:1])))
    together = scan_noise(images_of((scans, poses)))[0]
    assert 0.5 < alone / together < 2.0


@pytest.mark.parametrize(("noise", "off"), [(0.0, 0.3), (0.001, 0.7)])
def test_walls_thinner_than_the_truncation_keep_both_sides(noise: float, off: float):
    """Two or three voxels thick: no sheet is lost, none is double."""
    thin = plate(100.0, 80.0, 4.0)
    views = views_of(thin, [(0, 89), (0, -89), (40, 60), (220, -60)])
    scans, poses = scanned(thin, views, noise)
    mesh = fuse(scans, poses, OPEN)
    inner = (np.abs(mesh.vertices[:, 0]) < 40) & (np.abs(mesh.vertices[:, 1]) < 30)
    assert np.abs(np.abs(mesh.vertices[inner, 2]) - 2.0).max() < off
    assert np.sign(mesh.vertices[inner, 2]).min() == -1 and mesh.vertices[inner, 2].max() > 0
    found = surface_defects(mesh, scans[0].resolution)
    assert (found.non_manifold, found.double, found.cracks) == (0, 0, 0)


def test_a_scan_a_little_off_makes_no_second_sheet():
    """One of six scans lies a voxel and a half off, as a pose may be."""
    scans, poses = ball()
    off = Pose(rotation=np.eye(3), translation=1.5 * scans[0].resolution * np.array([1.0, 0, 0]))
    mesh = fuse(scans, [off @ poses[0], *poses[1:]], OPEN)
    found = surface_defects(mesh, scans[0].resolution)
    assert (found.non_manifold, found.double, found.cracks) == (0, 0, 0)


def test_sheets_that_share_a_corner_are_two():
    """By their corner all vertices are a few edges apart, as on one sheet with a step.

    2 --- 2 --- 2
      \\            seen from the side: three by three vertices each, by the scans behind them
        1 --- 1
    """
    side = np.arange(3)
    x, y = (part.ravel() for part in np.meshgrid(side, side))
    corner = (x + 3 * y)[(x < 2) & (y < 2)]
    squares = [[corner, corner + 1, corner + 4], [corner, corner + 4, corner + 3]]
    sheet = np.concatenate([np.stack(part, axis=1) for part in squares])
    plane = np.stack([x, y, np.zeros(9)], axis=1).astype(np.float64)
    vertices = np.concatenate([plane, plane - [0.0, 0.0, 1.5]])
    other = np.where(sheet == 0, 0, sheet + 9)
    support = Agreement(count=np.repeat([2, 1], 9), stdev=np.full(18, 0.1))
    faces = np.concatenate([sheet, other])
    joined = smoothed_normals(vertices, faces, 1)
    assert (second_sheets(vertices, faces, joined, 1.0) < 0).all()
    kept, kept_faces = without_second_sheets(vertices, faces, support, 1.0)
    assert len(kept_faces) == len(sheet) and (kept[kept_faces][..., 2] == 0.0).all()


def test_defects_are_counted():
    """What the counts of the other tests stand on: each kind is planted, and found."""
    good = fuse(*ball(), OPEN)
    voxel = ball()[0][0].resolution
    assert surface_defects(good, voxel).borders == 0
    both = joined(good, replace(good, vertices=(1 + 1.5 * voxel / RADIUS) * good.vertices))
    assert surface_defects(both, voxel).double > 0.9 * len(both.vertices)
    pricked = replace(good, faces=np.delete(good.faces, [5, 4000], axis=0))
    assert surface_defects(pricked, voxel).cracks == 2
    upper = np.all(good.vertices[good.faces][:, :, 2] > 0.3, axis=1)
    halves = np.where(upper[:, None], good.faces, good.faces + len(good.vertices))
    cut = TriangleMesh(vertices=np.tile(good.vertices, (2, 1)), faces=halves)
    assert surface_defects(cut, voxel).borders == 2
    fin = np.concatenate([good.faces, [[*good.faces[0, :2], 3000]]])
    assert surface_defects(replace(good, faces=fin), voxel).non_manifold == 1


@pytest.mark.parametrize("holes", ["fill", "carve"])
def test_holes_are_closed_and_what_closes_them_is_marked(holes: str):
    scans, poses = cup()
    left_open = fuse(scans, poses, OPEN)
    closed = fuse(scans, poses, OPEN.model_copy(update={"holes": holes}))
    assert not is_closed(left_open.faces) and is_closed(closed.faces)
    assert closed.filled is not None and closed.support is not None and closed.stdev is not None
    np.testing.assert_array_equal(closed.filled, closed.support == 0)
    np.testing.assert_array_equal(closed.filled, np.isnan(closed.stdev))
    voxel = voxel_edge(scans, OPEN)
    depth = left_open.vertices[:, 2].min()
    low = closed.vertices[:, 2] < depth - 3.0 * voxel
    assert closed.filled[low].all()
    if holes == "fill":
        assert not closed.filled[closed.vertices[:, 2] > depth + 22].any()
    seen = np.linalg.norm(closed.vertices[~closed.filled], axis=1)
    assert np.abs(seen - RADIUS).max() < voxel
    outward = face_normals(closed.vertices, closed.faces)
    volume = (outward * closed.vertices[closed.faces[:, 0]]).sum() / 6.0
    assert volume > 0.5 * 4 / 3 * np.pi * RADIUS**3


def test_what_was_seen_empty_is_not_filled():
    """Two balls with a gap that was seen through: no membrane joins them."""
    one = sphere(25.0)
    pair = joined(*(replace(one, vertices=one.vertices + shift) for shift in (-APART, APART)))
    scans, poses = scanned(
        pair, views_of(pair, [(90, 10), (210, 10), (330, 10), (0, 89)], pixels=150.0)
    )
    mesh = fuse(scans, poses, FusionConfig(holes="fill"))
    assert is_closed(mesh.faces)
    assert np.abs(mesh.vertices[:, 0]).min() > 4.0


def test_watertight_closes_and_stays_closed_when_decimated():
    mesh = fuse(*cup(), FusionConfig(watertight=True, faces=2000, smooth=2))
    assert is_closed(mesh.faces)
    assert abs(len(mesh.faces) - 2000) < 60
    assert mesh.filled is not None and mesh.filled.any() and not mesh.filled.all()


def test_decimation_keeps_border_shape_and_colours():
    colored = replace(sphere(RADIUS), colors=np.full((len(sphere(RADIUS).vertices), 3), 0))
    red = colored.vertices[:, 0] > 0
    colored = replace(colored, colors=np.where(red[:, None], [220, 30, 30], [30, 30, 220]))
    posed = scanned(colored, views_of(colored, FROM_ABOVE))
    whole = fuse(*posed, OPEN)
    few = fuse(*posed, FusionConfig(faces=len(whole.faces) // 8))
    assert len(few.faces) < 1.05 * len(whole.faces) / 8
    np.testing.assert_allclose(border_points(few), border_points(whole), atol=1e-9 * RADIUS)
    voxel = posed[0][0].resolution
    error = np.abs(off_sphere(few.vertices))
    error[np.concatenate(border_edges(few.faces, len(few.vertices)))] = 0.0
    assert error.max() < 0.5 * voxel
    assert few.colors is not None
    off_seam = np.abs(few.vertices[:, 0]) > 3 * voxel
    is_red = few.colors[:, 0] > few.colors[:, 2]
    assert (is_red == (few.vertices[:, 0] > 0))[off_seam].all()


def test_smoothing_takes_noise_away_and_keeps_size_and_border():
    posed = scanned(sphere(RADIUS), views_of(sphere(RADIUS), FROM_ABOVE), 0.003)
    rough, smooth = fuse(*posed, OPEN), fuse(*posed, FusionConfig(smooth=10))
    upper = [mesh.vertices[mesh.vertices[:, 2] > 0] for mesh in (rough, smooth)]
    errors = [off_sphere(points) for points in upper]
    assert np.std(errors[1]) < 0.9 * np.std(errors[0])
    assert abs(errors[1].mean() - errors[0].mean()) < 0.002 * RADIUS
    np.testing.assert_array_equal(border_points(smooth), border_points(rough))


def test_component_largest_leaves_one_piece():
    small = sphere(15.0)
    both = joined(sphere(RADIUS), replace(small, vertices=small.vertices + 3 * APART))
    posed = scanned(both, views_of(both, [(90, 20), (210, 20), (330, 20)]))
    assert fuse(*posed, OPEN).vertices[:, 0].max() > 80
    largest = fuse(*posed, FusionConfig(component="largest"))
    assert largest.vertices[:, 0].max() < RADIUS + 3


GAINS = np.array([1.3, 1.0, 0.75, 1.1, 0.9, 1.2])


def planted() -> Posed:
    """A ball of many shades; every scan has another exposure."""
    body = sphere(RADIUS)
    shade = 100.0 + 35.0 * np.sin(body.vertices / 9.0)
    scans, poses = scanned(replace(body, colors=np.rint(shade).astype(np.uint8)))
    lit = []
    for scan, gain in zip(scans, GAINS, strict=True):
        assert scan.scan.colors is not None
        colors = np.clip(np.rint(gain * scan.scan.colors), 0, 255).astype(np.uint8)
        lit.append(replace(scan, scan=replace(scan.scan, colors=colors)))
    return lit, poses


def test_exposures_are_found_and_taken_out():
    scans, poses = planted()
    mesh = fuse(scans, poses, OPEN)
    assert mesh.normals is not None and mesh.colors is not None
    images = images_of((scans, poses))
    gains = exposure_gains(mesh.vertices, mesh.normals, images, 2.0 * scans[0].resolution)
    relative = gains / GAINS[:, None]
    np.testing.assert_allclose(relative / relative.mean(axis=0), 1.0, atol=0.02)
    ratio = mesh.colors / (100.0 + 35.0 * np.sin(mesh.vertices / 9.0))
    assert np.std(ratio) < 0.03
    scans[2] = replace(scans[2], scan=replace(scans[2].scan, colors=None))
    mesh = fuse(scans, poses, OPEN)
    assert mesh.colors is not None and np.std(mesh.colors.astype(float)) > 10


def test_properties_are_written(tmp_path: Path):
    mesh = fuse(*cup(), FusionConfig(holes="fill", faces=1500))
    write_mesh_ply(tmp_path / "model.ply", mesh)
    data = (tmp_path / "model.ply").read_bytes()
    header = data.split(b"end_header\n", 1)[0]
    for line in (b"float nx", b"int support", b"float stdev", b"uchar filled"):
        assert b"property " + line in header
    found = read_mesh(tmp_path / "model.ply")
    assert mesh.support is not None and mesh.stdev is not None and mesh.filled is not None
    assert found.support is not None and found.stdev is not None and found.filled is not None
    assert len(found.faces) == len(mesh.faces)
    np.testing.assert_array_equal(found.support, mesh.support)
    np.testing.assert_array_equal(found.filled, mesh.filled)
    np.testing.assert_allclose(found.stdev, mesh.stdev, rtol=1e-6)
