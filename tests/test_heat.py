"""PA-HKS: the artificial mesh, its Laplacian, the signature and the keypoints."""

import dataclasses
import logging
from functools import cache

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import ArpackNoConvergence
from scipy.spatial import Delaunay, KDTree

from scanweld.config import HeatConfig, PrepareConfig
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import rotation_exp
from scanweld.geometry.prepared import PreparedScan, RangeImage
from scanweld.geometry.scan import RangeScan
from scanweld.heat import Features, describe, features
from scanweld.heat.artificial_mesh import ArtificialMesh, close_front
from scanweld.heat.front import FrontMesh, pieces, thin_front
from scanweld.heat.keypoints import group, persistent_maxima
from scanweld.heat.laplacian import eigenpairs
from scanweld.heat.signature import diffusion_times, heat_signature, sun_times
from scanweld.heat.surface import heat_surface
from scanweld.preparation import prepare
from tests.depth_scans import ortho
from tests.meshes import edges_of
from tests.prepared import scaled
from tests.scenes import MILD_NOISE, random_motion, small_creature

CONFIG = HeatConfig(max_front_vertices=1000, num_modes=80)


def scan_of_creature(
    azimuth: float, model: CameraModel, noise: NoiseModel | None, roll: float = 0.0
) -> RangeScan:
    view = view_of(small_creature(), azimuth, 10, roll, pixels=160, model=model)
    return scan_mesh(small_creature(), view.camera, view.world_from_sensor, noise)


@cache
def prepared(
    azimuth: float,
    model: CameraModel = CameraModel.PINHOLE,
    noise: NoiseModel | None = None,
    roll: float = 0.0,
) -> PreparedScan:
    return prepare(scan_of_creature(azimuth, model, noise, roll), PrepareConfig())


@cache
def described(azimuth: float) -> Features:
    return describe(prepared(azimuth), CONFIG)


def closed(scan: PreparedScan, max_vertices: int) -> tuple[FrontMesh, ArtificialMesh]:
    front = thin_front(scan.image, max_vertices)
    return front, close_front(front, scan.image.camera, scan.diameter)


def ball(subdivisions: int) -> tuple[FloatArray, IntArray]:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)


CASES = [
    (20.0, CameraModel.PINHOLE, None, 1500),
    (140.0, CameraModel.ORTHOGRAPHIC, None, 900),
    (260.0, CameraModel.PINHOLE, MILD_NOISE, 3000),
]


@pytest.mark.parametrize(("azimuth", "model", "noise", "max_vertices"), CASES)
def test_artificial_mesh_is_closed_manifold_and_twice_its_front(
    azimuth: float, model: CameraModel, noise: NoiseModel | None, max_vertices: int
):
    """Every directed edge once, its reverse once; one fan of faces around each vertex.

    Back and walls have the front's holes: the Euler characteristic doubles, piece by piece.
    """
    front, mesh = closed(prepared(azimuth, model, noise), max_vertices)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight and solid.is_winding_consistent and solid.volume > 0
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    span = len(mesh.vertices)
    assert len(np.unique(start * span + end)) == len(start)
    assert np.array_equal(np.unique(mesh.faces), np.arange(span))
    assert len(front.points) <= max_vertices
    # Around a vertex each face leads to the next one: as many fans as pieces of these links.
    corner = np.arange(len(start)).reshape(-1, 3)
    arriving = dict(zip((start * span + end).tolist(), corner.ravel().tolist(), strict=True))
    before = np.roll(mesh.faces, 1, axis=1).ravel()
    following = [arriving[key] for key in (start * span + before).tolist()]
    links = coo_array((np.ones(len(start)), (corner.ravel(), following)))
    assert connected_components(links)[0] == span
    piece = pieces(mesh.faces, span)
    front_piece = pieces(front.faces, len(front.points))
    assert len(np.unique(piece)) == len(np.unique(front_piece)) >= 1
    for p in np.unique(piece):
        of_front = front.faces[piece[front.faces[:, 0]] == p]
        assert euler(mesh.faces[piece[mesh.faces[:, 0]] == p]) == 2 * euler(of_front)


def euler(faces: IntArray) -> int:
    return len(np.unique(faces)) - len(edges_of(faces)[0]) + len(faces)


def test_front_is_measured_and_walls_run_behind_it():
    scan = prepared(20.0)
    front, mesh = closed(scan, 1500)
    rows, columns = front.pixels.T
    was_seen = np.isfinite(scan.image.depth[rows, columns])
    assert was_seen.mean() > 0.95
    assert np.array_equal(front.points[was_seen], scan.image.points()[rows, columns][was_seen])
    assert np.array_equal(mesh.vertices[: mesh.num_front], front.points)
    assert np.array_equal(mesh.faces[: len(front.faces)], front.faces)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.volume > 0
    deepest = front.points[:, 2].max() + 0.05 * scan.diameter
    assert mesh.vertices[:, 2].max() == pytest.approx(deepest)
    # Walls and back must not take up the spectrum: a full copy would make it four times the front.
    assert len(mesh.vertices) < 3 * mesh.num_front


@pytest.mark.parametrize(
    ("step", "jump_pixels", "bridged", "num_pieces"),
    [(5.0, 6.0, False, 1), (8.0, 6.0, False, 2), (8.0, 6.0, True, 1), (8.0, 9.0, False, 1)],
)
def test_front_is_cut_at_jumps(step: float, jump_pixels: float, bridged: bool, num_pieces: int):
    """A wall before another one, seen straight on; the edge lies between the thinned columns."""
    depth, flat = np.full((60, 60), 100.0), np.zeros((60, 60))
    depth[:, 31:] += step
    image = RangeImage(
        camera=ortho(60, 60),
        depth=depth,
        normals=np.broadcast_to([0.0, 0.0, -1.0], (60, 60, 3)),
        kind=flat.astype(np.uint8),
        outside=flat,
        is_rim=flat > 0,
        is_reliable=flat == 0,
        pixel=1.0,
        jump_pixels=jump_pixels,
    )
    front = thin_front(image, 450, bridged=bridged)
    assert len(np.unique(np.diff(np.unique(front.pixels[:, 1])))) == 1
    assert len(np.unique(pieces(front.faces, len(front.points)))) == num_pieces
    columns = front.pixels[front.faces][..., 1]
    crosses = (columns.min(axis=1) <= 30) & (columns.max(axis=1) >= 31)
    assert crosses.any() == (num_pieces == 1)


def test_dropouts_do_not_pierce_the_front():
    """One lost pixel in fifty leaves the outline of the front as it was."""
    clean = thin_front(prepared(20.0).image, 1500)
    image = prepared(20.0).image
    lost = np.random.default_rng(1).random(image.depth.shape) < 0.02
    depth = np.where(lost, np.nan, image.depth)
    dirty = thin_front(dataclasses.replace(image, depth=depth), 1500)
    assert len(dirty.faces) > 0.9 * len(clean.faces)


def test_sphere_has_the_spectrum_of_spherical_harmonics_in_any_frame():
    vertices, faces = ball(4)
    values, functions = eigenpairs(vertices, faces, 25)
    degree = np.repeat(np.arange(5), 2 * np.arange(5) + 1)
    assert values == pytest.approx(degree * (degree + 1), rel=0.02, abs=1e-9)
    # The constant function of unit norm on the area 4 pi.
    assert functions[:, 0] ** 2 == pytest.approx(np.full(len(functions), 1 / (4 * np.pi)), rel=0.01)
    moved, _ = eigenpairs(random_motion(np.random.default_rng(4), 0.3).apply(vertices), faces, 25)
    assert moved == pytest.approx(values, abs=1e-6)


def disc(num_rings: int = 30) -> tuple[FloatArray, IntArray]:
    """A flat disc of radius 1."""
    rings = [
        np.stack([r * np.cos(a), r * np.sin(a)], axis=1)
        for k in range(1, num_rings + 1)
        for r, a in [(k / num_rings, 2 * np.pi * np.arange(6 * k) / (6 * k))]
    ]
    flat = np.concatenate([np.zeros((1, 2)), *rings])
    faces = Delaunay(flat).simplices.astype(np.int64)
    return np.column_stack([flat, np.zeros(len(flat))]), faces


def test_open_and_clamped_discs_have_the_spectra_of_bessel_functions():
    """Squares of the zeros of J_m' where no heat leaves (Neumann), of J_m at a cold rim."""
    vertices, faces = disc()
    rim = np.flatnonzero(np.linalg.norm(vertices, axis=1) > 0.999)
    free, _ = eigenpairs(vertices, faces, 7)
    zeros = np.array([0.0, 1.8412, 1.8412, 3.0542, 3.0542, 3.8317, 4.2012])
    assert free == pytest.approx(zeros**2, rel=0.02, abs=1e-9)
    held, functions = eigenpairs(vertices, faces, 6, rim)
    zeros = np.array([2.4048, 3.8317, 3.8317, 5.1356, 5.1356, 5.5201])
    assert held == pytest.approx(zeros**2, rel=0.02)
    assert not functions[rim].any() and np.abs(functions[0]).max() > 0.1


def test_a_clamped_front_has_no_heat_at_its_rims():
    scan = prepared(20.0)
    front = thin_front(scan.image, 1000)
    surface = heat_surface(front, scan.image.camera, scan.diameter, "clamped")
    assert np.array_equal(surface.faces, front.faces) and len(surface.cold) > 50
    vertices = surface.vertices / scan.diameter
    values, functions = eigenpairs(vertices, surface.faces, 60, surface.cold)
    signature = heat_signature(values, functions, diffusion_times(values, 5, 2e-2))
    warm = np.setdiff1d(np.arange(surface.num_front), surface.cold)
    assert signature[surface.cold] == pytest.approx(np.log(1e-9))
    assert np.median(signature[warm], axis=0).min() > np.log(1e-9) + 5


@pytest.mark.parametrize("change", [{"surface": "open"}, {"surface": "clamped"}, {"times": "sun"}])
def test_other_surfaces_and_times_give_other_keypoints_by_the_same_rules(change: dict[str, str]):
    found = describe(prepared(20.0), HeatConfig.model_validate(CONFIG.model_dump() | change))
    plain = described(20.0)
    assert len(found) >= 5 and found.signatures.shape == (len(found), CONFIG.num_times)
    assert np.isfinite(found.signatures).all()
    assert found.points.shape != plain.points.shape or not np.allclose(found.points, plain.points)


def test_times_span_the_spectrum():
    times = sun_times(np.array([0.0, 0.0, 2.0, 5.0, 80.0]), 6)
    assert times[0] == pytest.approx(4 * np.log(10) / 80)
    assert times[-1] == pytest.approx(4 * np.log(10) / 2)
    assert np.diff(np.log(times)) == pytest.approx(np.full(5, np.log(40) / 5))
    times = diffusion_times(np.array([0.0, 1.0, 2.0]), 4, 1e-3)
    assert np.all(np.diff(times) > 0)


def test_signature_follows_the_eigenpairs_and_not_their_signs():
    values, functions = eigenpairs(*ball(3), 60)
    times = diffusion_times(values, 5, 0.5)
    assert times[0] == pytest.approx(4 / values[-1])
    assert times[-1] == pytest.approx(0.5)
    signature = heat_signature(values, functions, times)
    flips = np.where(np.arange(60) % 2, -1.0, 1.0)
    assert np.array_equal(signature, heat_signature(values, functions * flips, times))
    # All points of a sphere are alike, and share the heat trace evenly.
    assert signature == pytest.approx(np.full(signature.shape, -np.log(4 * np.pi)), abs=0.1)


def test_keypoints_lie_on_the_surface_off_the_rims_and_apart():
    scan, found = prepared(20.0), described(20.0)
    assert len(found.points) >= 10
    pixels, depth = scan.image.camera.project(found.points)
    columns, rows = np.rint(pixels).astype(int).T
    assert depth == pytest.approx(scan.image.depth[rows, columns], rel=1e-12)
    assert not scan.image.is_rim[rows, columns].any()
    assert np.array_equal(found.normals, scan.image.normals[rows, columns])
    rays = scan.image.camera.view_directions(found.points)
    assert (np.einsum("nk,nk->n", rays, found.normals) < 0).all()
    assert np.all(np.diff(found.strengths) <= 0)
    moved = np.linalg.norm(found.points - found.found_at, axis=1) / scan.diameter
    assert (moved > 0).any() and moved.max() < CONFIG.group_diameters
    gaps = np.linalg.norm(found.points[:, None] - found.points, axis=-1)
    np.fill_diagonal(gaps, np.inf)
    unlike = np.sqrt(np.mean((found.signatures[:, None] - found.signatures) ** 2, axis=-1)) >= 0.5
    assert ((gaps >= CONFIG.group_diameters * scan.diameter) | unlike).all()
    # The grid is another one after a roll, the surface is the same.
    rolled = describe(prepared(20.0, roll=35.0), CONFIG).points
    near = [
        np.linalg.norm((rolled @ turn)[:, None] - found.points, axis=-1).min(axis=1)
        for turn in (rotation_exp(np.radians([0, 0, angle])) for angle in (35.0, -35.0))
    ]
    assert max((d < 0.03 * scan.diameter).mean() for d in near) > 0.6


@pytest.mark.parametrize("scale", [1e-3, 1024.0])
def test_scale_changes_nothing_but_the_unit(scale: float):
    larger = scaled(scan_of_creature(20.0, CameraModel.PINHOLE, None), scale)
    found, plain = describe(prepare(larger, PrepareConfig()), CONFIG), described(20.0)
    assert found.points == pytest.approx(scale * plain.points, rel=1e-6)
    assert found.signatures == pytest.approx(plain.signatures, abs=1e-6)
    assert found.times == pytest.approx(plain.times, rel=1e-6)


def test_mirror_halves_have_mirrored_signatures():
    """The signature of a symmetric body cannot tell left from right, and must not pretend to."""
    vertices, faces = ball(4)
    x, y, z = vertices.T
    body = np.stack([x * (1 + 0.4 * y**2), 0.8 * y, 0.6 * z * (1 + 0.2 * x)], axis=1)
    values, functions = eigenpairs(body, faces, 40)
    signature = heat_signature(values, functions, diffusion_times(values, 4, 0.3))
    _, partner = KDTree(body).query(body * [1, -1, 1])
    assert signature[partner] == pytest.approx(signature, abs=0.05)
    assert np.ptp(signature, axis=0).min() > 0.1


def test_a_maximum_must_persist_and_be_the_strongest_of_its_like():
    """Two bumps on a strip: one at both times, one at the first only."""
    points = np.stack([np.arange(20.0), np.zeros(20), np.zeros(20)], axis=1)
    faces = np.stack([np.arange(18), np.arange(1, 19), np.arange(2, 20)], axis=1)
    lasting, fleeting = -np.abs(points[:, 0] - 5), -np.abs(points[:, 0] - 14)
    signature = np.stack([np.maximum(lasting, fleeting), lasting], axis=1)
    found = persistent_maxima(signature, points, faces, 2.0)
    assert found.vertices.tolist() == [5]
    assert persistent_maxima(np.zeros((20, 3)), points, faces, 2.0).vertices.tolist() == []
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [0.4, 0, 0], [5.0, 0, 0]])
    signatures = np.array([[0.0, 0.0], [0.1, 0.0], [3.0, 3.0], [0.0, 0.0]])
    kept = group(points, signatures, np.array([1.0, 2.0, 0.5, 1.5]), 1.0)
    assert kept.tolist() == [1, 3, 2]


def test_what_gives_no_keypoints_says_so(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    with caplog.at_level(logging.INFO, logger="scanweld.heat.features"):
        none = describe(prepared(20.0), HeatConfig(max_front_vertices=200, num_modes=150))
    assert none.points.shape == (0, 3)
    assert none.signatures.shape == (0, 10)
    assert "no heat keypoints" in caplog.text

    def fail(*_: object) -> None:
        raise ArpackNoConvergence("no convergence", np.zeros(0), np.zeros((0, 0)))

    monkeypatch.setattr(features, "eigenpairs", fail)
    with caplog.at_level(logging.WARNING, logger="scanweld.heat.features"):
        assert len(describe(prepared(20.0), CONFIG).points) == 0
    assert "not solved" in caplog.text
    image = prepared(20.0).image
    nothing = dataclasses.replace(image, depth=np.full(image.depth.shape, np.nan))
    assert len(thin_front(nothing, 500).faces) == 0
