"""Pictures and numbers of report.html."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from scanweld.app.html_report import numbers
from scanweld.app.html_report.colors import scan_colors
from scanweld.app.html_report.page import scan_looks
from scanweld.app.html_report.view_graph import draw_graph, round_order
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.shading import seen_from
from tests.results import a_pair


def test_scans_of_one_side_stand_together():
    names = [f"s{k}" for k in range(12)]
    shuffled = [names[k] for k in (0, 7, 2, 9, 4, 11, 6, 1, 8, 3, 10, 5)]
    ring = [
        dataclasses.replace(a_pair(names[k], names[(k + 1) % 12]), score=0.6) for k in range(12)
    ]
    order = round_order(shuffled, ring)  # type: ignore[arg-type]  # has what is asked of a pair
    gaps = {(int(b[1:]) - int(a[1:])) % 12 for a, b in pairwise(order)}
    assert gaps in ({1}, {11})


def test_labels_are_short_and_numbers_keep_their_zeros():
    for names, labels in (
        (["scan_1", "scan_2", "scan_10"], ["1", "2", "10"]),
        (["a_08", "a_09"], ["08", "09"]),
        (["the first of all", "another one"], ["1", "2"]),
    ):
        assert [look.label for look in scan_looks(names).values()] == labels
    assert len(set(scan_colors(60))) == 60


def test_the_drawing_has_every_scan_once():
    drawing = draw_graph([["a", "b"]], ["c"], [])
    assert sorted(node.name for node in drawing.nodes) == ["a", "b", "c"] and not drawing.links


@pytest.mark.parametrize(
    ("told", "wanted"),
    [
        (numbers.share(0.8625), "86\u00a0%"),
        (numbers.share(None), "–"),
        (numbers.score(float("nan")), "–"),
        (numbers.length(0.0005489, None), "0.000549"),
        (numbers.length(12.345, "mm"), "12.3\u00a0mm"),
        (numbers.length(0.0000503, "m"), "0.0503\u00a0mm"),
        (numbers.length(2.76, "m"), "2.76\u00a0m"),
        (numbers.length(0.0, None), "0"),
        (numbers.length(1.5e-7, None), "1.50·10⁻⁷"),
        (numbers.of_diameter(0.5, 250.0), "0.20\u00a0%"),
        (numbers.duration(61.04), "61.0\u00a0s"),
        (numbers.duration(404.4), "6 min 44 s"),
    ],
)
def test_numbers_as_people_read_them(told: str, wanted: str):
    assert told == wanted


def test_a_side_shades_every_colour_by_the_angle_to_the_viewer():
    square = TriangleMesh(
        vertices=np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    red = np.full((4, 3), (200, 0, 0), np.uint8)
    up = (0.0, 1.0, 0.0)
    facing = seen_from(square, (0, 0, 1), up, 40)
    assert (facing.shaded(red)[20, 20] == (200, 0, 0)).all()
    assert (facing.shaded()[20, 20] == (205, 205, 200)).all()  # grey without colours
    assert (facing.cutout(red)[20, 20] == (200, 0, 0, 255)).all()
    assert (facing.cutout(red)[0, 0] == 0).all() and (facing.shaded(red)[0, 0] == 255).all()
    oblique = seen_from(square, (np.sqrt(3), 0, 1), up, 40).shaded(red)  # 60 degrees aside
    row = oblique[20][(oblique[20] != 255).any(axis=1)]
    assert (row[len(row) // 2] == (round(200 * (0.15 + 0.85 * 0.5)), 0, 0)).all()
    behind = seen_from(square, (0, 0, -1), up, 40).shaded(red)
    assert (behind[20, 20] == (120, 140, 190)).all()
    lit = dataclasses.replace(square, normals=np.full((4, 3), (0.0, 0.6, 0.8)))
    assert seen_from(lit, (0, 0, 1), up, 40).shaded(red)[20, 20, 0] == round(200 * 0.83)
    assert seen_from(lit, (0, 0, 1), up, 40, smooth=False).shaded(red)[20, 20, 0] == 200
    mixed = facing.shaded(np.array([[0, 0, 0], [200, 0, 0], [200, 0, 0], [0, 0, 0]], np.uint8))
    reds = mixed[20, 3:37, 0].astype(int)
    assert (np.diff(reds) > 0).all() and abs(reds[17] - 100) < 6  # from black to red
