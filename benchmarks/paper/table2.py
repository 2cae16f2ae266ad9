"""Table 2: M-ICC, MM-ICC and the default in the paper's seven settings."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from benchmarks.paper import settings
from benchmarks.paper.baselines.own import aligned, coarse_pose, jointly_refined
from benchmarks.paper.views import VirtualScan, mesh_of, pose_error
from benchmarks.study.study import Unit
from scanweld.config import Config, FusionConfig
from scanweld.geometry.pose import Pose
from scanweld.pipeline.run import run

NAME = "table2"

METHODS = ("m-icc", "mm-icc", "joint", "default")
NOISES = (0.0, 0.001)
"""Standard deviation of the depth, in diameters."""
NUM_DEFAULT_DRAWS = 3
"""The default takes no start: only noise makes its runs differ."""


def units(quick: bool) -> list[Unit]:
    """The sweep of the tuning, and all methods with the tuning that it found."""
    if quick:
        return [
            _final(settings.QUICK, 0.0, method, [(deg, 1) for deg, _ in settings.STARTS])
            for method in METHODS
        ]
    for setting in settings.NUMERALS:
        mesh_of(settings.SETTINGS[setting].name)
    sweep = [
        {
            "part": "sweep",
            "setting": setting,
            "method": method,
            "seeds": settings.NUM_SWEPT,
            **tuning,
        }
        for method, tunings in settings.SWEEP.items()
        for tuning in tunings
        for setting in settings.NUMERALS
    ]
    final = [
        _final(setting, noise, method, settings.STARTS)
        for noise in NOISES
        for method in METHODS
        for setting in settings.NUMERALS
    ]
    return [*sweep, *final]


def _final(setting: str, noise: float, method: str, starts: Sequence[tuple[int, int]]) -> Unit:
    unit = {"part": "final", "setting": setting, "noise": noise, "method": method}
    return {**unit, "starts": starts, **settings.TUNED.get(method, {})}


def measure(unit: Unit) -> dict[str, Any]:
    """Errors from all starts of a setting, for one method and tuning."""
    setting = settings.SETTINGS[unit["setting"]]
    if unit["method"] == "default":
        runs = _default_runs(setting, unit["noise"])
    elif unit["part"] == "sweep":
        runs = [
            _run(setting, unit, settings.SWEEP_DEG, settings.FIRST_SWEPT + k)
            for k in range(unit["seeds"])
        ]
    else:
        starts = [(degrees, seed) for degrees, num in unit["starts"] for seed in range(num)]
        runs = [_run(setting, unit, *start) for start in starts]
        runs += _coarse_runs(setting, unit)
    return {
        "azimuths_deg": settings.azimuths_of(setting),
        "diameter": settings.scans_of(setting)[0].diameter,
        "runs": runs,
    }


def _run(setting: settings.Setting, unit: Unit, degrees: float, seed: int) -> dict[str, Any]:
    scans = settings.scans_of(setting, unit.get("noise", 0.0), seed)
    found = _refined(setting, scans, settings.start_poses(scans, degrees, seed), unit)
    return {"start": degrees, "seed": seed, **settings.outcome(scans, setting.edges, found)}


def _refined(
    setting: settings.Setting, scans: Sequence[VirtualScan], start: Mapping[int, Pose], unit: Unit
) -> Mapping[int, Pose]:
    prepared, method = [scan.scan for scan in scans], unit["method"]
    if method == "joint":
        return jointly_refined(prepared, start, setting.edges)
    return aligned(method, prepared, start, setting.edges, **settings.contour_settings(unit)).poses


def _coarse_runs(setting: settings.Setting, unit: Unit) -> list[dict[str, Any]]:
    """From the coarse poses as published; none where one of them is wrong."""
    scans = settings.scans_of(setting, unit["noise"])
    start = _coarse_poses(setting, unit["noise"])
    if start is None:
        return []
    found = _refined(setting, scans, start, unit)
    return [{"start": "coarse", "seed": 0, **settings.outcome(scans, setting.edges, found)}]


@lru_cache
def _coarse_poses(setting: settings.Setting, noise: float) -> dict[int, Pose] | None:
    """Poses by the published coarse step along the views; None if it puts one of them wrong."""
    scans, poses = settings.scans_of(setting, noise), {0: Pose.identity()}
    true = settings.true_poses(scans)
    for k, scan in enumerate(scans[1:], 1):
        found = coarse_pose(scans[k - 1].scan, scan.scan).i_from_j
        if found is None:
            return None
        poses[k] = poses[k - 1] @ found
        error = pose_error(true[k], poses[k], scan.centre(), scan.diameter)
        if not settings.COARSE_RIGHT.holds(error):
            return None
    return poses


def _default_runs(setting: settings.Setting, noise: float) -> list[dict[str, Any]]:
    """Scans in, poses out; a view that is not placed counts as not converged."""
    runs = []
    config = Config(fusion=FusionConfig(max_voxels_across=50))
    for draw in range(NUM_DEFAULT_DRAWS if noise else 1):
        scans = settings.scans_of(setting, noise, draw)
        found = run([scan.scan.scan for scan in scans], config, workers=1)
        poses = [found.poses.get(scan.scan.scan.name) for scan in scans]
        placed = {k: pose for k, pose in enumerate(poses) if pose is not None}
        together = len(found.components) == 1 and len(placed) == len(scans)
        errors = settings.outcome(scans, setting.edges, placed) if together else {}
        runs.append({"start": "none", "seed": draw, **errors})
    return runs
