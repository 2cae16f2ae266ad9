"""The page: everything gathered, then laid out by the template."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemBytecodeCache, PackageLoader, StrictUndefined
from markupsafe import Markup

from scanweld.app.html_report import numbers
from scanweld.app.html_report.colors import (
    RESIDUAL_STOPS,
    SUPPORT_STOPS,
    scan_colors,
)
from scanweld.app.html_report.contour_overlays import Overlay, contour_overlays
from scanweld.app.html_report.cut_pictures import color_pictures, cut_pictures
from scanweld.app.html_report.definitions import DEFINITIONS
from scanweld.app.html_report.histogram import histogram
from scanweld.app.html_report.orientation import as_seen_from
from scanweld.app.html_report.scene import Scene, make_scene, payload
from scanweld.app.html_report.sources import Sources
from scanweld.app.html_report.stills import AROUND, FACES, sides_of, stills
from scanweld.app.html_report.style import STYLE
from scanweld.app.html_report.surface_check import (
    SurfaceCheck,
    check_surface,
    open_borders,
    thin_share,
)
from scanweld.app.html_report.view_graph import draw_graph, pair_level
from scanweld.app.model_files import PairEntry
from scanweld.app.model_folder import ModelFolder
from scanweld.app.summary import verdict_sentence
from scanweld.compiled.kernels import kept_folder
from scanweld.config import Config
from scanweld.geometry.scan import RangeScan
from scanweld.geometry.shading import Side
from scanweld.io import natural_key
from scanweld.reconstruction import ScanVerdict
from scanweld.sensor.model import SPREAD_SIGMAS


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanLook:
    """How a scan is called and coloured all over the page.

    Attributes:
        number: From 1, in natural order of the names.
        name: Of the scan.
        label: Short, for drawings.
        is_numbered: Whether that is the number, which then stands beside the name elsewhere.
        color: As ``#rrggbb``.
    """

    number: int
    name: str
    label: str
    is_numbered: bool
    color: str


def report_page(
    model: ModelFolder,
    sources: Sources | None,
    config: Config,
    scans: Mapping[str, RangeScan],
    workers: int = 1,
) -> str:
    """The whole page as HTML.

    Args:
        model: What a run wrote.
        sources: The scans; None leaves out what only they can tell.
        config: Settings of the run.
        scans: By name, as they were read, for pictures of what was cut off them and of colours.
        workers: Threads; the page is the same for any number.
    """
    cuts = cut_pictures(model.report.scans, scans)
    looks = scan_looks(list(model.report.scans))
    sizes = [scan.diameter for scan in model.report.scans.values() if scan.diameter]
    diameter = float(np.median(sizes)) if sizes else None
    environment = Environment(
        loader=PackageLoader("scanweld.app.html_report"),
        bytecode_cache=FileSystemBytecodeCache(str(kept_folder())),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        share=numbers.share,
        fine_share=numbers.fine_share,
        score=numbers.score,
        count=numbers.count,
        duration=numbers.duration,
        length=lambda value: numbers.length(value, config.unit),
        of_diameter=lambda value: numbers.of_diameter(value, diameter),
        exact=lambda value: Markup("") if value is None else repr(value),
        script_json=_script_json,
        count_of=len,
        plain=lambda value: json.dumps(value, ensure_ascii=False),
        level=pair_level,
    )
    return environment.get_template("report.html").render(
        defined=DEFINITIONS,
        has_scans=sources is not None,
        looks=looks,
        diameter=diameter,
        **_outcome(model),
        **_graph(model, looks),
        **_surface(model, sources, looks, workers),
        cuts=cuts,
        photos=color_pictures({*model.poses.poses, *cuts}, scans),
        overlays=_overlays(model, sources, config),
        stages=model.report.stages,
        settings=model.report.settings,
    )


def scan_looks(names: Sequence[str]) -> dict[str, ScanLook]:
    """Number, short label and colour of each scan, in natural order of their names."""
    ordered = sorted(names, key=natural_key)
    colors = scan_colors(len(ordered))
    prefix = _shared_beginning(ordered).rstrip("0123456789")  # 01 to 09 are not 1 to 9
    labels = [name.removeprefix(prefix) or name for name in ordered]
    is_numbered = max(map(len, labels), default=0) > STYLE.longest_label
    if is_numbered:
        labels = [str(k + 1) for k in range(len(ordered))]
    return {
        name: ScanLook(
            number=k + 1, name=name, label=labels[k], is_numbered=is_numbered, color=colors[k]
        )
        for k, name in enumerate(ordered)
    }


def _shared_beginning(names: Sequence[str]) -> str:
    """What all names begin with; nothing if there is only one."""
    if len(names) < 2:
        return ""
    first, last = min(names), max(names)
    same = [a == b for a, b in zip(first, last, strict=False)]
    return first[: same.index(False)] if False in same else first[: len(same)]


def _outcome(model: ModelFolder) -> dict[str, Any]:
    """The first screen's words and numbers."""
    report, poses = model.report, model.poses
    names = sorted(report.scans, key=natural_key)
    placed = [name for name in names if name in poses.poses]
    sentence = verdict_sentence(report.verdict, len(names), len(placed), len(poses.components))
    of = lambda kind: [name for name in names if report.scans[name].verdict is kind]  # noqa: E731
    return {
        "verdict": report.verdict.value,
        "sentence": sentence[0].upper() + sentence[1:] + ".",
        "reasons": report.reasons,
        "knowledge": report.knowledge,
        "scans": {name: report.scans[name] for name in names},
        "placed": placed,
        "doubtful": of(ScanVerdict.DOUBTFUL),
        "unplaced": of(ScanVerdict.UNPLACED),
        "components": poses.components,
        "scans_have_confidence": any(scan.confidence is not None for scan in report.scans.values()),
        "scans_have_bounds": any(
            scan.translation_bound is not None for scan in report.scans.values()
        ),
        "sensor": report.sensor,
        "spread_sigmas": SPREAD_SIGMAS,
        "seconds": sum(stage.seconds for stage in report.stages.values()),
        "peak_mb": max((stage.peak_mb for stage in report.stages.values()), default=None),
        "most_seconds": max((stage.seconds for stage in report.stages.values()), default=0) or 1,
    }


def _graph(model: ModelFolder, looks: Mapping[str, ScanLook]) -> dict[str, Any]:
    """View graph and pair matrix."""
    pairs = model.graph.pairs
    placed = {name for component in model.poses.components for name in component}
    lone = [name for name in looks if name not in placed]
    components = [sorted(part, key=natural_key) for part in model.poses.components]
    number = {name: k for k, name in enumerate(looks)}
    cells: dict[tuple[int, int], int] = {}
    for k, pair in enumerate(pairs):
        cells[number[pair.i], number[pair.j]] = cells[number[pair.j], number[pair.i]] = k
    return {
        "drawing": draw_graph(components, lone, pairs),
        "pairs": pairs,
        "cells": cells,
        "pair_words": [pair_words(pair) for pair in pairs],
        "pairs_have_confidence": any(pair.confidence is not None for pair in pairs),
        "has_pairs": bool(pairs),
        "num_accepted": sum(pair.accepted for pair in pairs),
        "pair_data": [pair.model_dump(mode="json") for pair in pairs],
    }


def pair_words(pair: PairEntry) -> str:
    """A pair in a few lines, for its tip."""
    lines = [f"{pair.i} – {pair.j}: {'accepted' if pair.accepted else 'not accepted'}"]
    kind = f"{pair.kind.value} ({pair.sliding})" if pair.sliding else pair.kind.value
    told = [f"alone: {kind}", f"score {numbers.score(pair.score)}"]
    told += [f"overlap {numbers.share(pair.overlap)}", f"margin {numbers.score(pair.margin)}"]
    if pair.confidence is not None:
        told.append(f"confidence {numbers.score(pair.confidence)}")
    lines.append(", ".join(told))
    if pair.reason:
        lines.append(pair.reason)
    return "\n".join(lines)


def _surface(
    model: ModelFolder, sources: Sources | None, looks: Mapping[str, ScanLook], workers: int
) -> dict[str, Any]:
    """Pictures, the 3D view, residuals, support and holes."""
    mesh = model.mesh
    if mesh is None:
        return {"model": None, "check": None}
    check = None if sources is None else check_surface(mesh, sources.points_of_model())
    sensor = None if sources is None else sources.world_from_reference_sensor()
    orientation = as_seen_from(sensor)
    borders = open_borders(mesh)
    scene = make_scene(mesh, borders, check)
    shown = [] if check is None else list(check.points)
    sides = sides_of(scene.mesh, orientation, workers)
    described, buffers = payload(scene, orientation, [looks[name].color for name in shown])
    return {
        "model": {
            "vertices": len(mesh.vertices),
            "faces": len(mesh.faces),
            "num_scans": len(model.fused_scans),
            "shown_faces": len(scene.mesh.faces),
            "sides": stills(sides, AROUND, scene.mesh.colors, "The model from", workers),
            "borders": borders,
            "scene": described,
            "buffers": buffers,
            "shown_scans": shown,
        },
        "check": None if check is None else _measured(model, check, scene, sides, workers),
    }


def _measured(
    model: ModelFolder,
    check: SurfaceCheck,
    scene: Scene,
    sides: Mapping[str, Side],
    workers: int,
) -> dict[str, Any] | None:
    """Residuals and support in numbers and pictures; None where the scans miss the model."""
    found = histogram(check.all_distances())
    residual, support = scene.residual_colors(), scene.support_colors()
    if found is None or model.mesh is None or residual is None or support is None:
        return None
    colored = "The model coloured by"
    per_scan = {name: histogram(np.sort(np.abs(part))) for name, part in check.distances.items()}
    return {
        "histogram": found,
        "per_scan": per_scan,
        "off_model": check.off_model,
        "thin": thin_share(model.mesh, check.support),
        "residual_end": scene.residual_end,
        "residual_stops": RESIDUAL_STOPS,
        "support_stops": SUPPORT_STOPS,
        "heat": stills(sides, FACES[:2], residual, f"{colored} residual, seen from", workers),
        "support": stills(sides, FACES, support, f"{colored} support, seen from", workers),
    }


def _overlays(model: ModelFolder, sources: Sources | None, config: Config) -> list[Overlay]:
    if sources is None:
        return []
    return contour_overlays(
        model.graph.pairs, sources.prepared, sources.world_from_scan, config.contours
    )


def _script_json(value: Any) -> Markup:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)
