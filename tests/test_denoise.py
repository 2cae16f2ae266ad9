"""Range images of poor scans: what is smoothed, dropped, filled, and what is left alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanweld.preparation.denoise import clean_depth, has_gaps, noise_of, smoothing_radius

PIXEL = 0.5
MAX_STEP = 6 * PIXEL


def ramp(slope: float = 0.2, size: int = 60) -> np.ndarray:
    row, column = np.mgrid[:size, :size]
    return 100.0 + PIXEL * slope * (row + 0.5 * column)


def two_walls(size: int = 60) -> np.ndarray:
    depth = ramp(size=size)
    depth[:, size // 2 :] += 20 * PIXEL
    return depth


def noisy(depth: np.ndarray, sigma: float, seed: int = 0) -> np.ndarray:
    return depth + np.random.default_rng(seed).normal(scale=sigma, size=depth.shape)


def cleaned(depth: np.ndarray) -> np.ndarray:
    return clean_depth(depth, PIXEL, MAX_STEP)


@pytest.mark.parametrize("sigma", [0.1, 0.3, 1.0])
def test_noise_is_measured_beside_steps_and_gaps(sigma: float):
    depth = noisy(two_walls(), sigma)
    depth[np.random.default_rng(1).random(depth.shape) < 0.1] = np.nan
    assert noise_of(depth) == pytest.approx(sigma, rel=0.1)


def test_a_good_image_is_left_and_more_noise_takes_wider_neighbourhoods():
    depth = noisy(two_walls(), 0.1 * PIXEL)
    np.testing.assert_array_equal(cleaned(depth), depth)
    radii = [smoothing_radius(sigma) for sigma in (0.1, 0.3, 0.6, 1.0, 5.0)]
    assert radii == sorted(radii)
    assert radii[0] == 2 and radii[-1] == 4


@pytest.mark.parametrize("sigma_pixels", [0.5, 1.0, 2.0])
def test_noise_shrinks_several_times_and_steps_and_slopes_stay(sigma_pixels: float):
    truth = two_walls()
    error = cleaned(noisy(truth, sigma_pixels * PIXEL)) - truth
    inner = np.abs(error[5:-5, 5:-5])
    assert np.isfinite(inner).all()
    assert np.median(inner) < 0.67 * sigma_pixels * PIXEL / 3
    assert np.quantile(inner, 0.99) < 1.5 * sigma_pixels * PIXEL
    steep = ramp(slope=1.0)
    error = cleaned(noisy(steep, 0.5 * PIXEL)) - steep
    assert abs(np.mean(error[5:-5, 5:-5])) < 0.05 * PIXEL


def test_outliers_take_the_depth_of_their_neighbours():
    truth = ramp()
    rng = np.random.default_rng(3)
    hit = rng.random(truth.shape) < 0.2
    depth = np.where(hit, truth + rng.uniform(-40, 40, truth.shape), truth)
    # Outliers that are gaps besides make it a poor image: the rest is smooth.
    depth[rng.random(truth.shape) < 0.12] = np.nan
    error = np.abs(cleaned(depth) - truth)
    assert np.nanquantile(error, 0.97) < PIXEL
    assert np.isfinite(error[5:-5, 5:-5]).mean() > 0.97


def test_lost_returns_are_filled_and_nothing_grows_beyond_the_silhouette():
    truth = ramp()
    truth[:, 40:] = np.nan
    depth = truth.copy()
    depth[np.random.default_rng(5).random(depth.shape) < 0.3] = np.nan
    assert has_gaps(depth)
    filled = cleaned(depth)
    assert np.isfinite(filled[3:-3, 3:37]).mean() > 0.99
    assert np.nanmax(np.abs(filled - truth)[3:-3, 3:37]) < 0.05 * PIXEL
    assert np.isnan(filled[:, 41:]).all()
    nothing, rng = np.full((60, 60), np.nan), np.random.default_rng(7)
    scattered = np.where(rng.random((60, 60)) < 0.2, rng.uniform(50, 150, (60, 60)), np.nan)
    assert np.isfinite(cleaned(scattered)).mean() < 0.02
    assert np.isnan(cleaned(nothing)).all() and noise_of(nothing) == 0.0


@settings(max_examples=15, deadline=None)
@given(scale=st.floats(1e-4, 1e4), shift=st.floats(-10, 10))
def test_the_unit_and_the_distance_do_not_matter(scale: float, shift: float):
    depth = noisy(two_walls(30), 0.8 * PIXEL)
    plain = clean_depth(depth, PIXEL, MAX_STEP)
    scaled = clean_depth(scale * (depth + shift), scale * PIXEL, scale * MAX_STEP)
    np.testing.assert_allclose(scaled / scale - shift, plain, atol=1e-6)
