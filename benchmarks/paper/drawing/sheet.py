"""The sheet on which a figure's panels, captions and contour lines are laid out, in pixels."""

import io
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.paper.drawing.style import INK, PAPER, QUIET
from scanweld.geometry.arrays import ByteArray, FloatArray

WIDTH = 1600
"""Of a figure, in pixels."""
_DPI = 100
_TEXT, _SMALL = 27, 23
"""Heights of letters in pixels; figures are often shown at half their size."""
_PALETTES = (256, 128, 64)
_MOST_BYTES = 400_000


class Sheet:
    """A figure of a fixed size, drawn panel by panel; (0, 0) is its top left corner."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.figure = Figure(
            figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=tuple(PAPER)
        )

    def place(self, picture: ByteArray, left: float, top: float) -> Axes:
        """Put a picture down, pixel on pixel; its axes count the picture's pixels."""
        height, width = picture.shape[:2]
        axes = self.axes(left, top, width, height)
        axes.imshow(picture, interpolation="none", aspect="auto")
        axes.set_xlim(-0.5, width - 0.5)
        axes.set_ylim(height - 0.5, -0.5)
        return axes

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """Bare axes over a part of the sheet."""
        at = (
            left / self.width,
            1 - (top + height) / self.height,
            width / self.width,
            height / self.height,
        )
        axes = self.figure.add_axes(at)
        axes.set_axis_off()
        return axes

    def write(
        self,
        text: str,
        left: float,
        top: float,
        *,
        size: float = _TEXT,
        color: FloatArray = INK,
        align: str = "center",
        bold: bool = False,
    ) -> None:
        """Write a line whose middle is ``top`` pixels below the top."""
        self.figure.text(
            left / self.width,
            1 - top / self.height,
            text,
            ha=align,
            va="center",
            fontsize=_points(size),
            color=tuple(color),
            fontweight="bold" if bold else "normal",
        )

    def caption(self, letter: str, text: str, middle: float, top: float, note: str = "") -> None:
        """Write what a panel shows below it, with a quieter line under that."""
        label = rf"$\bf{{({letter})}}$ {text}" if letter else text
        self.write(label, middle, top)
        if note:
            self.write(note, middle, top + 1.35 * _TEXT, size=_SMALL, color=QUIET)

    def swatch(self, left: float, top: float, color: FloatArray) -> None:
        """A dot of a colour, for a legend."""
        axes = self.axes(left - 12, top - 12, 24, 24)
        axes.scatter([0], [0], s=_points(17) ** 2, color=[tuple(color)], linewidths=0)

    def save(self, path: Path) -> None:
        """Write a PNG of so many colours that the file stays small."""
        with rc_context({"font.family": "DejaVu Sans", "mathtext.fontset": "dejavusans"}):
            canvas = FigureCanvasAgg(self.figure)
            canvas.draw()
        pixels = np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])
        path.write_bytes(_png(Image.fromarray(pixels)))


def draw_segments(axes: Axes, segments: FloatArray, color: FloatArray, width: float) -> None:
    """Draw line segments (N, 2, 2) in the axes' pixels."""
    lines = LineCollection(list(segments), colors=[tuple(color)], linewidths=_points(width))
    lines.set_capstyle("round")
    axes.add_collection(lines)


def draw_dots(axes: Axes, pixels: FloatArray, color: FloatArray, width: float) -> None:
    """Draw dots of a width at pixels (N, 2) of the axes."""
    axes.scatter(*pixels.T, s=_points(width) ** 2, color=[tuple(color)], linewidths=0, zorder=3)


def _png(image: Image.Image) -> bytes:
    for colors in _PALETTES[:-1]:
        png = _with_palette(image, colors)
        if len(png) <= _MOST_BYTES:
            return png
    return _with_palette(image, _PALETTES[-1])


def _with_palette(image: Image.Image, colors: int) -> bytes:
    buffer = io.BytesIO()
    few = image.quantize(colors, Image.Quantize.MEDIANCUT, kmeans=2)
    few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _points(pixels: float) -> float:
    return 72.0 * pixels / _DPI
