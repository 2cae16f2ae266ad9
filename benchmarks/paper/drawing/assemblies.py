"""Figures 4, 5 and 6: scans before and after registration, and cuts that show how well they fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.paper.drawing.placed import Scene
from benchmarks.paper.drawing.sheet import WIDTH, Sheet
from benchmarks.paper.drawing.style import QUIET, SCANS
from scanweld.geometry.arrays import ByteArray
from scanweld.geometry.pose import Pose

_TOP, _FOOT = 16, 92
_HEAD = 64


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Panel:
    """One result of a scene.

    Attributes:
        poses: ``first_from_sensor``; None where the method has none.
        text: What it is.
        note: Its error.
    """

    poses: Mapping[int, Pose] | None
    text: str
    note: str


def draw_row(
    sheet: Sheet,
    scene: Scene,
    panels: Sequence[Panel],
    letters: str,
    left: float,
    top: float,
    cut_height: int,
) -> float:
    """Draw panels side by side, each over its cut; returns where the row ends."""
    size = scene.look.camera
    for column, panel in enumerate(panels):
        at, middle = left + column * size.width, left + (column + 0.5) * size.width
        foot = top + size.height + cut_height + 30
        if panel.poses is None:
            sheet.write("no pose", middle, top + 0.5 * size.height, color=QUIET)
        else:
            sheet.place(scene.picture(panel.poses), at, top)
            scene.draw_cut(sheet, panel.poses, at, top + size.height, size.width, cut_height)
        sheet.caption(letters[column : column + 1], panel.text, middle, foot, panel.note)
    return top + size.height + cut_height + _FOOT


def draw_pair(scene: Scene, panels: Sequence[Panel], path: Path, cut_height: int) -> None:
    """Figure 4: the results of several methods for one pair."""
    size = scene.look.camera
    sheet = Sheet(len(panels) * size.width, _TOP + size.height + cut_height + _FOOT)
    draw_row(sheet, scene, panels, "abcdefgh", 0, _TOP, cut_height)
    sheet.save(path)


def draw_four_views(
    scenes: tuple[Scene, Scene, Scene],
    panels: Sequence[Panel],
    heated: Sequence[ByteArray],
    path: Path,
    cut_height: int,
) -> None:
    """Figure 5: scans before registration, their heat and keypoints, and the steps after.

    Args:
        scenes: The views at the size of the first panel, of the others, and of the last one.
        panels: The first is before registration.
        heated: A picture of each scan.
        path: Of the PNG.
        cut_height: Of the cuts below the panels of the second row, in pixels.
    """
    before, after = scenes[0].look.camera, scenes[1].look.camera
    second = _TOP + before.height + _FOOT
    sheet = Sheet(WIDTH, second + after.height + cut_height + _FOOT)
    sheet.place(scenes[0].picture(_posed(panels[0])), 0, _TOP)
    foot = _TOP + before.height + 30
    sheet.caption("a", panels[0].text, 0.5 * before.width, foot, panels[0].note)
    width = (WIDTH - before.width) / len(heated)
    for k, picture in enumerate(heated):
        middle = before.width + (k + 0.5) * width
        sheet.place(picture, round(middle - 0.5 * picture.shape[1]), _TOP)
        sheet.swatch(middle, foot + 36, SCANS[k % len(SCANS)])
    middle = before.width + 0.5 * (WIDTH - before.width)
    sheet.caption("b", "heat kernel signature and PA-HKS keypoints", middle, foot)
    draw_row(sheet, scenes[1], panels[1:-1], "cdefg", 0, second, cut_height)
    last = len(panels) - 2
    draw_row(sheet, scenes[2], panels[-1:], "cdefgh"[last:], last * after.width, second, cut_height)
    sheet.save(path)


def draw_gallery(
    scenes: Sequence[Scene], titles: Sequence[str], rows: Sequence[Sequence[Panel]], path: Path
) -> None:
    """Figure 6: a column for each scene, a row for each method and start."""
    size = scenes[0].look.camera
    step = size.height + _FOOT
    sheet = Sheet(len(titles) * size.width, _HEAD + len(rows) * step)
    for column, title in enumerate(titles):
        sheet.write(title, (column + 0.5) * size.width, 34)
    for row, panels in enumerate(rows):
        top = _HEAD + row * step
        for column, (scene, panel) in enumerate(zip(scenes, panels, strict=True)):
            left = column * size.width
            sheet.place(scene.picture(_posed(panel)), left, top)
            middle, foot = left + 0.5 * size.width, top + size.height + 22
            sheet.caption("", panel.text, middle, foot, panel.note)
    sheet.save(path)


def _posed(panel: Panel) -> Mapping[int, Pose]:
    if panel.poses is None:
        raise ValueError(f"{panel.text}: has no poses")
    return panel.poses
