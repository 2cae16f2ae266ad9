"""Figure 5b: the heat kernel signature on adjacent views, in colours."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.drawing.bodies import balls, scan_body
from benchmarks.paper.drawing.scene import look_at, render
from benchmarks.paper.drawing.sheet import WIDTH, Sheet
from benchmarks.paper.drawing.style import INK, QUIET, heat_colors
from benchmarks.paper.figures.heat_field import heat_field
from scanweld.geometry.arrays import ByteArray
from scanweld.geometry.prepared import PreparedScan

FROM_SENSOR = (0.0, 0.0, -1.0)
UP = (0.0, -1.0, 0.0)
_HEIGHT, _TOP, _LEFT, _FOOT = 400, 16, 190, 64
_BALL = 0.014


def draw(
    scans: Sequence[PreparedScan],
    titles: Sequence[str],
    results: Sequence[Mapping[str, Any]],
    path: Path,
) -> None:
    """Draw a row for each time and a column for each scan.

    Args:
        scans: Views of one object, adjacent ones side by side.
        titles: Of the scans.
        results: For each time its name, index, value, and the colours' range.
        path: Of the PNG.
    """
    sheet = Sheet(WIDTH, _TOP + len(results) * _HEIGHT + _FOOT)
    width = (WIDTH - _LEFT - 10) // len(scans)
    for row, result in enumerate(results):
        top = _TOP + row * _HEIGHT
        for column, scan in enumerate(scans):
            picture = heated(scan, result["index"], result["range"], width - 16, _HEIGHT - 16)
            sheet.place(picture, _LEFT + column * width + 8, top + 8)
        _scale(sheet, result, top)
    for column, title in enumerate(titles):
        sheet.write(title, _LEFT + (column + 0.5) * width, sheet.height - 30)
    sheet.save(path)


def heated(
    scan: PreparedScan, time: int, extent: Sequence[float], width: int, height: int
) -> ByteArray:
    """A scan as its sensor sees it, in the colours of its heat, with its keypoints."""
    field = heat_field(scan)
    colors = heat_colors(field.on_mesh(scan, time), *extent)
    marks = balls(field.front.points[field.grouped], _BALL * scan.diameter, INK)
    look = look_at(scan.mesh.vertices, FROM_SENSOR, UP, width, height)
    return render([scan_body(scan, colors), marks], look)


def _scale(sheet: Sheet, result: Mapping[str, Any], top: float) -> None:
    """The colours of a row, with the values at their ends."""
    low, high = result["range"]
    ramp = heat_colors(np.linspace(1.0, 0.0, 220), 0.0, 1.0)
    bar = np.rint(255 * np.broadcast_to(ramp[:, None], (220, 22, 3))).astype(np.uint8)
    middle = top + 0.5 * _HEIGHT
    sheet.write(f"{result['name']} time", 24, middle - 168, align="left")
    sheet.write(
        f"$t$ = {_power(result['time'])} $D^2$",
        24,
        middle - 135,
        size=22,
        color=QUIET,
        align="left",
    )
    sheet.place(bar, 26, middle - 106)
    for value, at in ((high, -96), (0.5 * (low + high), 4), (low, 104)):
        sheet.write(
            f"{value:.1f}".replace("-", "\N{MINUS SIGN}"),
            60,
            middle + at,
            size=22,
            color=QUIET,
            align="left",
        )


def _power(value: float) -> str:
    return f"{value:.4f}".rstrip("0")
