"""What stands on the page of the figures: draws each from what was measured."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper import drawing
from benchmarks.paper.drawing import ACCENT, CLAY, INK, PAPER, QUIET, SCANS, Lines, Panel
from benchmarks.paper.figures import pair_of, subject
from benchmarks.paper.heat_field import heat_field
from benchmarks.paper.methods import METHODS
from benchmarks.paper.pages.placed import Placed
from benchmarks.paper.settings import SETTINGS, scans_of
from benchmarks.paper.views import MADE, virtual_scan
from benchmarks.study.pages import percent
from benchmarks.study.records import of, values_of
from benchmarks.study.study import Record
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan

Records = Sequence[Record]

WIDTH = 1600
"""Of a figure, in pixels."""
_FROM_SENSOR, _FROM_FRONT = (0.0, 0.0, -1.0), (0.30, -0.12, -1.0)
_FROM_BEHIND, _UP = (1.0, -0.42, 0.36), (0.0, -1.0, 0.0)
_BALL = 0.0135
"""Radius of a keypoint, in diameters."""
_PALE = 0.55
_OBSERVED = (
    ("observed_kept", "kept", INK),
    ("observed_second", "pruning 2: camera $i$ cannot see it", drawing.SECOND),
)
_PREDICTED = (
    ("predicted_first", "pruning 1: scan $i$ ends here", SCANS[2]),
    ("predicted_third", "pruning 3: camera $j$ cannot see it", ACCENT),
    ("predicted_kept", "kept", SCANS[1]),
)
_BOTH = (("observed_kept", "observed", INK), ("predicted_kept", "predicted", SCANS[1]))
_STEPS = {
    "start": "before",
    "paper-coarse": "the paper's coarse step",
    "default": "default, pair by pair",
    "refined": "refined together",
}


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template; the figures go to the folder ``out``."""
    draw = {
        "keypoints": ("pa-hks", _keypoints),
        "prunings": ("prunings", _prunings),
        "coarse": ("coarse", _coarse),
        "four_views": ("four views", _four_views),
        "heat": ("heat", _heat),
        "gallery": ("gallery", _gallery),
    }
    chosen = {name: (of(records, figure=figure), tell) for name, (figure, tell) in draw.items()}
    return {name: tell(own, out) if own else None for name, (own, tell) in chosen.items()}


def _keypoints(records: Records, out: Path) -> list[dict[str, Any]]:
    """Figure 1: from a scan to its PA-HKS keypoints."""
    rows = [
        _keypoint_row(subject(r.unit["subject"], r.unit["azimuth_deg"]), r.result) for r in records
    ]
    drawing.draw_sheet(rows, out / "fig1-pa-hks.png")
    return [
        {
            "subject": r.unit["subject"],
            "maxima": len(r.result["after"]),
            "moved": r.result["moved"],
            "keypoints": len(r.result["grouped"]),
        }
        for r in records
    ]


def _keypoint_row(scan: PreparedScan, result: Mapping[str, Any]) -> list[Panel]:
    size, radius = (WIDTH // 4, 430), _BALL * scan.diameter
    field, pale = heat_field(scan), drawing.scan_body(scan, CLAY)
    before, after, grouped = (np.array(result[key]) for key in ("before", "after", "grouped"))
    is_moved = np.linalg.norm(after - before, axis=1) > 1e-6 * scan.diameter
    look = drawing.look_at(scan.mesh.vertices, _FROM_FRONT, _UP, size)
    behind = drawing.look_at(field.mesh.vertices, _FROM_BEHIND, _UP, size)
    colors = np.broadcast_to(drawing.WALL, field.mesh.faces.shape).copy()
    colors[: len(field.front.faces)] = SCANS[3]
    colors[_is_back(field.mesh.vertices, field.mesh.faces, field.mesh.num_front)] = (
        drawing.BACK_PLANE
    )
    mesh = drawing.faceted_body(field.mesh.vertices, field.mesh.faces, colors)
    marks = [
        pale,
        drawing.balls(after, radius, INK),
        drawing.balls(before[is_moved], 0.8 * radius, ACCENT),
    ]
    ways = look.pixels(np.stack([before[is_moved], after[is_moved]], axis=1))
    faces = f"{result['front_faces']:,} + {result['other_faces']:,} faces"
    return [
        _panel(
            drawing.render([drawing.scan_body(scan, SCANS[3])], look),
            "range scan",
            f"{result['pixels']:,} pixels",
        ),
        _panel(drawing.render([mesh], behind), "artificial mesh", faces),
        _panel(
            drawing.render(marks, look),
            "shifted to the front",
            f"{len(after)} maxima, {result['moved']} moved off the rim",
            [Lines(ways, ACCENT, 2.6)],
        ),
        _panel(
            drawing.render([pale, drawing.balls(grouped, radius, INK)], look),
            "grouped",
            f"{len(grouped)} keypoints",
        ),
    ]


def _panel(picture: ByteArray, title: str, note: str, lines: Sequence[Lines] = ()) -> Panel:
    return Panel(picture=picture, title=title, notes=[(note, QUIET)], lines=lines)


def _is_back(vertices: FloatArray, faces: IntArray, num_front: int) -> Any:
    """Faces (F,) that lie in a plane of constant depth behind the front."""
    flat = np.ptp(vertices[:, 2][faces], axis=1) < 1e-9 * np.ptp(vertices[:, 2])
    return flat & (faces >= num_front).all(axis=1)


def _prunings(records: Records, out: Path) -> list[dict[str, Any]]:
    """Figures 2 and 3: what the three prunings take, in the image of camera j."""
    told = []
    for number, record in enumerate(records, 2):
        azimuths, result = record.unit["azimuths_deg"], record.result
        gap = f"{azimuths[1] - azimuths[0]:.0f}"
        file = f"fig{number}-prunings-{gap}.png"
        _draw_prunings(record, out / file)
        counts = {name: f"{len(result[name]):,}" for name, _, _ in (*_OBSERVED, *_PREDICTED)}
        observed = len(result["observed_second"]) + len(result["observed_kept"])
        coherence = {name: percent(share) for name, share in result["coherence"].items()}
        told.append(
            {
                "number": number,
                "gap": gap,
                "file": file,
                "overlap": percent(result["overlap"]),
                "observed": f"{observed:,}",
                "coherence": coherence,
                **counts,
            }
        )
    return told


def _draw_prunings(record: Record, path: Path) -> None:
    pair, result = pair_of(record.unit), record.result
    look = drawing.look_through(pair.j.scan, (WIDTH // 3, 660))
    camera, scan_camera = look.camera, pair.j.scan.image.camera
    scale = camera.fx / scan_camera.fx
    shift = np.array([camera.cx, camera.cy]) - scale * np.array([scan_camera.cx, scan_camera.cy])
    own = drawing.scan_body(pair.j.scan, CLAY)
    predicted = drawing.scan_body(pair.i.scan, SCANS[1]).moved(pair.true.inverse())
    row = []
    for body, sets, title in (
        (own, _OBSERVED, "observed by camera $j$"),
        (predicted, _PREDICTED, "scan $i$ predicted in camera $j$"),
        (own, _BOTH, "what is left"),
    ):
        picture = drawing.render([body], look)
        lines = [
            Lines(
                scale * linked(np.array(result[name], np.int64).reshape(-1, 2)) + shift,
                color,
                scale * (2.1 if title == "what is left" and color is INK else 1.1),
            )
            for name, _, color in sets
        ]
        notes = [(f"{len(result[name]):,}  {text}", color) for name, text, color in sets]
        pale = np.rint(255 * PAPER + _PALE * (picture - 255 * PAPER)).astype(np.uint8)
        row.append(Panel(picture=pale, lines=lines, title=title, notes=notes))
    drawing.draw_sheet([row], path)


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


def _coarse(records: Records, out: Path) -> dict[str, Any]:
    """Figure 4: a pair before and after several methods."""
    [record] = records
    name, azimuths = record.unit["object"], record.unit["azimuths_deg"]
    answers = record.result["answers"]
    views = [virtual_scan(name, azimuth) for azimuth in azimuths]
    placed = Placed(name, views, (WIDTH // len(answers), 450), (1.0, 1.0), margin=0.13)
    row, notes = [], []
    for answer in answers:
        entry = METHODS.get(answer["method"])
        title = entry.title if entry else answer["method"]
        note = "" if answer["pose"] is None else _errors(answer)
        poses = None
        if answer["pose"] is not None:
            poses = {0: Pose.identity(), 1: Pose.from_matrix(answer["pose"])}
        row.append(placed.panel(poses, title, note or "no pose", cut_height=220))
        notes.append(f"{title}: {note}")
    drawing.draw_sheet([row], out / "fig4-coarse.png")
    return {
        "object": name,
        "gap": f"{azimuths[1] - azimuths[0]:.0f}",
        "overlap": percent(record.result["overlap"]),
        "errors": "; ".join(notes),
    }


def _errors(result: Mapping[str, Any]) -> str:
    return f"{_short(result['rotation_deg'])}°, {_short(result['translation_percent'])} %"


def _short(value: float) -> str:
    """A number to two digits, and to the ones if it is large."""
    return f"{value:.0f}" if value >= 10 else f"{value:#.2g}"


def _rms(step: Mapping[str, Any], record: Record) -> str:
    """In millimetres, the unit of all meshes but the made one's, or else in % of the diameter."""
    if SETTINGS[record.unit["setting"]].name == MADE:
        return f"{_short(step['rms_percent'])} %"
    return f"{_short(step['rms_percent'] * record.result['diameter'] / 100)} mm"


def _poses(step: Mapping[str, Any]) -> dict[int, Pose]:
    return {k: Pose.from_matrix(matrix) for k, matrix in enumerate(step["poses"])}


def _four_views(records: Records, out: Path) -> dict[str, Any]:
    """Figure 5: four views before registration, their heat, and the steps after."""
    [record] = records
    numeral, result = record.unit["setting"], record.result
    setting, steps = (
        SETTINGS[numeral],
        {k: result["steps"][k] for k in _STEPS if k in result["steps"]},
    )
    views, towards = scans_of(setting), (1.0, 0.55)
    small = Placed(setting.name, views, (420, 420), towards)
    size = (WIDTH // (len(steps) - 1), 500)
    large = Placed(setting.name, views, size, towards)
    behind = Placed(setting.name, views, size, (-1.0, -0.55))
    first = small.panel(
        _poses(steps["start"]), _STEPS["start"], f"RMS {_rms(steps['start'], record)}"
    )
    index, extent = result["heat"]["index"], result["heat"]["range"]
    heat = [heated(view.scan, index, extent, ((WIDTH - 420) // 4, 420)) for view in views]
    title = "heat kernel signature and PA-HKS keypoints"
    row = [first, _panel(np.concatenate(heat, axis=1), title, "")]
    after = [
        (behind if name == "refined" else large).panel(
            _poses(step), _STEPS[name], f"RMS {_rms(step, record)}", cut_height=280
        )
        for name, step in steps.items()
        if name != "start"
    ]
    drawing.draw_sheet([row, after], out / "fig5-four-views.png")
    rms = {_STEPS[name]: _rms(step, record) for name, step in steps.items() if name != "start"}
    return {
        "object": setting.name,
        "numeral": numeral,
        "azimuths": ", ".join(f"{a:.0f}°" for a in result["azimuths_deg"]),
        "keypoints": ", ".join(map(str, result["keypoints"])),
        "rms": "; ".join(f"{title}: {value}" for title, value in rms.items()),
    }


def heated(
    scan: PreparedScan, time: int, extent: Sequence[float], size: tuple[int, int]
) -> ByteArray:
    """A scan as its sensor sees it, in the colours of its heat, with its keypoints."""
    field = heat_field(scan)
    colors = drawing.heat_colors(field.on_mesh(scan, time), extent[0], extent[1])
    marks = drawing.balls(field.front.points[field.grouped], _BALL * scan.diameter, INK)
    look = drawing.look_at(scan.mesh.vertices, _FROM_SENSOR, _UP, size)
    return drawing.render([drawing.scan_body(scan, colors), marks], look)


def _heat(records: Records, out: Path) -> dict[str, Any]:
    """Figure 5b: the heat kernel signature on adjacent views, a row for each time."""
    [record] = records
    name, azimuths, rows = record.unit["object"], record.unit["azimuths_deg"], []
    scans = [virtual_scan(name, azimuth).scan for azimuth in azimuths]
    size = (WIDTH // len(scans), 384)
    for time in record.result["times"]:
        low, high = time["range"]
        at = f"{time['time']:.4f}".rstrip("0")
        scale = f"{low:.1f} (blue) to {high:.1f} (red)".replace("-", "\N{MINUS SIGN}")
        titles = [f"{time['name']} time, $t$ = {at} $D^2$", scale]
        titles += [""] * (len(scans) - len(titles))
        rows.append(
            [
                Panel(picture=heated(scan, time["index"], (low, high), size), title=title)
                for scan, title in zip(scans, titles, strict=True)
            ]
        )
    drawing.draw_sheet(rows, out / "fig5b-heat.png", letters=False)
    return {"object": name, "gap": f"{azimuths[1] - azimuths[0]:.0f}"}


def _gallery(records: Records, out: Path) -> list[dict[str, Any]]:
    """Figure 6: a sheet for each object, a column for each setting, a row for method and start."""
    told = []
    objects = list(dict.fromkeys(SETTINGS[r.unit["setting"]].name for r in records))
    for letter, name in zip("abc", objects, strict=False):
        own = [r for r in records if SETTINGS[r.unit["setting"]].name == name]
        starts = values_of(own, "start_deg")
        numerals = values_of(own, "setting")
        width = min(WIDTH // len(numerals), 534)
        rows = [
            [
                _gallery_panel(of(own, setting=numeral, start_deg=start)[0], method, width)
                for numeral in numerals
            ]
            for start in starts
            for method in ("m-icc", "mm-icc")
        ]
        file = f"fig6{letter}-gallery-{name}.png"
        drawing.draw_sheet(rows, out / file, letters=False)
        told.append(
            {
                "letter": letter,
                "object": name,
                "file": file,
                "starts": " and ".join(f"{start}°" for start in starts),
                "seeds": own[0].unit["seeds"],
            }
        )
    return told


def _gallery_panel(record: Record, method: str, width: int) -> Panel:
    numeral, result = record.unit["setting"], record.result[method]
    setting = SETTINGS[numeral]
    placed = Placed(setting.name, scans_of(setting), (width, 360), (1.0, 0.8), margin=0.03)
    views = f"({numeral}) {setting.gap_deg}°, {setting.num_views} {setting.kind} views"
    right = f"{result['converged']} of {record.unit['seeds']} right"
    title = f"{METHODS[method].title} from {record.unit['start_deg']}°"
    note = f"RMS {_rms(result, record)}, {right}"
    panel = placed.panel(_poses(result), title, note)
    return Panel(picture=panel.picture, title=title, notes=[*panel.notes, (views, QUIET)])
