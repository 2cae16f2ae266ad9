"""Figures 2 and 3: what the three prunings take from contours, in the image of camera j."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.drawing.bodies import scan_body
from benchmarks.paper.drawing.scene import Body, Look, render
from benchmarks.paper.drawing.sheet import WIDTH, Sheet, draw_segments
from benchmarks.paper.drawing.style import ACCENT, CLAY, INK, PAPER, QUIET, SCANS, SECOND
from benchmarks.paper.views import VirtualScan
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose

OBSERVED, PREDICTED = INK, SCANS[1]
FIRST, SECOND_COLOR, THIRD = SCANS[2], SECOND, ACCENT
_HEIGHT, _TOP, _FOOT = 660, 16, 150
_MARGIN = 0.05
_LINE, _BEHIND = 1.1, 2.1
"""Widths of contours, in pixels of the range image."""
_PALE = 0.55

Dots = list[tuple[str, str, FloatArray]]
"""Name of a set of pixels, how it is called, its colour; drawn in this order."""

_OF_OBSERVED: Dots = [
    ("observed_kept", "kept", OBSERVED),
    ("observed_second", "pruning 2: camera $i$ cannot see it", SECOND_COLOR),
]
_OF_PREDICTED: Dots = [
    ("predicted_first", "pruning 1: scan $i$ ends here", FIRST),
    ("predicted_third", "pruning 3: camera $j$ cannot see it", THIRD),
    ("predicted_kept", "kept", PREDICTED),
]
_OF_BOTH: Dots = [
    ("observed_kept", "observed", OBSERVED),
    ("predicted_kept", "predicted", PREDICTED),
]


def draw(i: VirtualScan, j: VirtualScan, result: Mapping[str, Any], path: Path) -> None:
    """Draw the contours that scan j shows and those that scan i predicts, and what is left.

    Args:
        i: The scan that predicts.
        j: The scan whose camera observes.
        result: Pixels (u, v) of each set of contour points.
        path: Of the PNG.
    """
    sheet = Sheet(WIDTH, _TOP + _HEIGHT + _FOOT)
    width = WIDTH // 3
    look = _through(j, width - 20, _HEIGHT)
    own = scan_body(j.scan, CLAY)
    predicted = scan_body(i.scan, SCANS[1]).moved(j.from_other(i))
    panels: list[tuple[Body, Dots, str]] = [
        (own, _OF_OBSERVED, "observed by camera $j$"),
        (predicted, _OF_PREDICTED, "scan $i$ predicted in camera $j$"),
        (own, _OF_BOTH, "what is left"),
    ]
    for column, (body, dots, text) in enumerate(panels):
        picture = _paled(render([body], look))
        axes = sheet.place(picture, column * width + 10, _TOP)
        middle, top = (column + 0.5) * width, _TOP + _HEIGHT + 30
        for name, _, color in dots:
            wide = _BEHIND if name == "observed_kept" and column == 2 else _LINE
            pixels = np.array(result[name], np.int64).reshape(-1, 2)
            lines = _in_look(linked(pixels), j, look)
            draw_segments(axes, lines, color, wide * _scale(j, look))
        sheet.caption("abc"[column], text, middle, top)
        _legend(sheet, dots, result, column * width + 40, top + 38)
    sheet.save(path)


def _legend(
    sheet: Sheet,
    dots: Sequence[tuple[str, str, FloatArray]],
    result: Mapping[str, Any],
    left: float,
    top: float,
) -> None:
    for row, (name, text, color) in enumerate(dots):
        at = top + 30 * row
        sheet.swatch(left + 12, at, color)
        sheet.write(
            f"{len(result[name]):,}  {text}", left + 32, at, size=22, color=QUIET, align="left"
        )


def _through(view: VirtualScan, width: int, height: int) -> Look:
    """Look at what a scan's camera sees with its rays made parallel, at the object's middle."""
    camera = view.scan.image.camera
    rows, columns = np.nonzero(np.isfinite(view.scan.image.depth))
    low = np.array([columns.min(), rows.min()], float)
    high = np.array([columns.max(), rows.max()], float)
    room = np.array([width, height]) * (1 - 2 * _MARGIN)
    scale = float((room / (high - low)).min())
    centre = 0.5 * (np.array([width, height]) - 1) - scale * (
        0.5 * (low + high) - [camera.cx, camera.cy]
    )
    return Look(
        picture_from_world=Pose.identity(),
        camera=Camera(
            model=CameraModel.PINHOLE,
            width=width,
            height=height,
            fx=scale * camera.fx,
            fy=scale * camera.fy,
            cx=float(centre[0]),
            cy=float(centre[1]),
        ),
    )


def _scale(view: VirtualScan, look: Look) -> float:
    return look.camera.fx / view.scan.image.camera.fx


def _in_look(pixels: FloatArray, view: VirtualScan, look: Look) -> FloatArray:
    camera, scale = view.scan.image.camera, _scale(view, look)
    centre = np.array([camera.cx, camera.cy])
    return scale * (pixels - centre) + np.array([look.camera.cx, look.camera.cy])


def linked(pixels: IntArray) -> FloatArray:
    """Segments (N, 2, 2) between neighbouring pixels (M, 2); one without neighbours is a dot.

    Two pixels that touch at a corner are linked only where no third one links them anyway.
    """
    there = {(int(u), int(v)) for u, v in pixels}
    segments = []
    for u, v in sorted(there):
        right, down = (u + 1, v) in there, (u, v + 1) in there
        ends = [(u + 1, v)] * right + [(u, v + 1)] * down
        if (u + 1, v + 1) in there and not (right or down):
            ends.append((u + 1, v + 1))
        if (u - 1, v + 1) in there and not ((u - 1, v) in there or down):
            ends.append((u - 1, v + 1))
        segments += [((u, v), end) for end in ends or [(u, v)]]
    return np.array(segments, np.float64).reshape(-1, 2, 2)


def _paled(picture: ByteArray) -> ByteArray:
    """A picture that steps back behind lines."""
    paper = 255 * PAPER
    return np.rint(paper + _PALE * (picture - paper)).astype(np.uint8)
