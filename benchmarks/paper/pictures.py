"""The pictures on the page of the figures, drawn from what was measured, and words about them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.drawing import (
    ACCENT,
    BACK_PLANE,
    CLAY,
    INK,
    PAPER,
    QUIET,
    SCANS,
    SECOND,
    WALL,
    Lines,
    Panel,
    balls,
    colored,
    draw_sheet,
    heat_colors,
    look_at,
    look_through,
    moved,
    render,
    rgb,
)
from benchmarks.paper.figures import pair_of, subject
from benchmarks.paper.heat_field import HeatField, heat_field
from benchmarks.paper.methods import METHODS
from benchmarks.paper.placed import Placed
from benchmarks.paper.settings import SETTINGS, scans_of
from benchmarks.paper.views import MADE, virtual_scan
from benchmarks.study.records import Records, grouped, of, values_of
from benchmarks.study.study import Record
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan

WIDTH = 1600
"""Of a figure, in pixels."""
_FROM_SENSOR, _FROM_FRONT = (0.0, 0.0, -1.0), (0.30, -0.12, -1.0)
_FROM_BEHIND, _UP = (1.0, -0.42, 0.36), (0.0, -1.0, 0.0)
_BALL = 0.0135
"""Radius of a keypoint, in diameters."""
_PALE = 0.55
_OBSERVED = (
    ("observed_kept", "kept", INK),
    ("observed_second", "pruning 2: camera $i$ cannot see it", SECOND),
)
_PREDICTED = (
    ("predicted_first", "pruning 1: scan $i$ ends here", SCANS[2]),
    ("predicted_third", "pruning 3: camera $j$ cannot see it", ACCENT),
    ("predicted_kept", "kept", SCANS[1]),
)
_BOTH = (("observed_kept", "observed", INK), ("predicted_kept", "predicted", SCANS[1]))
STEPS = {
    "start": "before",
    "paper-coarse": "the paper's coarse step",
    "default": "default, pair by pair",
    "refined": "refined together",
}


def draw(records: Records, out: Path) -> None:
    """Draw all figures that were measured."""
    draw_figure = {
        **{"pa-hks": _keypoints, "prunings": _prunings, "coarse": _coarse},
        **{"four views": _four_views, "heat": _heat, "gallery": _gallery},
    }
    for figure, own in grouped(records, "{figure}").items():
        draw_figure[figure](own, out)


def gap_of(record: Record) -> int:
    """Between the first two views, in degrees."""
    first, second = record.unit["azimuths_deg"][:2]
    return round(second - first)


def by_object(records: Records) -> dict[str, Records]:
    """Records of settings of Table 2 by their object."""
    names = {numeral: SETTINGS[numeral].name for numeral in values_of(records, "setting")}
    return {
        name: [r for r in records if names[r.unit["setting"]] == name]
        for name in dict.fromkeys(names.values())
    }


def method_title(answer: Mapping[str, Any]) -> str:
    """Of an answer to a pair."""
    entry = METHODS.get(answer["method"])
    return entry.title if entry else answer["method"]


def errors(answer: Mapping[str, Any]) -> str:
    """Of an answer to a pair, if it has a pose."""
    if answer["pose"] is None:
        return ""
    return f"{_short(answer['rotation_deg'])}°, {_short(answer['translation_percent'])} %"


def rms(record: Record, step: Mapping[str, Any]) -> str:
    """In millimetres, the unit of all meshes but the made one's, or else in % of the diameter."""
    if SETTINGS[record.unit["setting"]].name == MADE:
        return f"{_short(step['rms_percent'])} %"
    return f"{_short(step['rms_percent'] * record.result['diameter'] / 100)} mm"


def _short(value: float) -> str:
    """A number to two digits, and to the ones if it is large."""
    return f"{value:.0f}" if value >= 10 else f"{value:#.2g}"


def _keypoints(records: Records, out: Path) -> None:
    """Figure 1: from a scan to its PA-HKS keypoints."""
    draw_sheet([_keypoint_row(record) for record in records], out / "fig1-pa-hks.png")


def _keypoint_row(record: Record) -> list[Panel]:
    result, shown = record.result, record.unit
    scan = subject(shown["subject"], shown.get("azimuth_deg"))
    size, radius = (WIDTH // 4, 430), _BALL * scan.diameter
    mesh, pale = _artificial_mesh(heat_field(scan)), colored(scan.mesh, CLAY)
    before, after, grouped = (np.array(result[key]) for key in ("before", "after", "grouped"))
    is_moved = np.linalg.norm(after - before, axis=1) > 1e-6 * scan.diameter
    look = look_at(scan.mesh.vertices, _FROM_FRONT, _UP, size)
    behind = look_at(mesh.vertices, _FROM_BEHIND, _UP, size)
    left, black = balls(before[is_moved], 0.8 * radius, ACCENT), balls(after, radius, INK)
    ways = Lines(look.pixels(np.stack([before, after], axis=1)[is_moved]), ACCENT, 2.6)
    faces = f"{result['front_faces']:,} + {result['other_faces']:,} faces"
    maxima = f"{len(after)} maxima, {result['moved']} moved off the rim"
    kept, found = f"{len(grouped)} keypoints", [pale, balls(grouped, radius, INK)]
    seen, pixels = [colored(scan.mesh, SCANS[3])], f"{result['pixels']:,} pixels"
    return [
        Panel(render(seen, look), "range scan", [(pixels, QUIET)]),
        Panel(render([mesh], behind), "artificial mesh", [(faces, QUIET)]),
        Panel(render([pale, black, left], look), "shifted to the front", [(maxima, QUIET)], [ways]),
        Panel(render(found, look), "grouped", [(kept, QUIET)]),
    ]


def _artificial_mesh(field: HeatField) -> TriangleMesh:
    """With a colour for the faces of the front, the walls, and the back plane."""
    vertices, faces = field.mesh.vertices, field.mesh.faces
    depth = vertices[:, 2][faces]
    is_flat = np.ptp(depth, axis=1) < 1e-9 * np.ptp(vertices[:, 2])
    colors = np.tile(rgb(WALL), (len(faces), 1))
    colors[is_flat & (faces >= field.mesh.num_front).all(axis=1)] = rgb(BACK_PLANE)
    colors[: len(field.front.faces)] = rgb(SCANS[3])
    corners = vertices[faces].reshape(-1, 3)
    alone = TriangleMesh(vertices=corners, faces=np.arange(len(corners)).reshape(-1, 3))
    return colored(alone, np.repeat(colors, 3, axis=0))


def _prunings(records: Records, out: Path) -> None:
    """Figures 2 and 3: what the three prunings take, in the image of camera j."""
    for number, record in enumerate(records, 2):
        pair, result = pair_of(record.unit), record.result
        look = look_through(pair.j, (WIDTH // 3, 660))
        camera = pair.j.image.camera
        own = colored(pair.j.mesh, CLAY)
        predicted = moved(colored(pair.i.mesh, SCANS[1]), pair.true.inverse())
        row = []
        for mesh, sets, title, width in (
            (own, _OBSERVED, "observed by camera $j$", 3.0),
            (predicted, _PREDICTED, "scan $i$ predicted in camera $j$", 3.0),
            (own, _BOTH, "what is left", 4.0),
        ):
            lines, notes = [], []
            for name, text, color in sets:
                pixels = np.array(result[name], float).reshape(-1, 2)
                at = look.pixels(camera.unproject(pixels, np.ones(len(pixels))))
                lines.append(Lines(np.stack([at - 0.1, at + 0.1], axis=1), color, width))
                notes.append((f"{len(pixels):,}  {text}", color))
            pale = rgb(PAPER) + _PALE * (render([mesh], look) - rgb(PAPER))
            row.append(Panel(np.rint(pale).astype(np.uint8), title, notes, lines))
        draw_sheet([row], out / f"fig{number}-prunings-{gap_of(record)}.png")


def _coarse(records: Records, out: Path) -> None:
    """Figure 4: a pair before and after several methods."""
    [record] = records
    name, answers = record.unit["object"], record.result["answers"]
    views = [virtual_scan(name, azimuth) for azimuth in record.unit["azimuths_deg"]]
    placed = Placed(name, views, (WIDTH // len(answers), 450), (1.0, 1.0), margin=0.13)
    row = []
    for answer in answers:
        poses = None
        if answer["pose"] is not None:
            poses = {0: Pose.identity(), 1: Pose.from_matrix(answer["pose"])}
        note = errors(answer) or "no pose"
        row.append(placed.panel(poses, method_title(answer), note, cut_height=220))
    draw_sheet([row], out / "fig4-coarse.png")


def _poses(step: Mapping[str, Any]) -> dict[int, Pose]:
    return {k: Pose.from_matrix(matrix) for k, matrix in enumerate(step["poses"])}


def _four_views(records: Records, out: Path) -> None:
    """Figure 5: four views before registration, their heat, and the steps after."""
    [record] = records
    setting, result = SETTINGS[record.unit["setting"]], record.result
    views, steps = scans_of(setting), result["steps"]
    size, towards = (WIDTH // (len(steps) - 1), 500), np.array([1.0, 0.55])

    def panel(name: str, size: tuple[int, int], towards: FloatArray, cut_height: int) -> Panel:
        placed, step = Placed(setting.name, views, size, towards.tolist()), steps[name]
        return placed.panel(_poses(step), STEPS[name], f"RMS {rms(record, step)}", cut_height)

    index, extent = result["heat"]["index"], result["heat"]["range"]
    heat = [_heated(view.scan, index, extent, ((WIDTH - 420) // 4, 420)) for view in views]
    title = "heat kernel signature and PA-HKS keypoints"
    before = [
        panel("start", (420, 420), towards, 0),
        Panel(np.concatenate(heat, axis=1), title, [("", QUIET)]),
    ]
    after = [
        panel(name, size, -towards if name == "refined" else towards, 280)
        for name in STEPS
        if name in steps and name != "start"
    ]
    draw_sheet([before, after], out / "fig5-four-views.png")


def _heated(
    scan: PreparedScan, time: int, extent: Sequence[float], size: tuple[int, int]
) -> ByteArray:
    """A scan as its sensor sees it, in the colours of its heat, with its keypoints."""
    field = heat_field(scan)
    colors = heat_colors(field.on_mesh(scan, time), extent[0], extent[1])
    marks = balls(field.keypoints, _BALL * scan.diameter, INK)
    look = look_at(scan.mesh.vertices, _FROM_SENSOR, _UP, size)
    return render([colored(scan.mesh, colors), marks], look)


def _heat(records: Records, out: Path) -> None:
    """Figure 5b: the heat kernel signature on adjacent views, a row for each time."""
    [record] = records
    scans = [virtual_scan(record.unit["object"], a).scan for a in record.unit["azimuths_deg"]]
    rows = []
    for time in record.result["times"]:
        low, high = time["range"]
        at = f"{time['time']:.4f}".rstrip("0")
        scale = f"{low:.1f} (blue) to {high:.1f} (red)".replace("-", "\N{MINUS SIGN}")
        titles = [f"{time['name']} time, $t$ = {at} $D^2$", scale, *[""] * len(scans)]
        size = (WIDTH // len(scans), 384)
        pictures = [_heated(scan, time["index"], (low, high), size) for scan in scans]
        rows.append([Panel(*shown) for shown in zip(pictures, titles, strict=False)])
    draw_sheet(rows, out / "fig5b-heat.png", letters=False)


def _gallery(records: Records, out: Path) -> None:
    """Figure 6: a sheet for each object, a column for each setting, a row for method and start."""
    for letter, (name, own) in zip("abc", by_object(records).items(), strict=False):
        numerals = values_of(own, "setting")
        width = min(WIDTH // len(numerals), 534)
        rows = [
            [_gallery_panel(of(at_start, setting=n)[0], method, width) for n in numerals]
            for at_start in grouped(own, "{start_deg}").values()
            for method in ("m-icc", "mm-icc")
        ]
        draw_sheet(rows, out / f"fig6{letter}-gallery-{name}.png", letters=False)


def _gallery_panel(record: Record, method: str, width: int) -> Panel:
    numeral, result = record.unit["setting"], record.result[method]
    setting = SETTINGS[numeral]
    placed = Placed(setting.name, scans_of(setting), (width, 360), (1.0, 0.8), margin=0.03)
    views = f"({numeral}) {setting.gap_deg}°, {setting.num_views} {setting.kind} views"
    right = f"{result['converged']} of {record.unit['seeds']} right"
    title = f"{METHODS[method].title} from {record.unit['start_deg']}°"
    panel = placed.panel(_poses(result), title, f"RMS {rms(record, result)}, {right}")
    return panel._replace(notes=[*panel.notes, (views, QUIET)])
