"""Figure 1: from a scan to its PA-HKS keypoints."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.drawing.bodies import balls, scan_body, wired_body
from benchmarks.paper.drawing.scene import Body, Look, look_at, render
from benchmarks.paper.drawing.sheet import WIDTH, Sheet, draw_segments
from benchmarks.paper.drawing.style import ACCENT, BACK_PLANE, CLAY, INK, SCANS, WALL
from benchmarks.paper.figures.heat_field import heat_field
from scanweld.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from scanweld.geometry.prepared import PreparedScan

_FROM_FRONT = (0.30, -0.12, -1.0)
_FROM_BEHIND = (1.0, -0.42, 0.36)
_UP = (0.0, -1.0, 0.0)
_BALL = 0.0135
"""Radius of a keypoint, in diameters."""
_HEIGHT, _FOOT, _TOP = 430, 108, 18
_GREEN = SCANS[3]

Picture = tuple[ByteArray, FloatArray, str, str]
"""A rendered picture, segments (N, 2, 2) drawn over it, what it is, and a quieter note."""


def draw(rows: Sequence[tuple[PreparedScan, Mapping[str, Any]]], path: Path) -> None:
    """Draw a row for each scan and what was measured of it."""
    sheet = Sheet(WIDTH, _TOP + len(rows) * (_HEIGHT + _FOOT))
    width = WIDTH // 4
    letters = iter("abcdefgh")
    for row, (scan, result) in enumerate(rows):
        top = _TOP + row * (_HEIGHT + _FOOT)
        pictures = _pictures(scan, result, width - 24, _HEIGHT)
        for column, (picture, shifts, text, note) in enumerate(pictures):
            axes = sheet.place(picture, column * width + 12, top)
            draw_segments(axes, shifts, ACCENT, 2.6)
            middle = (column + 0.5) * width
            sheet.caption(next(letters), text, middle, top + _HEIGHT + 32, note)
    sheet.save(path)


def _pictures(
    scan: PreparedScan, result: Mapping[str, Any], width: int, height: int
) -> list[Picture]:
    field = heat_field(scan)
    before, after, grouped = (np.array(result[k]) for k in ("before", "after", "grouped"))
    look = look_at(scan.mesh.vertices, _FROM_FRONT, _UP, width, height)
    behind = look_at(field.mesh.vertices, _FROM_BEHIND, _UP, width, height)
    pale, radius = scan_body(scan, CLAY), _BALL * scan.diameter
    shifted = np.linalg.norm(after - before, axis=1) > 1e-6 * scan.diameter
    none = np.zeros((0, 2, 2))
    marks = [
        pale,
        balls(after, radius, INK),
        balls(before[shifted], 0.8 * radius, ACCENT),
    ]
    return [
        (
            render([scan_body(scan, _GREEN)], look),
            none,
            "range scan",
            f"{result['pixels']:,} pixels",
        ),
        (
            render([_artificial(scan)], behind),
            none,
            "artificial mesh",
            f"{result['front_faces']:,} + {result['other_faces']:,} faces",
        ),
        (
            render(marks, look),
            _shifts(look, before[shifted], after[shifted]),
            "shifted to the front",
            f"{len(after)} maxima, {result['moved']} moved off the rim",
        ),
        (
            render([pale, balls(grouped, radius, INK)], look),
            none,
            "grouped",
            f"{len(grouped)} keypoints",
        ),
    ]


def _artificial(scan: PreparedScan) -> Body:
    field = heat_field(scan)
    mesh = field.mesh
    colors = np.broadcast_to(WALL, mesh.faces.shape).copy()
    colors[: len(field.front.faces)] = _GREEN
    colors[_is_back(mesh.vertices, mesh.faces, mesh.num_front)] = BACK_PLANE
    return wired_body(mesh.vertices, mesh.faces, colors)


def _is_back(vertices: FloatArray, faces: IntArray, num_front: int) -> BoolArray:
    """Faces (F,) that lie in a plane of constant depth behind the front."""
    depth = vertices[:, 2][faces]
    flat = np.ptp(depth, axis=1) < 1e-9 * np.ptp(vertices[:, 2])
    return flat & (faces >= num_front).all(axis=1)


def _shifts(look: Look, before: FloatArray, after: FloatArray) -> FloatArray:
    return np.stack([look.pixels(before), look.pixels(after)], axis=1)
