"""Observed contours beside those that another scan predicts, for the pairs that hold least."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.app.html_report.style import STYLE
from scanweld.app.model_files import PairEntry
from scanweld.config import ContoursConfig
from scanweld.contours.coherence import coherence, contour_pair
from scanweld.contours.contour_sets import ContourPoints, observe_contours
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan


@dataclass(frozen=True, kw_only=True, slots=True)
class Panel:
    """A camera's image: paths of pixels, to be drawn in its view box.

    Attributes:
        predicted_by: The scan whose contours are predicted.
        seen_by: The scan whose camera it is.
        view_box: x, y, width and height, in pixels.
        surface: Path of the pixels with surface,
        observed: of the observed contours,
        predicted: of the predicted ones.
        coherence: Share of the predicted contours near an observed one; None without any.
    """

    predicted_by: str
    seen_by: str
    view_box: str
    surface: str
    observed: str
    predicted: str
    coherence: float | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Overlay:
    """A pair, and how the contours of each lie in the image of the other."""

    pair: PairEntry
    panels: tuple[Panel, ...]


def contour_overlays(
    pairs: Sequence[PairEntry],
    prepared: Callable[[str], PreparedScan],
    world_from_scan: Callable[[str], Pose],
    config: ContoursConfig,
) -> list[Overlay]:
    """Overlays of the weakest accepted pairs, at the final poses.

    Args:
        pairs: All pairs.
        prepared: Gives a scan by its name.
        world_from_scan: Gives its pose.
        config: What counts as a contour.
    """
    accepted = [pair for pair in pairs if pair.accepted]
    accepted.sort(key=lambda pair: (pair.score or 0.0, pair.i, pair.j))
    overlays = []
    for pair in accepted[: STYLE.contour_pairs]:
        scans = [prepared(name) for name in (pair.i, pair.j)]
        sensors = [
            world_from_scan(name) @ scan.scan_from_sensor
            for name, scan in zip((pair.i, pair.j), scans, strict=True)
        ]
        i_from_j = sensors[0].inverse() @ sensors[1]
        both = (
            _panel(scans[0], scans[1], i_from_j.inverse(), config),
            _panel(scans[1], scans[0], i_from_j, config),
        )
        overlays.append(Overlay(pair=pair, panels=both))
    return overlays


def _panel(i: PreparedScan, j: PreparedScan, j_from_i: Pose, config: ContoursConfig) -> Panel:
    found = contour_pair(observe_contours(i, config), observe_contours(j, config), j_from_i, config)
    surface = np.isfinite(j.image.depth)
    return Panel(
        predicted_by=i.name,
        seen_by=j.name,
        view_box=_view_box(surface),
        surface=_runs(surface),
        observed=_pixels(found.observed, surface.shape),
        predicted=_pixels(found.predicted, surface.shape),
        coherence=coherence([found]) if len(found.predicted) else None,
    )


def _view_box(surface: BoolArray) -> str:
    rows, columns = np.nonzero(surface)
    left, top = int(columns.min()), int(rows.min())
    right, bottom = int(columns.max()), int(rows.max())
    return f"{left} {top} {right - left + 1} {bottom - top + 1}"


def _pixels(contour: ContourPoints, shape: tuple[int, ...]) -> str:
    mask = np.zeros(shape, bool)
    mask[contour.pixels[:, 1], contour.pixels[:, 0]] = True
    return _runs(mask)


def _runs(mask: BoolArray) -> str:
    """An SVG path of a mask (H, W): a rectangle for each run of pixels in a row."""
    padded = np.pad(mask, ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(padded, axis=1)
    rows, starts = np.nonzero(change == 1)
    ends = np.nonzero(change == -1)[1]
    return "".join(
        f"M{x} {y}h{end - x}v1h{x - end}z" for y, x, end in zip(rows, starts, ends, strict=True)
    )
