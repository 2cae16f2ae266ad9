"""The paper's figures: pictures that show what is there, and numbers that come from the records."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import KDTree

from benchmarks.paper import figures
from benchmarks.paper.drawing import (
    PAPER,
    Panel,
    balls,
    colored,
    draw_sheet,
    look_at,
    render,
    rgb,
)
from benchmarks.paper.heat_field import heat_field
from benchmarks.paper.pages import write_page
from benchmarks.paper.placed import Placed
from benchmarks.paper.views import virtual_scan
from benchmarks.study.study import Record
from scanweld.config import ContoursConfig, HeatConfig
from scanweld.contours.coherence import contour_pair
from scanweld.contours.contour_sets import observe_contours
from scanweld.geometry.mesh import TriangleMesh
from scanweld.heat.features import describe

BEFORE, ASIDE = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
DOWN_IS_Y = (0.0, -1.0, 0.0)
RED, BLUE = "#E61A1A", "#1A1AE6"


def square(depth: float, color: str, half: float = 1.0) -> TriangleMesh:
    """A square across the z axis that looks towards -z."""
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    return colored(TriangleMesh(vertices=corners + np.array([0.0, 0.0, depth]), faces=faces), color)


def is_paper(picture: np.ndarray) -> np.ndarray:
    return (picture == rgb(PAPER)).all(axis=-1)


def test_a_ball_is_a_disc_where_the_look_says_it_lies():
    centre = np.array([[0.3, -0.2, 5.0]])
    frame = np.array([[-1.0, -1, 4], [1, 1, 6]])
    look = look_at(frame, BEFORE, DOWN_IS_Y, (120, 100), margin=0.0)
    seen = ~is_paper(render([balls(centre, 0.4, RED)], look))
    rows, columns = np.nonzero(seen)
    assert np.allclose([columns.mean(), rows.mean()], look.pixels(centre)[0], atol=0.5)
    radius = np.linalg.norm(look.pixels(centre + np.array([0.4, 0, 0])) - look.pixels(centre))
    assert seen.sum() == pytest.approx(np.pi * radius**2, rel=0.05)


def test_what_is_nearer_hides_what_is_behind_in_any_order():
    near, far = square(1.0, RED, 0.5), square(2.0, BLUE)
    look = look_at(far.vertices, BEFORE, DOWN_IS_Y, (40, 40))
    one, other = render([near, far], look), render([far, near], look)
    assert (one == other).all()
    assert one[20, 20, 0] > one[20, 20, 2]
    assert one[5, 5, 2] > one[5, 5, 0]


def test_the_inside_of_a_surface_is_greyer_and_darker():
    body = square(0.0, RED)
    outside = render([body], look_at(body.vertices, BEFORE, DOWN_IS_Y, (20, 20)))[10, 10]
    inside = render([body], look_at(body.vertices, (0, 0, 1.0), DOWN_IS_Y, (20, 20)))[10, 10]
    assert np.ptp(inside.astype(int)) < np.ptp(outside.astype(int))
    assert inside.max() < outside.max()


def test_stages_of_the_heat_end_in_the_keypoints_of_the_library():
    scan = virtual_scan("creature", 60.0).scan
    field, features = heat_field(scan), describe(scan, HeatConfig())
    assert np.allclose(field.front.points[field.grouped], features.points)
    found = {tuple(point) for point in field.front.points[field.found]}
    assert {tuple(point) for point in features.found_at} <= found
    assert np.allclose(field.signature[field.grouped], features.signatures)


@pytest.fixture(scope="module")
def pruned() -> Record:
    unit = {"figure": "prunings", "object": "creature", "azimuths_deg": [45.0, 105.0]}
    return Record(unit=unit, result=figures.measure(unit))


def test_pruned_contours_are_those_of_the_library(pruned: Record):
    i, j = (virtual_scan("creature", azimuth) for azimuth in pruned.unit["azimuths_deg"])
    a, b = (observe_contours(view.scan, ContoursConfig()) for view in (i, j))
    config, result, j_from_i = ContoursConfig(), pruned.result, j.from_other(i)

    def pixels(*names: str) -> set[tuple[int, int]]:
        sets = [{(u, v) for u, v in result[name]} for name in names]
        assert sum(map(len, sets)) == len(set.union(*sets)), "a point is in two sets"
        return set.union(*sets)

    def has(points: np.ndarray) -> set[tuple[int, int]]:
        return {(int(u), int(v)) for u, v in points}

    pair = contour_pair(a, b, j_from_i, config)
    assert pixels("predicted_kept") == has(pair.predicted.pixels)
    assert pixels("observed_kept") == has(pair.observed.pixels)
    first = contour_pair(
        a, b, j_from_i, config.model_copy(update={"prunings": ("self-occlusion",)})
    )
    assert pixels("predicted_kept", "predicted_third") == has(first.predicted.pixels)
    none = contour_pair(a, b, j_from_i, config.model_copy(update={"prunings": ()}))
    assert pixels("predicted_kept", "predicted_third", "predicted_first") == has(
        none.predicted.pixels
    )
    assert pixels("observed_kept", "observed_second") == has(none.observed.pixels)


def test_cuts_through_true_poses_lie_on_the_cut_through_the_object():
    views = [virtual_scan("creature", azimuth) for azimuth in (45.0, 105.0)]
    scene = Placed("creature", views, (60, 60), (1.0, 1.0))
    true = {k: views[0].from_other(view) for k, view in enumerate(views)}
    on_object = KDTree(scene.cut(scene.mesh).reshape(-1, 3))
    for view, mesh in zip(views, scene.in_world(true), strict=True):
        cut = scene.cut(mesh).reshape(-1, 3)
        away, _ = on_object.query(cut)
        assert len(cut) > 20
        assert np.median(away) < view.scan.image.pixel
        assert np.allclose(cut @ scene.up, scene.level)


def test_a_sheet_keeps_its_panels_to_the_pixel(tmp_path: Path):
    picture = np.zeros((20, 300, 3), np.uint8)
    picture[:10], picture[10:] = (255, 0, 0), (0, 0, 255)
    draw_sheet([[Panel(picture=picture)]], tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as image:
        shown = np.asarray(image.convert("RGB"), int)
    inside = ~is_paper(shown)
    rows, columns = np.nonzero(inside)
    box = shown[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    assert box.shape == picture.shape
    assert np.abs(box - picture).max() <= 2


def test_the_page_shows_pictures_that_stand_and_numbers_of_the_records(
    pruned: Record, tmp_path: Path
):
    text = write_page("figures", [pruned], tmp_path, quick=True)
    (picture,) = tmp_path.glob("*.png")
    assert f"]({picture.name})" in text
    assert picture.stat().st_size <= 400_000
    for name in ("observed_second", "predicted_first", "predicted_third", "predicted_kept"):
        assert f"{len(pruned.result[name]):,}" in text
    before = picture.read_bytes()
    write_page("figures", [pruned], tmp_path, quick=True)
    assert picture.read_bytes() == before, "not the same bytes again"
