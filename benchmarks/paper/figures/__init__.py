"""Figures 1 to 6 of the paper, on the same objects and at the same view gaps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.baselines.own import AS_PUBLISHED
from benchmarks.paper.figures.heat_field import HeatField, heat_field
from benchmarks.paper.figures.subjects import subject
from benchmarks.paper.methods import METHODS, ScanPair
from benchmarks.paper.optional import need
from benchmarks.paper.settings import SETTINGS, TUNED, azimuths_of, outcome, scans_of, start_poses
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.views import VirtualScan, overlap_of, pose_error, virtual_scan
from scanweld.config import Config, ContoursConfig
from scanweld.contours.coherence import ContourPair, coherence, contour_matcher
from scanweld.contours.contour_sets import observe_contours
from scanweld.contours.predict import predict_contours
from scanweld.contours.prune import (
    prune_invisible_observed,
    prune_invisible_predicted,
    prune_self_occlusion,
)
from scanweld.geometry.pose import Pose
from scanweld.published.m_icc import m_icc
from scanweld.published.mm_icc import mm_icc
from scanweld.refinement.refine import refine_poses

NAME = "figures"
TITLE = "Figures 1 to 6: what happens on the way"

GALLERY_START_DEG = (20, 40)
GALLERY_SEEDS = 8
TIMES = {"short": 0.0, "middle": 0.5, "long": 1.0}
"""Places among the diffusion times, from the shortest to the longest."""
PAIR_METHODS = ("m-icc", "paper-coarse", "default")


def units(quick: bool) -> list[Unit]:
    """A unit for each figure, or for each row or column of it."""
    if quick:
        return [
            {"figure": "pa-hks", "subject": "creature", "azimuth_deg": 60.0},
            {"figure": "prunings", "object": "creature", "azimuths_deg": [45.0, 105.0]},
            {"figure": "heat", "object": "creature", "azimuths_deg": [60.0, 90.0]},
            _gallery_unit("quick", 20, seeds=1),
        ]
    return [
        {"figure": "pa-hks", "subject": "armadillo", "azimuth_deg": 180.0},
        {"figure": "pa-hks", "subject": "bun000", "azimuth_deg": None},
        {"figure": "prunings", "object": "armadillo", "azimuths_deg": [150.0, 210.0]},
        {"figure": "prunings", "object": "armadillo", "azimuths_deg": [135.0, 225.0]},
        {"figure": "coarse", "object": "armadillo", "azimuths_deg": [145.0, 215.0]},
        {"figure": "four views", "setting": "vii"},
        {"figure": "heat", "object": "armadillo", "azimuths_deg": [120.0, 160.0, 200.0, 240.0]},
        *(
            _gallery_unit(numeral, degrees, GALLERY_SEEDS)
            for degrees in GALLERY_START_DEG
            for numeral in SETTINGS
            if numeral != "quick"
        ),
    ]


def _gallery_unit(numeral: str, degrees: int, seeds: int) -> Unit:
    return {
        "figure": "gallery",
        "setting": numeral,
        "start_deg": degrees,
        "seeds": seeds,
        "tuning": {name: dict(TUNED[name]) for name in ("m-icc", "mm-icc")},
    }


def measure(unit: Unit) -> Result:
    """Poses, keypoints and contours that a figure shows."""
    return _MEASURES[unit["figure"]](unit)


def page(records: Sequence[Record], out: Path) -> str:
    """All figures with their captions.

    Raises:
        InputError: If matplotlib is not installed.
    """
    need("matplotlib")
    from benchmarks.paper.figures_page import write_figures

    return write_figures(records, out)


def _keypoints(unit: Unit) -> Result:
    """Maxima of the heat signature as found, moved off the rims, and grouped."""
    scan = subject(unit["subject"], unit["azimuth_deg"])
    field = heat_field(scan)
    points = field.front.points
    return {
        "pixels": len(scan.mesh.vertices),
        "front_faces": len(field.front.faces),
        "other_faces": len(field.mesh.faces) - len(field.front.faces),
        "moved": int((field.found != field.moved).sum()),
        "before": points[field.found].tolist(),
        "after": points[field.moved].tolist(),
        "grouped": points[field.grouped].tolist(),
    }


def _contours(unit: Unit) -> Result:
    """Which contour points each pruning takes, at the true pose; pixels (u, v) of camera j."""
    i, j = (virtual_scan(unit["object"], azimuth) for azimuth in unit["azimuths_deg"])
    config, j_from_i = ContoursConfig(), j.from_other(i)
    a, b = observe_contours(i.scan, config), observe_contours(j.scan, config)
    predicted, corners = predict_contours(a, b, j_from_i)
    own = prune_self_occlusion(corners, a.is_border)
    visible = prune_invisible_predicted(predicted, j.scan.image.camera)
    shared = prune_invisible_observed(b.contour, i.scan.image.camera, j_from_i)
    sets = {
        "observed_kept": b.contour[shared],
        "observed_second": b.contour[~shared],
        "predicted_kept": predicted[own & visible],
        "predicted_first": predicted[~own],
        "predicted_third": predicted[own & ~visible],
    }
    stages = {
        "none": (predicted, b.contour),
        "1": (predicted[own], b.contour),
        "1 and 2": (predicted[own], b.contour[shared]),
        "1, 2 and 3": (predicted[own & visible], b.contour[shared]),
    }
    coherent = {
        name: coherence([ContourPair(predicted=p, observed=o)]) for name, (p, o) in stages.items()
    }
    return {
        "overlap": overlap_of(unit["object"], *unit["azimuths_deg"]),
        "coherence": coherent,
        **{name: points.pixels.tolist() for name, points in sets.items()},
    }


def _heat(unit: Unit) -> Result:
    """Diffusion times, and the range of the log signature over all views at each."""
    views = [virtual_scan(unit["object"], azimuth) for azimuth in unit["azimuths_deg"]]
    fields = [heat_field(view.scan) for view in views]
    last = len(fields[0].times) - 1
    rows = [
        {"name": name, **_heat_at(fields, round(place * last))} for name, place in TIMES.items()
    ]
    return {"times": rows, "keypoints": [len(field.grouped) for field in fields]}


def _heat_at(fields: Sequence[HeatField], index: int) -> dict[str, Any]:
    """One of the diffusion times, and the colours' range: all heat but the outermost percents."""
    values = np.concatenate([field.signature[:, index] for field in fields])
    return {
        "index": index,
        "time": float(np.mean([field.times[index] for field in fields])),
        "range": np.percentile(values, [8.0, 99.0]).tolist(),
    }


def _pair(unit: Unit) -> Result:
    """What methods make of a pair from the identity start."""
    i, j = (virtual_scan(unit["object"], azimuth) for azimuth in unit["azimuths_deg"])
    start = Pose.identity()
    answers = [_told(i, j, "start", start)]
    pair = ScanPair(i=i.scan, j=j.scan, diameter=i.diameter)
    for name in PAIR_METHODS:
        answers.append(_told(i, j, name, METHODS[name].run(pair, start, 0).i_from_j))
    return {"overlap": overlap_of(unit["object"], *unit["azimuths_deg"]), "answers": answers}


def _told(i: VirtualScan, j: VirtualScan, name: str, i_from_j: Pose | None) -> dict[str, Any]:
    if i_from_j is None:
        return {"method": name, "pose": None}
    rotation, translation = pose_error(i.from_other(j), i_from_j, j.centre(), i.diameter)
    return {
        "method": name,
        "pose": i_from_j.matrix().tolist(),
        "rotation_deg": rotation,
        "translation_percent": translation,
    }


def _four_views(unit: Unit) -> Result:
    """Four views that close a ring: pairs by two methods, laid in a chain, and their refinement."""
    setting = SETTINGS[unit["setting"]]
    views = scans_of(setting)
    scans = [view.scan for view in views]
    fields = [heat_field(scan) for scan in scans]
    steps = {"start": {k: Pose.identity() for k in range(len(views))}}
    for name in ("paper-coarse", "default"):
        chain = _chained(views, name)
        if chain is not None:
            steps[name] = chain
    if "default" in steps:
        config = Config()
        matcher = contour_matcher(scans, config.contours)
        refined = refine_poses(scans, steps["default"], setting.edges, config.refine, matcher)
        steps["refined"] = dict(refined.poses)
    return {
        "azimuths_deg": azimuths_of(setting),
        "diameter": views[0].diameter,
        "keypoints": [len(field.grouped) for field in fields],
        "heat": _heat_at(fields, len(fields[0].times) // 2),
        "steps": {name: _assembly(setting.edges, views, poses) for name, poses in steps.items()},
    }


def _chained(views: Sequence[VirtualScan], name: str) -> dict[int, Pose] | None:
    """Poses along the chain of adjacent views by a pair method; None if a pair has none."""
    poses = {0: Pose.identity()}
    for k, (i, j) in enumerate(pairwise(views)):
        pair = ScanPair(i=i.scan, j=j.scan, diameter=i.diameter)
        found = METHODS[name].run(pair, Pose.identity(), 0).i_from_j
        if found is None:
            return None
        poses[k + 1] = poses[k] @ found
    return poses


def _gallery(unit: Unit) -> Result:
    """M-ICC and MM-ICC of a setting of Table 2 from the same starts; the first one is shown."""
    setting = SETTINGS[unit["setting"]]
    views = scans_of(setting)
    starts = [start_poses(views, unit["start_deg"], seed) for seed in range(unit["seeds"])]
    result: dict[str, Any] = {
        "azimuths_deg": azimuths_of(setting),
        "diameter": views[0].diameter,
    }
    for name, align in (("m-icc", m_icc), ("mm-icc", mm_icc)):
        tuning = unit["tuning"][name]
        config = AS_PUBLISHED.model_copy(
            update={
                "jump_pixels": tuning["tau"],
                "num_renders": tuning["renders"],
                "trim": tuning["trim"],
            }
        )
        scans = [view.scan for view in views]
        found = [align(scans, start, setting.edges, config).poses for start in starts]
        right = sum(outcome(views, setting.edges, poses).is_converged for poses in found)
        result[name] = {**_assembly(setting.edges, views, found[0]), "converged": right}
    return result


def _assembly(
    edges: Sequence[tuple[int, int]], views: Sequence[VirtualScan], poses: Mapping[int, Pose]
) -> dict[str, Any]:
    """Poses in the frame of the first view, with their errors."""
    first = poses[0].inverse()
    matrices = [(first @ poses[k]).matrix().tolist() for k in sorted(poses)]
    return {"poses": matrices, **asdict(outcome(views, edges, poses))}


_MEASURES: dict[str, Callable[[Unit], Result]] = {
    "pa-hks": _keypoints,
    "prunings": _contours,
    "coarse": _pair,
    "four views": _four_views,
    "heat": _heat,
    "gallery": _gallery,
}
