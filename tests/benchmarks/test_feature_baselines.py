"""Descriptors and keypoints that the study compares with PA-HKS, against analytic truth."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.features.harris3d import harris_keypoints, harris_response
from benchmarks.features.spectral import (
    Spectrum,
    energy_bands,
    full_mesh_spectrum,
    octave_times,
    si_heat_signature,
    spectrum_of,
    thin_mesh,
    wave_signature,
)
from benchmarks.paper import features
from benchmarks.paper.baselines.feature_views import DESCRIPTORS, DETECTORS
from benchmarks.paper.features import QUESTIONS, answer
from benchmarks.paper.pages import write_page
from benchmarks.study.study import Record
from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import random_rotation
from tests.scenes import small_creature


def ball(subdivisions: int) -> tuple[FloatArray, IntArray]:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)


def vertex_areas(vertices: FloatArray, faces: IntArray) -> FloatArray:
    areas = np.linalg.norm(face_normals(vertices, faces), axis=1) / 6
    summed = np.bincount(faces.ravel(), weights=np.repeat(areas, 3), minlength=len(vertices))
    return summed.astype(np.float64)


def creature_spectrum(scale: float = 1.0) -> Spectrum:
    mesh = thin_mesh(small_creature(), 900)
    return spectrum_of(scale * mesh.vertices, mesh.faces, 170.0, 80)


def box_surface(per_edge: int) -> FloatArray:
    """Evenly spread points of the cube [0, 1]^3, edges and corners among them."""
    steps = np.linspace(0, 1, per_edge)
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid[((grid == 0) | (grid == 1)).any(axis=1)]


def moved(points: FloatArray, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    return points @ random_rotation(rng).T + rng.normal(size=3)


def test_thinned_sphere_has_the_spectrum_of_spherical_harmonics():
    vertices, faces = ball(4)
    mesh = TriangleMesh(vertices=vertices, faces=faces)
    spectrum, _ = full_mesh_spectrum(mesh, max_vertices=1000, num_modes=16)
    degree = np.repeat(np.arange(4), 2 * np.arange(4) + 1)
    # Lengths are measured in diameters of the box: 2 sqrt(3).
    assert spectrum.eigenvalues == pytest.approx(12 * degree * (degree + 1), rel=0.06, abs=1e-6)


def test_scale_invariant_signature_ignores_the_size():
    """The size is not taken out beforehand: the eigenvalues of the larger object are smaller."""
    plain = creature_spectrum()
    times = octave_times(2.0**-14, 2.0**8)
    for factor in (0.5, 1.7, 3.0):
        larger = creature_spectrum(factor)
        assert larger.eigenvalues[1] == pytest.approx(plain.eigenvalues[1] / factor**2, rel=1e-3)
        one, other = (si_heat_signature(s.eigenvalues, s.functions, times) for s in (plain, larger))
        assert np.abs(one - other).max() < 0.02 * np.abs(one).max()
        # Which takes the magnitudes: the signature does tell the points apart.
        assert np.ptp(one, axis=0)[1] > 0.2 * np.abs(one).max()


def test_wave_signature_is_one_on_the_whole_and_over_the_sphere():
    vertices, faces = ball(3)
    spectrum = spectrum_of(vertices, faces, 1.0, 49)
    bands, width = energy_bands(spectrum.eigenvalues)
    signature = wave_signature(spectrum.eigenvalues, spectrum.functions, bands, width)
    assert signature.shape == (len(vertices), 100)
    # Points of a sphere share every energy evenly.
    assert signature == pytest.approx(np.full(signature.shape, 1 / (4 * np.pi)), rel=0.1)
    mesh = thin_mesh(small_creature(), 900)
    body = creature_spectrum()
    bands, width = energy_bands(body.eigenvalues)
    signature = wave_signature(body.eigenvalues, body.functions, bands, width)
    total = vertex_areas(mesh.vertices / 170.0, mesh.faces) @ signature
    assert total == pytest.approx(np.ones(100), rel=0.02)


def test_harris_finds_the_corners_of_a_box():
    points = moved(box_surface(26), 1)
    at = np.arange(len(points))
    found = harris_keypoints(points, at, 0.17, 0.2, 50)
    corners = moved(np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1.0)]), 1)
    apart = np.linalg.norm(points[found][:, None] - corners, axis=-1)
    assert len(found) == 8
    assert sorted(apart.argmin(axis=1)) == list(range(8))
    assert apart.min(axis=1).max() < 0.06


def test_harris_response_of_a_paraboloid():
    """Over a patch of z = (a x^2 + b y^2) / 2 the fit is exact at the top: A = 2 a^2, B = 2 b^2."""
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    a, b = 0.4, 0.2
    points = np.stack([x.ravel(), y.ravel(), 0.5 * (a * x**2 + b * y**2).ravel()], axis=1)
    top = np.array([20 * 41 + 20])
    expected = 2 * a**2 * 2 * b**2 - 0.04 * (2 * a**2 + 2 * b**2) ** 2
    assert harris_response(points, top, 1.0) == pytest.approx([expected])
    assert harris_response(10 * points, top, 10.0) == pytest.approx([expected])
    assert harris_response(moved(points, 7), top, 1.0) == pytest.approx([expected])


def test_answers_count_what_is_right_among_what_is_asked():
    """Three points ask; the last one's place is not seen, the middle one has no partner."""
    apart = np.array([[0.1, 0.2, 0.9], [0.3, 0.1, 0.9], [0.9, 0.9, 0.0]])
    is_right = np.array([[False, True, False], [False, False, False], [False, False, True]])
    found = answer(apart, is_right, np.array([True, True, False]))
    assert found["nearest"] == pytest.approx([0, 2, 1 / 3])
    assert found["mutual"] == pytest.approx([0, 2, 1 / 3])
    assert found["among 8"] == pytest.approx([1, 1, 1])
    found = answer(apart, is_right, np.array([False, False, True]))
    assert found["nearest"] == pytest.approx([1, 1, 1 / 3])
    none = answer(np.zeros((0, 3)), np.zeros((0, 3), dtype=bool), np.zeros(0, dtype=bool))
    assert none == {question: [0.0, 0.0, 0.0] for question in QUESTIONS}


def test_a_random_descriptor_is_right_as_often_as_chance_says():
    rng = np.random.default_rng(8)
    total = {question: np.zeros(3) for question in QUESTIONS}
    for _ in range(150):
        is_right = rng.random((30, 40)) < 0.05
        found = answer(rng.random((30, 40)), is_right, rng.random(30) < 0.7)
        for question in QUESTIONS:
            total[question] += found[question]
    for right, asked, chance in total.values():
        assert asked > 400
        assert right == pytest.approx(chance, abs=4 * np.sqrt(chance))


def test_features_are_measured_and_told(tmp_path: Path):
    unit = features.units(quick=True)[0]
    result = json.loads(json.dumps(features.measure(unit)))
    repeated = {name: told["repeated"] for name, told in result["detectors"].items()}
    assert tuple(repeated) == DETECTORS
    right, asked, chance = repeated["HKS, full mesh"]
    # The same places on the mesh, in both views.
    assert right == asked > chance
    assert repeated["PA-HKS"][0] > repeated["PA-HKS"][2]
    for group in ("own", "even"):
        assert tuple(result[group]) == DESCRIPTORS
    right, asked, chance = result["even"]["HKS, full mesh"]["nearest"]
    assert right / asked > 0.4 > 4 * chance / asked
    told = write_page("features", [Record(unit=unit, result=result)], tmp_path, quick=True)
    assert "| PA-HKS |" in told and "## Creature" in told
    assert (tmp_path / "features.png").stat().st_size > 10_000


def test_a_row_without_its_library_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(module: str) -> None:
        raise InputError(f"{module} is missing")

    monkeypatch.setattr("benchmarks.paper.baselines.fpfh.need", fail)
    unit = features.units(quick=True)[0]
    result = features.measure(unit)
    assert result["own"]["FPFH"] == {"missing": "open3d is missing"}
    told = write_page("features", [Record(unit=unit, result=result)], tmp_path, quick=True)
    assert "| FPFH | open3d is missing |" in told
