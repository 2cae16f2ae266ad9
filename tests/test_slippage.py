"""Which way pairs slide: exact surfaces, rendered ones with noise, and what must not slide."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from scanweld.config import PairsConfig
from scanweld.evaluation.primitives import cylinder, plate, sphere
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evidence.information import TURN_SCALE, information_of
from scanweld.evidence.slippage import Slide, slide_words, slippage_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.pairs.result import PairKind
from tests.bodies import knobbed, lathed, registered, seen_twice, star, vase
from tests.prepared import PreparedPair
from tests.scenes import random_motion, small_creature

CONFIG = PairsConfig()
Surface = Callable[[FloatArray, FloatArray], FloatArray]
"""Points of a surface about the z axis by two parameters between 0 and 1."""


def on_plane(u: FloatArray, v: FloatArray) -> FloatArray:
    return np.stack([u, 0.6 * v, 0 * u], axis=-1)


def on_sphere(u: FloatArray, v: FloatArray) -> FloatArray:
    turn, level = 2.0 * u, 1.6 * v - 0.8
    return np.stack([np.cos(turn) * np.cos(level), np.sin(turn) * np.cos(level), np.sin(level)], -1)


def about_z(radius: Surface, rise: float = 0.0) -> Surface:
    """A radius by turn (radians) and level; the surface rises as it turns."""

    def surface(u: FloatArray, v: FloatArray) -> FloatArray:
        turn, r = 2.4 * u, radius(2.4 * u, v)
        return np.stack([r * np.cos(turn), r * np.sin(turn), v + rise * turn], axis=-1)

    return surface


def bumpy(u: FloatArray, v: FloatArray) -> FloatArray:
    return np.stack([u, v, 0.1 * np.sin(7 * u) * np.cos(5 * v) + 0.2 * u * v * v], axis=-1)


EXACT: dict[str, tuple[Slide | None, Surface]] = {
    "plane": (Slide.PLANE, on_plane),
    "sphere": (Slide.SPHERE, on_sphere),
    "cylinder": (Slide.CYLINDER, about_z(lambda t, h: 0.4 + 0 * h)),
    "cone": (Slide.REVOLUTION, about_z(lambda t, h: 0.6 - 0.5 * h)),
    "vase": (Slide.REVOLUTION, about_z(lambda t, h: 0.4 + 0.1 * np.sin(5 * h))),
    "star": (Slide.EXTRUSION, about_z(lambda t, h: 0.4 + 0.1 * np.cos(5 * t))),
    "screw": (Slide.HELIX, about_z(lambda t, h: 0.4 + 0.1 * np.sin(5 * h), rise=0.15)),
    "bumps": (None, bumpy),
}


def exact_information(surface: Surface, motion: Pose) -> tuple[FloatArray, FloatArray]:
    """Information of a surface that is moved, lengths in diameters, and the middle of it."""
    u, v = np.meshgrid(*2 * [np.linspace(0, 1, 30)])
    along_u = surface(u + 1e-6, v) - surface(u - 1e-6, v)
    along_v = surface(u, v + 1e-6) - surface(u, v - 1e-6)
    normals = np.cross(along_u, along_v).reshape(-1, 3)
    normals = motion.turn(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    points = motion.apply(surface(u, v).reshape(-1, 3))
    middle = points.mean(axis=0)
    rows = np.column_stack([TURN_SCALE * np.cross(points - middle, normals), normals])
    return rows.T @ rows / len(rows), middle


@pytest.mark.parametrize("name", list(EXACT))
def test_exact_surfaces_are_named_wherever_they_stand(name: str):
    slide, surface = EXACT[name]
    for seed in range(5):
        motion = random_motion(np.random.default_rng(seed), 5.0)
        information, middle = exact_information(surface, motion)
        found = slippage_of(information, CONFIG.min_observability)
        assert (None if found is None else found.slide) is slide
        if found is None:
            continue
        axis = motion.turn(np.array([0.0, 0.0, 1.0]))
        if slide is not Slide.SPHERE:
            assert found.axis is not None and abs(found.axis @ axis) == pytest.approx(1.0, abs=1e-6)
        if found.point is None:
            assert slide in (Slide.PLANE, Slide.EXTRUSION)
            continue
        off = middle + found.point - motion.translation
        if slide is not Slide.SPHERE:
            off -= (off @ axis) * axis
        np.testing.assert_allclose(off, 0.0, atol=1e-5)


def test_information_turns_with_the_scans():
    """Seen in another frame the same motion is free."""
    information, _ = exact_information(EXACT["vase"][1], Pose.identity())
    rng = np.random.default_rng(3)
    for _ in range(5):
        turn = random_rotation(rng)
        both = np.kron(np.eye(2), turn)
        found = slippage_of(both @ information @ both.T, CONFIG.min_observability)
        assert found is not None and found.axis is not None
        np.testing.assert_allclose(abs(found.axis @ turn[:, 2]), 1.0, atol=1e-9)


def test_motions_that_no_surface_has_are_several_ways():
    """Two turns about crossing axes and a shift; or all, where nothing matches."""
    for information in (np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 0.0]), np.zeros((6, 6))):
        found = slippage_of(information, CONFIG.min_observability)
        assert found is not None and found.slide is Slide.MANY
    assert slippage_of(exact_information(on_sphere, Pose.identity())[0], 0.0) is None


RENDERED: dict[str, tuple[Slide | None, Callable[[], TriangleMesh], float]] = {
    "plate": (Slide.PLANE, plate, 80.0),
    "sphere": (Slide.SPHERE, sphere, 10.0),
    "side of a cylinder": (Slide.CYLINDER, cylinder, 0.0),
    "cylinder": (Slide.REVOLUTION, cylinder, 25.0),
    "cone": (Slide.REVOLUTION, lambda: lathed(lambda turn, level: 60.0 - 59.9 * level), 20.0),
    "vase": (Slide.REVOLUTION, lambda: lathed(vase), 10.0),
    "star": (Slide.EXTRUSION, lambda: lathed(star), 0.0),
    "star with its end": (None, lambda: lathed(star), 25.0),
    "knobbed vase": (None, lambda: lathed(knobbed), 10.0),
    "creature": (None, small_creature, 10.0),
}
NOISES = (0.0, 2.5e-3)


@lru_cache
def rendered_pair(name: str, noise: float, gap: float = 20.0) -> PreparedPair:
    _, make, elevation = RENDERED[name]
    model = NoiseModel(depth_diameters=noise)
    view = {"azimuth_deg": 40.0, "rolls_deg": (0.0, 70.0), "pixels": 140.0}
    return seen_twice(make(), gap, elevation, model, **view)


def true_information(pair: PreparedPair) -> tuple[FloatArray, float]:
    radius = CONFIG.tolerance_diameters[2] * pair.diameter
    return information_of(*pair.fields, pair.i_from_j, radius, pair.diameter)[:2]


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("name", list(RENDERED))
def test_rendered_surfaces_are_named_under_noise(name: str, noise: float):
    slide, _, elevation = RENDERED[name]
    pair = rendered_pair(name, noise)
    information, rms = true_information(pair)
    found = slippage_of(information, CONFIG.min_observability)
    assert (None if found is None else found.slide) is slide
    if found is not None and slide is not Slide.SPHERE:
        # In the sensor frame z, up in the object, is up in the image and tilted towards the sensor.
        tilt = np.radians(elevation)
        up = np.array([0.0, -np.cos(tilt), -np.sin(tilt)])
        assert found.axis is not None
        assert np.degrees(np.arccos(min(1.0, abs(float(found.axis @ up))))) < 3.0
    if name == "vase":
        # Its axis passes through the middle of the image.
        assert found is not None and found.point is not None
        assert abs(found.point[0]) < 0.06 and 0.05 < np.linalg.norm(found.point) < 0.3
    if name == "sphere":
        # J J^T gains with noise; what two scans with noise of their own share does not.
        eigenvalues = np.linalg.eigvalsh(information)
        assert eigenvalues[2] < 1e-4 * eigenvalues[-1] and eigenvalues[3] > 0.1 * eigenvalues[-1]
        assert rms < 0.004 * pair.diameter


@pytest.mark.parametrize("name", ["sphere", "vase", "star"])
def test_noise_of_a_quarter_percent_hides_no_sliding_pair(name: str):
    result = registered(rendered_pair(name, 2.5e-3, 60.0))
    assert result.kind is PairKind.SLIDING
    assert result.sliding is not None and result.sliding.slide is RENDERED[name][0]
    assert slide_words(result.sliding.slide) in result.reason and "free to" in result.reason
    assert result.observability < CONFIG.min_observability
