"""The paper's figures: pictures that show what is there, and numbers that come from the records."""

import sys
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy.ndimage import label
from scipy.spatial import KDTree

from benchmarks.paper import figures
from benchmarks.paper.drawing.bodies import balls, scan_body
from benchmarks.paper.drawing.placed import Scene
from benchmarks.paper.drawing.prunings import linked
from benchmarks.paper.drawing.scene import Body, look_at, render
from benchmarks.paper.drawing.shade import ambient_occlusion
from benchmarks.paper.drawing.sheet import Sheet
from benchmarks.paper.drawing.style import PAPER, SCANS, heat_colors
from benchmarks.paper.figures.heat_field import heat_field
from benchmarks.paper.figures.subjects import subject
from benchmarks.paper.study import Record
from benchmarks.paper.views import virtual_scan
from scanweld.config import ContoursConfig, HeatConfig
from scanweld.contours.coherence import contour_pair
from scanweld.contours.contour_sets import observe_contours
from scanweld.errors import InputError
from scanweld.heat.features import describe

BEFORE, ASIDE = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
DOWN_IS_Y = (0.0, -1.0, 0.0)
RED, BLUE = np.array([0.9, 0.1, 0.1]), np.array([0.1, 0.1, 0.9])


def square(depth: float, color: np.ndarray, half: float = 1.0) -> Body:
    """A square across the z axis that looks towards -z."""
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    return Body(
        vertices=corners + np.array([0.0, 0.0, depth]),
        faces=np.array([[0, 2, 1], [0, 3, 2]]),
        normals=None,
        colors=np.broadcast_to(color, (4, 3)),
    )


def is_paper(picture: np.ndarray) -> np.ndarray:
    return (picture == np.rint(255 * PAPER)).all(axis=-1)


def test_a_ball_is_a_disc_where_the_look_says_it_lies():
    centre = np.array([[0.3, -0.2, 5.0]])
    frame = np.array([[-1.0, -1, 4], [1, 1, 6]])
    look = look_at(frame, BEFORE, DOWN_IS_Y, 120, 100, margin=0.0)
    seen = ~is_paper(render([balls(centre, 0.4, RED)], look))
    rows, columns = np.nonzero(seen)
    assert np.allclose([columns.mean(), rows.mean()], look.pixels(centre)[0], atol=0.5)
    assert seen.sum() == pytest.approx(np.pi * (0.4 * look.camera.fx) ** 2, rel=0.05)


def test_what_is_nearer_hides_what_is_behind_in_any_order():
    near, far = square(1.0, RED, 0.5), square(2.0, BLUE)
    look = look_at(far.vertices, BEFORE, DOWN_IS_Y, 40, 40)
    one, other = render([near, far], look), render([far, near], look)
    assert (one == other).all()
    assert one[20, 20, 0] > one[20, 20, 2]
    assert one[5, 5, 2] > one[5, 5, 0]


def test_the_inside_of_a_surface_is_greyer_and_darker():
    body = square(0.0, RED)
    outside = render([body], look_at(body.vertices, BEFORE, DOWN_IS_Y, 20, 20))[10, 10]
    inside = render([body], look_at(body.vertices, (0, 0, 1.0), DOWN_IS_Y, 20, 20))[10, 10]
    assert np.ptp(inside.astype(int)) < np.ptp(outside.astype(int))
    assert inside.max() < outside.max()


def test_a_valley_is_in_the_shade_and_a_plane_and_a_ridge_are_not():
    across = np.abs(np.linspace(-1, 1, 101))
    # Depth grows away from the viewer: the valley's middle is the farthest.
    valley, ridge, plane = (np.tile(s * across, (80, 1)) for s in (-1.0, 1.0, 0.0))
    of_valley, of_ridge, of_plane = (
        ambient_occlusion(depth, 50.0)[40, 50] for depth in (valley, ridge, plane)
    )
    assert of_plane == pytest.approx(1.0)
    assert of_ridge > 0.9
    assert of_valley < 0.75


def test_shade_does_not_fall_from_what_stands_far_in_front():
    depth = np.zeros((60, 60))
    depth[:, :30] = -1000.0
    assert ambient_occlusion(depth, 1.0)[30, 34] > 0.95


@given(st.sets(st.tuples(st.integers(0, 7), st.integers(0, 7)), min_size=1))
def test_links_join_exactly_what_touches(there: set[tuple[int, int]]):
    pixels = np.array(sorted(there))
    segments = linked(pixels)
    assert (np.abs(segments[:, 0] - segments[:, 1]) <= 1).all()
    assert {tuple(end) for end in segments.reshape(-1, 2).astype(int)} == there
    image = np.zeros((8, 8), bool)
    image[tuple(pixels.T)] = True
    _, count = cast(tuple[np.ndarray, int], label(image, np.ones((3, 3))))
    parent = {pixel: pixel for pixel in there}

    def root(pixel: tuple[int, int]) -> tuple[int, int]:
        while parent[pixel] != pixel:
            pixel = parent[pixel]
        return pixel

    for start, end in segments.astype(int):
        parent[root(tuple(start))] = root(tuple(end))
    assert len({root(pixel) for pixel in there}) == count


def test_heat_runs_from_cold_to_hot():
    cold, middle, hot = heat_colors(np.array([-5.0, 0.5, 7.0]), 0.0, 1.0)
    assert cold[2] > cold[0]
    assert hot[0] > hot[2]
    assert middle.min() > max(cold.min(), hot.min())


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


def test_prunings_leave_what_coheres(pruned: Record):
    coherence = pruned.result["coherence"]
    assert coherence["none"] < coherence["1"]
    assert coherence["none"] < coherence["1, 2 and 3"]


def test_cuts_through_true_poses_lie_on_the_cut_through_the_object():
    views = [virtual_scan("creature", azimuth) for azimuth in (45.0, 105.0)]
    scene = Scene("creature", views, 60, 60, 0.45, (1.0, 1.0))
    true = {k: views[0].from_other(view) for k, view in enumerate(views)}
    on_object = KDTree(scene.object_cut().reshape(-1, 3))
    for k, pose in scene.in_world(true).items():
        cut = scene.scan_cut(k, pose).reshape(-1, 3)
        away, _ = on_object.query(cut)
        assert len(cut) > 20
        assert np.median(away) < views[k].scan.image.pixel
        assert np.allclose(cut @ scene.up, scene.level)


def test_a_scan_in_a_scene_has_its_colour():
    view = virtual_scan("creature", 60.0)
    body = scan_body(view.scan, SCANS[1])
    picture = render([body], look_at(body.vertices, BEFORE, DOWN_IS_Y, 60, 60))
    mean = picture[~is_paper(picture)].mean(axis=0)
    assert mean[2] > mean[1] > mean[0]


def test_a_sheet_keeps_its_panels_to_the_pixel(tmp_path: Path):
    panel = np.zeros((20, 30, 3), np.uint8)
    panel[:10], panel[10:] = (255, 0, 0), (0, 0, 255)
    sheet = Sheet(100, 80)
    sheet.place(panel, 40, 25)
    sheet.save(tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as image:
        assert image.size == (100, 80)
        picture = np.asarray(image.convert("RGB"), int)
    assert np.abs(picture[25:45, 40:70] - panel).max() <= 2
    outside = np.ones((80, 100), bool)
    outside[25:45, 40:70] = False
    assert np.abs(picture[outside] - np.rint(255 * PAPER)).max() <= 2


def test_the_page_shows_pictures_that_stand_and_numbers_of_the_records(
    pruned: Record, tmp_path: Path
):
    text = figures.page([pruned], tmp_path)
    (picture,) = tmp_path.glob("*.png")
    assert f"]({picture.name})" in text
    assert picture.stat().st_size <= 400_000
    for name in ("observed_second", "predicted_first", "predicted_third", "predicted_kept"):
        assert f"{len(pruned.result[name]):,}" in text
    before = picture.read_bytes()
    figures.page([pruned], tmp_path)
    assert picture.read_bytes() == before, "not the same bytes again"


def test_a_gallery_says_how_many_runs_are_right(tmp_path: Path):
    unit = next(unit for unit in figures.units(quick=True) if unit["figure"] == "gallery")
    record = Record(unit=unit, result=figures.measure(unit))
    for method in ("m-icc", "mm-icc"):
        result = record.result[method]
        assert (result["converged"] == 1) == (
            result["rotation_deg"] < 2 and result["translation_percent"] < 1
        )
    assert "fig6a-gallery-creature.png" in figures.page([record], tmp_path)


def test_without_matplotlib_the_page_names_the_remedy(
    pruned: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"matplotlib.*pip install 'scanweld\[bench\]'"):
        figures.page([pruned], tmp_path)


def test_a_missing_scan_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SCANWELD_DATA", str(tmp_path))
    with pytest.raises(InputError, match=r"bun045\.ply: is missing; put the scan there"):
        subject("bun045", None)
