"""Camera models: projecting and unprojecting undo each other, and mean what they say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera, CameraModel

MODELS = list(CameraModel)


def camera_of(model: CameraModel) -> Camera:
    return Camera(model=model, width=40, height=30, fx=50.0, fy=60.0, cx=17.25, cy=14.5)


@st.composite
def cameras_with_points(draw: st.DrawFn) -> tuple[Camera, FloatArray]:
    """Any camera, and points before it (all around it where it sees all around)."""
    model = draw(st.sampled_from(MODELS))
    points = draw(arrays(np.float64, (5, 3), elements=st.floats(-100.0, 100.0)))
    if model is not CameraModel.SPHERICAL:
        points[:, 2] = np.abs(points[:, 2]) + 1.0
    else:
        points += np.where(np.hypot(points[:, 0], points[:, 2]) < 1e-3, 1.0, 0.0)[:, None]
    width, height = (draw(st.integers(1, 2000)) for _ in range(2))
    fx, fy = (draw(st.floats(0.01, 5000.0)) for _ in range(2))
    cx, cy = (draw(st.floats(-100.0, 2000.0)) for _ in range(2))
    return Camera(model=model, width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy), points


@given(cameras_with_points())
def test_unproject_undoes_project_and_view_directions_are_the_rays(
    drawn: tuple[Camera, FloatArray],
):
    camera, points = drawn
    pixels, depth = camera.project(points)
    np.testing.assert_allclose(camera.unproject(pixels, depth), points, atol=1e-5, rtol=1e-6)
    away = camera.view_directions(points)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 1.0)
    step = camera.unproject(pixels, 1.5 * depth) - points
    np.testing.assert_allclose(step, np.linalg.norm(step, axis=1)[:, None] * away, atol=1e-4)


@pytest.mark.parametrize("model", MODELS)
def test_an_image_unprojects_pixel_by_pixel(model: CameraModel):
    camera = camera_of(model)
    depth = np.random.default_rng(3).uniform(2, 5, size=(30, 40))
    depth[4, 7] = np.nan
    points = camera.unproject_image(depth)
    assert np.isnan(points[4, 7]).any() and np.isfinite(points[4, 8]).all()
    pixels, found = camera.project(points)
    rows, columns = np.mgrid[:30, :40]
    has = np.isfinite(depth)
    np.testing.assert_allclose(pixels[has], np.stack([columns, rows], axis=-1)[has], atol=1e-9)
    np.testing.assert_allclose(found[has], depth[has])


ELEVATION = np.arctan2(4, np.hypot(3, 12))


@pytest.mark.parametrize(
    ("model", "x", "y", "distance"),
    [
        (CameraModel.PINHOLE, 3 / 12, 4 / 12, 12),
        (CameraModel.ORTHOGRAPHIC, 3, 4, 12),
        (CameraModel.SPHERICAL, np.arctan2(3, 12), ELEVATION, 13),
    ],
)
def test_the_formulas_of_the_models_whose_axes_point_right_down_and_away(
    model: CameraModel, x: float, y: float, distance: float
):
    pixels, depth = camera_of(model).project(np.array([[3.0, 4.0, 12.0]]))
    np.testing.assert_allclose(pixels, [[50 * x + 17.25, 60 * y + 14.5]])
    assert depth == pytest.approx(distance)


def test_behind_the_sensor():
    pixels, _ = camera_of(CameraModel.PINHOLE).project(np.array([[0, 0, -1.0], [1, 1, 0.0]]))
    assert np.isnan(pixels).all()
    pixels, depth = camera_of(CameraModel.SPHERICAL).project(np.array([[0.0, 0, -2]]))
    np.testing.assert_allclose(pixels, [[50 * np.pi + 17.25, 14.5]])
    assert depth == pytest.approx(2)


@pytest.mark.parametrize("model", MODELS)
def test_the_footprint_is_the_distance_between_neighbouring_pixels(model: CameraModel):
    camera = Camera(model=model, width=9, height=9, fx=80, fy=80, cx=4, cy=4)
    points = camera.unproject(np.array([[4.0, 4], [5, 4], [4, 5]]), np.full(3, 7.0))
    apart = np.linalg.norm(points[1:] - points[0], axis=1)
    np.testing.assert_allclose(apart, camera.footprint(7.0), rtol=1e-4)


@pytest.mark.parametrize(
    "wrong",
    [{"width": 0}, {"height": -1}, {"fx": 0.0}, {"fy": -2.0}, {"fx": np.nan}, {"cx": np.inf}],
)
def test_cameras_that_cannot_be_are_refused(wrong: dict[str, float]):
    right = {"width": 4, "height": 4, "fx": 1.0, "fy": 1.0, "cx": 0.0, "cy": 0.0}
    with pytest.raises(ValueError):
        Camera(model=CameraModel.PINHOLE, **(right | wrong))  # type: ignore[arg-type]
