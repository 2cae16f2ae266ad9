"""Figures 1 to 6 of the paper, on the same objects and at the same view gaps."""

from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np

from benchmarks.paper import settings
from benchmarks.paper.baselines.own import aligned, jointly_refined
from benchmarks.paper.heat_field import HeatField, heat_field
from benchmarks.paper.methods import METHODS
from benchmarks.paper.views import (
    KnownPair,
    VirtualScan,
    data_file,
    known_pair,
    overlap_of,
    virtual_scan,
)
from benchmarks.study.study import Result, Unit
from scanweld.config import ContoursConfig, PrepareConfig
from scanweld.contours.coherence import ContourPair, coherence
from scanweld.contours.contour_sets import observe_contours
from scanweld.contours.predict import predict_contours
from scanweld.contours.prune import (
    prune_invisible_observed,
    prune_invisible_predicted,
    prune_self_occlusion,
)
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.io import read_scan
from scanweld.preparation import prepare

NAME = "figures"

GALLERY_START_DEG = (20, 40)
GALLERY_SEEDS = 8
TIMES = {"short": 0.0, "middle": 0.5, "long": 1.0}
"""Places among the diffusion times, from the shortest to the longest."""
PAIR_METHODS = ("m-icc", "paper-coarse", "default")


def units(quick: bool) -> list[Unit]:
    """A unit for each figure, or for each row or column of it."""
    if quick:
        return [*settings.STUDY["quick-figures"], _gallery_unit(settings.QUICK, 20, seeds=1)]
    gallery = product(GALLERY_START_DEG, settings.NUMERALS)
    gallery = (_gallery_unit(numeral, degrees, GALLERY_SEEDS) for degrees, numeral in gallery)
    return [*settings.STUDY["figures"], *gallery]


def _gallery_unit(numeral: str, degrees: int, seeds: int) -> Unit:
    unit = {"figure": "gallery", "setting": numeral, "start_deg": degrees, "seeds": seeds}
    return {**unit, "tuning": {name: dict(tuning) for name, tuning in settings.TUNED.items()}}


def measure(unit: Unit) -> Result:
    """Poses, keypoints and contours that a figure shows."""
    measuring = {
        **{"pa-hks": _keypoints, "prunings": _contours, "coarse": _pair},
        **{"four views": _four_views, "heat": _heat, "gallery": _gallery},
    }
    return measuring[unit["figure"]](unit)


def subject(name: str, azimuth_deg: float | None) -> PreparedScan:
    """A virtual scan of an object from an azimuth, or without one a real scan of the bunny."""
    if azimuth_deg is not None:
        return virtual_scan(name, azimuth_deg).scan
    return prepare(read_scan(data_file(f"stanford-bunny/{name}.ply")), PrepareConfig())


def pair_of(unit: Unit) -> KnownPair:
    """The first two views that a figure shows."""
    i, j = (virtual_scan(unit["object"], azimuth) for azimuth in unit["azimuths_deg"])
    return known_pair(i, j)


def _keypoints(unit: Unit) -> Result:
    """Maxima of the heat signature as found, moved off the rims, and grouped."""
    scan = subject(unit["subject"], unit.get("azimuth_deg"))
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
    pair, config = pair_of(unit), ContoursConfig()
    i, j, j_from_i = pair.i, pair.j, pair.true.inverse()
    a, b = observe_contours(i, config), observe_contours(j, config)
    predicted, corners = predict_contours(a, b, j_from_i)
    own = prune_self_occlusion(corners, a.is_border)
    visible = prune_invisible_predicted(predicted, j.image.camera)
    shared = prune_invisible_observed(b.contour, i.image.camera, j_from_i)
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
    return {
        "overlap": overlap_of(unit["object"], *unit["azimuths_deg"]),
        "coherence": {
            name: coherence([ContourPair(predicted=p, observed=o)])
            for name, (p, o) in stages.items()
        },
        **{name: points.pixels.tolist() for name, points in sets.items()},
    }


def _heat(unit: Unit) -> Result:
    """Diffusion times, and the range of the log signature over all views at each."""
    fields = [heat_field(virtual_scan(unit["object"], a).scan) for a in unit["azimuths_deg"]]
    last = len(fields[0].times) - 1
    times = [
        {"name": name, **_heat_at(fields, round(place * last))} for name, place in TIMES.items()
    ]
    return {"times": times, "keypoints": [len(field.grouped) for field in fields]}


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
    pair, start = pair_of(unit), Pose.identity()
    poses: dict[str, Pose | None] = {"start": start}
    poses |= {name: METHODS[name].run(pair.scans, start, 0).i_from_j for name in PAIR_METHODS}
    answers = []
    for name, pose in poses.items():
        error = pair.error(pose)
        errors = {"rotation_deg": error["deg"], "translation_percent": error["percent"]}
        matrix = None if pose is None else pose.matrix().tolist()
        answers.append({"method": name, "pose": matrix, **errors})
    return {"overlap": overlap_of(unit["object"], *unit["azimuths_deg"]), "answers": answers}


def _four_views(unit: Unit) -> Result:
    """Four views that close a ring: pairs by two methods, laid in a chain, and their refinement."""
    setting = settings.SETTINGS[unit["setting"]]
    views = settings.scans_of(setting)
    scans = [view.scan for view in views]
    fields = [heat_field(scan) for scan in scans]
    steps: dict[str, dict[int, Pose]] = {"start": {k: Pose.identity() for k in range(len(views))}}
    for name in ("paper-coarse", "default"):
        chain = _chained(views, name)
        if chain is not None:
            steps[name] = chain
    if "default" in steps:
        steps["refined"] = jointly_refined(scans, steps["default"], setting.edges)
    return {
        "azimuths_deg": settings.azimuths_of(setting),
        "diameter": views[0].diameter,
        "keypoints": [len(field.grouped) for field in fields],
        "heat": _heat_at(fields, len(fields[0].times) // 2),
        "steps": {name: _assembly(setting.edges, views, poses) for name, poses in steps.items()},
    }


def _chained(views: Sequence[VirtualScan], name: str) -> dict[int, Pose] | None:
    """Poses along the chain of adjacent views by a pair method; None if a pair has none."""
    poses = {0: Pose.identity()}
    for k, (i, j) in enumerate(pairwise(views)):
        found = METHODS[name].run(known_pair(i, j).scans, Pose.identity(), 0).i_from_j
        if found is None:
            return None
        poses[k + 1] = poses[k] @ found
    return poses


def _gallery(unit: Unit) -> Result:
    """M-ICC and MM-ICC of a setting of Table 2 from the same starts; the first one is shown."""
    setting = settings.SETTINGS[unit["setting"]]
    views = settings.scans_of(setting)
    scans = [view.scan for view in views]
    starts = [settings.start_poses(views, unit["start_deg"], seed) for seed in range(unit["seeds"])]
    result: dict[str, Any] = {
        "azimuths_deg": settings.azimuths_of(setting),
        "diameter": views[0].diameter,
    }
    for method, tuning in unit["tuning"].items():
        config = settings.contour_settings(tuning)
        found = [aligned(method, scans, start, setting.edges, **config).poses for start in starts]
        right = sum(
            settings.is_converged(settings.outcome(views, setting.edges, poses)) for poses in found
        )
        result[method] = {**_assembly(setting.edges, views, found[0]), "converged": right}
    return result


def _assembly(
    edges: Sequence[tuple[int, int]], views: Sequence[VirtualScan], poses: Mapping[int, Pose]
) -> dict[str, Any]:
    """Poses in the frame of the first view, with their errors."""
    first = poses[0].inverse()
    matrices = [(first @ poses[k]).matrix().tolist() for k in sorted(poses)]
    return {"poses": matrices, **settings.outcome(views, edges, poses)}
