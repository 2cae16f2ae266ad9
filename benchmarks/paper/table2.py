"""Table 2: M-ICC, MM-ICC and the default in the paper's seven settings."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from benchmarks.paper.settings import (
    COARSE_DEG,
    COARSE_PERCENT,
    FIRST_SWEPT,
    NUM_SWEPT,
    SETTINGS,
    STARTS,
    SWEEP,
    SWEEP_DEG,
    TITLES,
    TUNED,
    Setting,
    azimuths_of,
    outcome,
    scans_of,
    start_poses,
    true_poses,
)
from benchmarks.paper.study import Record, Unit
from benchmarks.paper.table2_page import tell
from benchmarks.paper.views import VirtualScan, mesh_of, pose_error
from scanweld.config import Config, ContoursConfig, FusionConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.geometry.pose import Pose
from scanweld.heat.features import describe
from scanweld.pipeline.run import run
from scanweld.published.coarse import register_as_published
from scanweld.published.m_icc import m_icc
from scanweld.published.mm_icc import mm_icc
from scanweld.refinement.refine import refine_poses

NAME = "table2"
TITLE = "Table 2: refinement in seven settings"

NOISES = (0.0, 0.001)
"""Standard deviation of the depth, in diameters."""
NUM_DEFAULT_DRAWS = 3
"""The default takes no start: only noise makes its runs differ."""


def units(quick: bool) -> list[Unit]:
    """The sweep of the tuning, and all methods with the tuning that it found.

    Raises:
        InputError: If a mesh is missing.
    """
    if quick:
        methods = ("m-icc", "mm-icc", "joint", "default")
        return [
            _final("quick", 0.0, method, [(degrees, 1) for degrees, _ in STARTS])
            for method in methods
        ]
    numerals = [numeral for numeral in SETTINGS if numeral != "quick"]
    for numeral in numerals:
        mesh_of(SETTINGS[numeral].name)
    sweep = [
        {"part": "sweep", "setting": numeral, "method": method, "seeds": NUM_SWEPT, **tuning}
        for method, tunings in SWEEP.items()
        for tuning in tunings
        for numeral in numerals
    ]
    final = [
        _final(numeral, noise, method, STARTS)
        for noise in NOISES
        for method in TITLES
        for numeral in numerals
    ]
    return [*sweep, *final]


def _final(numeral: str, noise: float, method: str, starts: Sequence[tuple[int, int]]) -> Unit:
    unit = {"part": "final", "setting": numeral, "noise": noise, "method": method}
    return {**unit, "starts": starts, **TUNED.get(method, {})}


def measure(unit: Unit) -> dict[str, Any]:
    """Errors from all starts of a setting, for one method and tuning."""
    setting = SETTINGS[unit["setting"]]
    if unit["method"] == "default":
        runs = _default_runs(setting, unit)
    elif unit["part"] == "sweep":
        runs = [_run(setting, unit, SWEEP_DEG, FIRST_SWEPT + k) for k in range(unit["seeds"])]
    else:
        starts = [(degrees, seed) for degrees, num in unit["starts"] for seed in range(num)]
        runs = [_run(setting, unit, *start) for start in starts]
        runs += _coarse_runs(setting, unit)
    return {
        "azimuths_deg": azimuths_of(setting),
        "diameter": scans_of(setting)[0].diameter,
        "runs": runs,
    }


def _run(setting: Setting, unit: Unit, degrees: float, seed: int) -> dict[str, Any]:
    scans = scans_of(setting, unit.get("noise", 0.0), seed)
    found = _refined(setting, scans, start_poses(scans, degrees, seed), unit)
    return {"start": degrees, "seed": seed, **asdict(outcome(scans, setting.edges, found))}


def _refined(
    setting: Setting, scans: Sequence[VirtualScan], start: Mapping[int, Pose], unit: Unit
) -> Mapping[int, Pose]:
    prepared = [scan.scan for scan in scans]
    if unit["method"] == "joint":
        config = Config()
        matcher = contour_matcher(prepared, config.contours)
        return refine_poses(prepared, start, setting.edges, config.refine, matcher).poses
    if unit["method"] == "m-icc":
        config = ContoursConfig(jump_pixels=unit["tau"], num_renders=unit["renders"])
        return m_icc(prepared, start, setting.edges, config).poses
    config = ContoursConfig(jump_pixels=unit["tau"], num_renders=unit["renders"], trim=unit["trim"])
    return mm_icc(prepared, start, setting.edges, config).poses


def _coarse_runs(setting: Setting, unit: Unit) -> list[dict[str, Any]]:
    """From the coarse poses as published; none where one of them is wrong."""
    scans = scans_of(setting, unit["noise"])
    start = _coarse_poses(setting, unit["noise"])
    if start is None:
        return []
    found = _refined(setting, scans, start, unit)
    return [{"start": "coarse", "seed": 0, **asdict(outcome(scans, setting.edges, found))}]


@lru_cache
def _coarse_poses(setting: Setting, noise: float) -> dict[int, Pose] | None:
    """Poses by the published coarse step along the views; None if it puts one of them wrong."""
    config, scans = Config(), scans_of(setting, noise)
    features = [describe(scan.scan, config.heat) for scan in scans]
    poses = {0: Pose.identity()}
    for k in range(1, len(scans)):
        i, j = scans[k - 1], scans[k]
        found = register_as_published(
            i.scan, j.scan, features[k - 1], features[k], config.coarse
        ).i_from_j
        if found is None:
            return None
        poses[k] = poses[k - 1] @ found
        rotation, shift = pose_error(true_poses(scans)[k], poses[k], j.centre(), j.diameter)
        if rotation > COARSE_DEG or shift > COARSE_PERCENT:
            return None
    return poses


def _default_runs(setting: Setting, unit: Unit) -> list[dict[str, Any]]:
    """Scans in, poses out; a view that is not placed counts as not converged."""
    runs = []
    config = Config(fusion=FusionConfig(max_voxels_across=50))
    for draw in range(NUM_DEFAULT_DRAWS if unit["noise"] else 1):
        scans = scans_of(setting, unit["noise"], draw)
        found = run([scan.scan.scan for scan in scans], config, workers=1)
        poses = [found.poses.get(scan.scan.name) for scan in scans]
        placed = {k: pose for k, pose in enumerate(poses) if pose is not None}
        together = len(found.components) == 1 and len(placed) == len(scans)
        errors = asdict(outcome(scans, setting.edges, placed)) if together else {}
        runs.append({"start": "none", "seed": draw, **errors})
    return runs


def page(records: Sequence[Record], out: Path) -> str:
    """The paper's columns beside ours, from where runs converge, the tuning, and the floors."""
    return tell(records)
