"""The page of the figures: draws each from what was measured, and says what it shows."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.paper.drawing import assemblies, heat_colors, pa_hks, prunings
from benchmarks.paper.drawing.assemblies import Panel
from benchmarks.paper.drawing.placed import Scene
from benchmarks.paper.drawing.sheet import WIDTH
from benchmarks.paper.figures.subjects import subject
from benchmarks.paper.methods import METHODS
from benchmarks.paper.pages import percent
from benchmarks.paper.settings import SETTINGS, scans_of
from benchmarks.paper.study import Record, Result
from benchmarks.paper.views import virtual_scan
from scanweld.geometry.pose import Pose

_CUT_AT = {"armadillo": 0.60, "bunny": 0.40, "creature": 0.45}
"""Height of the cuts, as a share of the object's: through most of what overlaps."""
_IN_MM = ("armadillo", "bunny")
"""Objects whose meshes are in millimetres."""


def write_figures(records: Sequence[Record], out: Path) -> str:
    """Draw all figures into a folder; returns the Markdown that shows them."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record.unit["figure"], []).append(record)
    return _INTRODUCTION + "".join(
        section(groups[name], out) for name, section in _SECTIONS.items() if name in groups
    )


_INTRODUCTION = """The figures follow those of the paper. Scans are virtual ones of the meshes, 240
pixels across the object's diameter *D* and without noise, unless a caption says otherwise. One
colour stands for one scan throughout; the inside of a scan, which its sensor cannot have seen, is
greyer. `benchmarks/paper/drawing/` draws them all.

"""


def _figure(title: str, file: str, *paragraphs: str) -> str:
    body = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    return f"## {title}\n\n![{title}]({file})\n\n{body}\n\n"


def _draw_keypoints(records: Sequence[Record], out: Path) -> str:
    rows = [(subject(r.unit["subject"], r.unit["azimuth_deg"]), r.result) for r in records]
    pa_hks.draw(rows, out / "fig1-pa-hks.png")
    told = "; ".join(
        f"{r.unit['subject']}: {len(r.result['after'])} maxima, {r.result['moved']} of them moved "
        f"off the rim, {len(r.result['grouped'])} keypoints"
        for r in records
    )
    return _figure(
        "Figure 1: PA-HKS keypoints",
        "fig1-pa-hks.png",
        f"""A range scan becomes PA-HKS keypoints (paper 3.1). (a) The scan. (b) The artificial
        mesh, seen from the side and a little from behind: the thinned front (`heat/front.py`),
        closed by walls along the viewing rays and a back plane (`heat/artificial_mesh.py`); the
        faces are the front's and those of the rest. (c)
        Maxima of the heat kernel signature on the front that persist over diffusion times
        (`heat/keypoints.py`); those found on a rim (red) are moved to the nearest place that the
        sensor saw well (black, `heat/features.py`). (d) Keypoints that are near each other and look
        alike are one. ({told}.)""",
        "(e)–(h) The same for a real scan of the Stanford bunny, `bun000`."
        if len(rows) > 1
        else "",
    )


def _draw_prunings(records: Sequence[Record], out: Path) -> str:
    text = ""
    for number, record in enumerate(records, 2):
        azimuths, result = record.unit["azimuths_deg"], record.result
        gap = azimuths[1] - azimuths[0]
        i, j = (virtual_scan(record.unit["object"], azimuth) for azimuth in azimuths)
        file = f"fig{number}-prunings-{gap:.0f}.png"
        prunings.draw(i, j, result, out / file)
        text += _figure(
            f"Figure {number}: the three prunings at a view gap of {gap:.0f}°",
            file,
            f"""Contours in the image of camera j, at the true pose (overlap
            {percent(result["overlap"])}). (a) What scan j shows (eq. 2): the second pruning (eq. 5)
            takes {len(result["observed_second"]):,} of its
            {len(result["observed_second"]) + len(result["observed_kept"]):,} points, whose surface
            camera i cannot see. (b) What scan i predicts (`contours/predict.py`): the first pruning
            (eq. 4) takes {len(result["predicted_first"]):,} points at which scan i itself ends, the
            third one (eq. 6) {len(result["predicted_third"]):,} on the inside of scan i (grey), and
            {len(result["predicted_kept"]):,} stay. (c) What is left of both, predicted (blue) over
            observed (black).""",
            f"""Share of the predicted points that lie within two pixels of an observed one:
            {_coherences(result)} (`contours/prune.py`, `contours/coherence.py`).""",
        )
    return text


def _coherences(result: Result) -> str:
    shares = {
        "no pruning": "none",
        "the first": "1",
        "the first two": "1 and 2",
        "all": "1, 2 and 3",
    }
    return ", ".join(f"{percent(result['coherence'][k])} with {name}" for name, k in shares.items())


def _draw_coarse(records: Sequence[Record], out: Path) -> str:
    (record,) = records
    name, azimuths = record.unit["object"], record.unit["azimuths_deg"]
    views = [virtual_scan(name, azimuth) for azimuth in azimuths]
    panels = [
        Panel(
            poses=_pair_poses(answer),
            text="start" if answer["method"] == "start" else METHODS[answer["method"]].title,
            note=_pose_note(answer),
        )
        for answer in record.result["answers"]
    ]
    scene = Scene(name, views, WIDTH // len(panels), 450, _CUT_AT[name], (1.0, 1.0), 0.13)
    assemblies.draw_pair(scene, panels, out / "fig4-coarse.png", 220)
    told = "; ".join(f"{panel.text}: {panel.note}" for panel in panels)
    gap = azimuths[1] - azimuths[0]
    return _figure(
        f"Figure 4: coarse registration at {gap:.0f}°",
        "fig4-coarse.png",
        f"""Two views of the {name}, {gap:.0f}° apart (overlap {percent(record.result["overlap"])}).
        (a) Both in their own camera frames, where the paper starts. (b) M-ICC from there
        (`published/m_icc.py`). (c) The coarse step as published: matched PA-HKS keypoints, then ICP
        (`published/coarse.py`). (d) The default (`pairs/register.py`), which takes no start.
        Below: a level cut through the scans, over that through the mesh (grey). Errors of rotation,
        and of the middle of the moved scan in % of *D*: {told}. [Table 1](table1.md) has all
        gaps and view directions.""",
    )


def _pair_poses(answer: Mapping[str, Any]) -> dict[int, Pose] | None:
    if answer["pose"] is None:
        return None
    return {0: Pose.identity(), 1: Pose.from_matrix(answer["pose"])}


def _pose_note(answer: Mapping[str, Any]) -> str:
    if answer["pose"] is None:
        return ""
    return _errors(answer)


def _errors(result: Mapping[str, Any]) -> str:
    return f"{_short(result['rotation_deg'])}°, {_short(result['translation_percent'])} %"


def _short(value: float) -> str:
    """A number to two digits, and to the ones if it is large."""
    return f"{value:.0f}" if value >= 10 else f"{value:#.2g}"


_STEPS = {
    "start": "before",
    "paper-coarse": "the paper's coarse step",
    "default": "default, pair by pair",
    "refined": "refined together",
}


def _draw_four_views(records: Sequence[Record], out: Path) -> str:
    (record,) = records
    setting = SETTINGS[record.unit["setting"]]
    views, steps = scans_of(setting), record.result["steps"]
    panels = [
        Panel(poses=_poses(steps[key]), text=text, note=_rms(steps[key], record, setting.name))
        for key, text in _STEPS.items()
        if key in steps
    ]
    cut, towards = _CUT_AT[setting.name], (1.0, 0.55)
    small = Scene(setting.name, views, 420, 420, cut, towards)
    size = (WIDTH // (len(panels) - 1), 500)
    large = Scene(setting.name, views, *size, cut, towards)
    index, extent = record.result["heat"]["index"], record.result["heat"]["range"]
    heated = [heat_colors.heated(view.scan, index, extent, 280, 420) for view in views]
    behind = Scene(setting.name, views, *size, cut, (-1.0, -0.55))
    assemblies.draw_four_views(
        (small, large, behind), panels, heated, out / "fig5-four-views.png", 280
    )
    azimuths = ", ".join(f"{a:.0f}°" for a in record.result["azimuths_deg"])
    keypoints = ", ".join(str(number) for number in record.result["keypoints"])
    told = "; ".join(f"{p.text}: {p.note.removeprefix('RMS ')}" for p in panels[1:])
    return _figure(
        "Figure 5: four views, 90° apart",
        "fig5-four-views.png",
        f"""Four views of the {setting.name} at {azimuths} (setting ({setting.numeral}) of
        [Table 2](table2.md)). (a) All in their own camera frames. (b) Their heat at a middle time,
        and their {keypoints} keypoints (`heat/features.py`). The other panels lay the pairs of
        adjacent views in a chain: pairs by the paper's coarse step (`published/coarse.py`); by the
        default (`pairs/register.py`); and the latter after the joint refinement of all poses
        (`refinement/refine.py`), seen from the other side. RMS distance of true correspondences:
        {told}.""",
    )


def _rms(result: Mapping[str, Any], record: Record, name: str) -> str:
    if name not in _IN_MM:
        return f"RMS {_short(result['rms_percent'])} %"
    return f"RMS {_short(result['rms_percent'] * record.result['diameter'] / 100)} mm"


def _poses(result: Mapping[str, Any]) -> dict[int, Pose]:
    return {k: Pose.from_matrix(matrix) for k, matrix in enumerate(result["poses"])}


def _draw_heat(records: Sequence[Record], out: Path) -> str:
    (record,) = records
    azimuths, result = record.unit["azimuths_deg"], record.result
    scans = [virtual_scan(record.unit["object"], azimuth).scan for azimuth in azimuths]
    titles = [f"{azimuth:.0f}°" for azimuth in azimuths]
    heat_colors.draw(scans, titles, result["times"], out / "fig5b-heat.png")
    return _figure(
        "Figure 5b: the heat kernel signature",
        "fig5b-heat.png",
        f"""Log of the heat kernel signature over the heat trace (`heat/signature.py`) on views of
        the {record.unit["object"]} that are {azimuths[1] - azimuths[0]:.0f}° apart, at the shortest
        time that the eigenvalues resolve, a middle one and the longest; each row has one scale.
        Keypoints are black. What sticks out keeps its heat and looks alike from neighbouring views
        at short times. At long times heat has seen walls and rims, and a piece cut off by an
        occlusion has a level of its own: one reason why signatures alone match few keypoints
        rightly ([features](features.md)).""",
    )


def _draw_gallery(records: Sequence[Record], out: Path) -> str:
    text = ""
    objects = list(dict.fromkeys(SETTINGS[r.unit["setting"]].name for r in records))
    for letter, name in zip("abc", objects, strict=False):
        own = [r for r in records if SETTINGS[r.unit["setting"]].name == name]
        file = f"fig6{letter}-gallery-{name}.png"
        _draw_settings(own, name, out / file)
        starts = " and ".join(f"{degrees}°" for degrees in _starts(own))
        text += _figure(
            f"Figure 6{letter}: M-ICC and MM-ICC, {name}",
            file,
            f"""The settings of [Table 2](table2.md) with the {name}, tuned as there: M-ICC
            (`published/m_icc.py`) and MM-ICC as published (`published/mm_icc.py`) from the same
            starts, all views but the first {starts} off the truth. Shown is the start of the first
            seed. Below: RMS distance of its true correspondences, and how many of
            {own[0].unit["seeds"]} seeds come out right.""",
        )
    return text


def _draw_settings(records: Sequence[Record], name: str, path: Path) -> None:
    numerals = list(dict.fromkeys(record.unit["setting"] for record in records))
    of = {(r.unit["setting"], r.unit["start_deg"]): r for r in records}
    width = min(WIDTH // len(numerals), 534)
    scenes = [
        Scene(name, scans_of(SETTINGS[n]), width, 360, _CUT_AT[name], (1.0, 0.8), 0.03)
        for n in numerals
    ]
    rows = [
        [_gallery_panel(of[n, degrees], key, title, name) for n in numerals]
        for degrees in _starts(records)
        for key, title in (("m-icc", "M-ICC"), ("mm-icc", "MM-ICC"))
    ]
    assemblies.draw_gallery(
        scenes, [_short_title(of[n, _starts(records)[0]]) for n in numerals], rows, path
    )


def _starts(records: Sequence[Record]) -> list[int]:
    return list(dict.fromkeys(record.unit["start_deg"] for record in records))


def _gallery_panel(record: Record, key: str, title: str, name: str) -> Panel:
    result, seeds = record.result[key], record.unit["seeds"]
    return Panel(
        poses=_poses(result),
        text=f"{title} from {record.unit['start_deg']}°",
        note=f"{_rms(result, record, name)}, {result['converged']} of {seeds} right",
    )


def _short_title(record: Record) -> str:
    setting = SETTINGS[record.unit["setting"]]
    return f"({setting.numeral}) {setting.gap_deg}°, {setting.num_views} {setting.kind} views"


_SECTIONS: dict[str, Callable[[Sequence[Record], Path], str]] = {
    "pa-hks": _draw_keypoints,
    "prunings": _draw_prunings,
    "coarse": _draw_coarse,
    "four views": _draw_four_views,
    "heat": _draw_heat,
    "gallery": _draw_gallery,
}
