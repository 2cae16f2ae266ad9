"""How the page looks: sizes, shades, and how much of what is shown."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Style:
    """The page's measures.

    Attributes:
        hue_step: From scan to scan, of a turn, where there are many: the golden section, so that
            no two hues come near each other.
        scan_levels: Lightness of the scans' colours in turn, so that those of like hue differ.
        longest_label: Where names are longer, without what they all begin with, the scans are
            called by numbers.
        still_pixels: Longer side of a picture of the model.
        frame_pixels: Across the picture of a depth frame, at most.
        frame_greys: Of what is near and of what is far in it.
        kept_tint: How the grey of pixels that were kept is tinted,
        nothing: and the colour of those that saw nothing.
        histogram_bars: Of the residuals.
        residual_quantile: Of the residuals at vertices, where their colours end.
        graph_levels: Strengths of pairs that are drawn differently.
        graph_full_score: From which a pair without a confidence is drawn strongest.
        contour_pairs: Pairs whose contours are shown.
        max_shown: Vertices of the model in the 3D view, and points of all scans together.
    """

    hue_step: float = 0.6180339887498949
    scan_levels: tuple[float, ...] = (0.52, 0.64, 0.44)
    longest_label: int = 9
    still_pixels: int = 440
    frame_pixels: int = 240
    frame_greys: tuple[float, float] = (235.0, 60.0)
    kept_tint: tuple[float, float, float] = (0.35, 0.8, 0.55)
    nothing: tuple[int, int, int] = (24, 28, 40)
    histogram_bars: int = 40
    residual_quantile: float = 0.98
    graph_levels: int = 5
    graph_full_score: float = 0.6
    contour_pairs: int = 4
    max_shown: int = 160_000


STYLE = Style()
