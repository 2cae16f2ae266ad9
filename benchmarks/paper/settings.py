"""The seven settings of the paper's Table 2: views, starts, tuning and errors."""

import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from benchmarks.paper.views import (
    PIXELS,
    VirtualScan,
    camera_view,
    disturbed,
    mesh_of,
    pose_error,
    virtual_scan,
)
from benchmarks.study.records import Limit
from scanweld.config import ContoursConfig
from scanweld.contours.contour_sets import far_side
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import principal_diameter

AZIMUTH_STEP_DEG = 15
"""Simple and complex views are chosen among rings that start at multiples of this."""
CONVERGED = Limit(deg=2.0, percent=1.0)
"""A run has converged if every view is turned and shifted (of the diameter) by less."""
STARTS = ((10, 8), (20, 8), (40, 32))
"""Angle of the starts in degrees, and how many: from near, nearly all runs converge."""
NUM_SWEPT, FIRST_SWEPT = 8, 100
"""Other starts, by number and first seed, by which the tuning is chosen."""
SWEEP_DEG = 40
"""The tuning is chosen by the hardest starts: from the others nearly all runs converge."""
REPEATED_DIAMETERS = 0.04
"""A keypoint is repeated if the other view has one within this distance,"""
RIGHT_DIAMETERS = 0.06
"""and a match is right within this one."""
COARSE_RIGHT = Limit(deg=5.0, percent=2.0)
"""Within this a coarse pose is."""


Tuning = Mapping[str, float | int | None]


class Setting(NamedTuple):
    """A row of the paper's Table 2, as study.toml describes it."""

    name: str
    gap_deg: int
    num_views: int
    kind: Literal["simple", "complex"]
    printed: tuple[float, float] = (0.0, 0.0)

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """Pairs of adjacent views."""
        chain = [(k, k + 1) for k in range(self.num_views - 1)]
        closes = self.num_views * self.gap_deg == 360
        return (*chain, (self.num_views - 1, 0)) if closes else tuple(chain)


def _tuning(change: Mapping[str, Any], used: Mapping[str, Any]) -> Tuning:
    return {k: None if v == "auto" else v for k, v in {**used, **change}.items()}


STUDY = tomllib.loads(Path(__file__).with_name("study.toml").read_text(encoding="utf-8"))
QUICK = "quick"
SETTINGS = {
    numeral: Setting(**{**row, "printed": tuple(row.get("printed", (0.0, 0.0)))})
    for numeral, row in STUDY["settings"].items()
}
"""The seven by numeral, and one that needs no data."""
NUMERALS = tuple(numeral for numeral in SETTINGS if numeral != QUICK)
TUNED: dict[str, Tuning] = {name: _tuning({}, used) for name, used in STUDY["tuned"].items()}
SWEEP: dict[str, list[Tuning]] = {
    name: [_tuning(change, STUDY["tuned"][name]) for change in changes]
    for name, changes in STUDY["sweep"].items()
}


def contour_settings(tuning: Mapping[str, Any]) -> dict[str, Any]:
    """A tuning as settings of the package."""
    names = {"tau": "jump_pixels", "renders": "num_renders", "trim": "trim"}
    return {names[key]: tuning[key] for key in names}


@lru_cache
def azimuths_of(setting: Setting) -> tuple[float, ...]:
    """The views of a setting: of all rings of this gap, those that hide least or most."""
    span = 360 if setting.num_views * setting.gap_deg < 360 else setting.gap_deg
    rings = [
        tuple(float((first + k * setting.gap_deg) % 360) for k in range(setting.num_views))
        for first in range(0, span, AZIMUTH_STEP_DEG)
    ]
    hidden = [sum(self_occlusion(setting.name, azimuth) for azimuth in ring) for ring in rings]
    chosen = np.argmin(hidden) if setting.kind == "simple" else np.argmax(hidden)
    return rings[int(chosen)]


@lru_cache(maxsize=512)
def self_occlusion(name: str, azimuth_deg: float) -> int:
    """Length in pixels of the occlusion contour O (paper eq. 3) of a view of an object."""
    mesh, view = mesh_of(name), camera_view(name, azimuth_deg)
    vertices = view.world_from_sensor.inverse().apply(mesh.vertices)
    depth, _ = render_depth(vertices, mesh.faces, view.camera)
    pixel = principal_diameter(mesh.vertices) / PIXELS
    return int(far_side(depth, ContoursConfig().jump_pixels * pixel).sum())


def scans_of(setting: Setting, noise: float = 0.0, seed: int = 0) -> list[VirtualScan]:
    """The scans of a setting; the noise's standard deviation is in diameters."""
    return [
        virtual_scan(setting.name, azimuth, noise=noise, seed=seed * 10 + k)
        for k, azimuth in enumerate(azimuths_of(setting))
    ]


def true_poses(scans: Sequence[VirtualScan]) -> dict[int, Pose]:
    """``first_from_sensor`` of every scan."""
    return {k: scans[0].from_other(scan) for k, scan in enumerate(scans)}


def start_poses(scans: Sequence[VirtualScan], degrees: float, seed: int) -> dict[int, Pose]:
    """The true poses, every scan but the first turned about its middle.

    Two neighbours in a ring that are both turned start up to twice as far off.
    """
    true = true_poses(scans)
    turned = {
        k: disturbed(true[k], scans[k].centre(), degrees, seed * 10 + k)
        for k in range(1, len(scans))
    }
    return true | turned


def is_converged(run: Mapping[str, Any]) -> bool:
    """Whether all views came out right; a run without errors did not place all of them."""
    found = {"deg": run.get("rotation_deg"), "percent": run.get("translation_percent")}
    return CONVERGED.holds(found)


def outcome(
    scans: Sequence[VirtualScan],
    edges: Sequence[tuple[int, int]],
    world_from_sensor: Mapping[int, Pose],
) -> dict[str, float]:
    """Hold poses, in any common frame, against the truth.

    Returns:
        "rotation_deg" of the view that is turned most against the first one;
        "translation_percent" of the view whose middle is farthest off, in % of the diameter;
        "rms_percent", the distance of true correspondences over the moved scan, root mean square,
        in % of the diameter: its mean over the pairs of adjacent views.
    """
    diameter, true = scans[0].diameter, true_poses(scans)
    found = {k: world_from_sensor[0].inverse() @ pose for k, pose in world_from_sensor.items()}
    errors = [
        pose_error(true[k], found[k], scans[k].centre(), diameter) for k in range(1, len(scans))
    ]
    rms = [
        correspondence_rms(
            scans[i].from_other(scans[j]),
            found[i].inverse() @ found[j],
            scans[j].scan.scan.points,
        )
        for i, j in edges
    ]
    return {
        "rotation_deg": max(error["deg"] or 0.0 for error in errors),
        "translation_percent": max(error["percent"] or 0.0 for error in errors),
        "rms_percent": 100 * float(np.mean(rms)) / diameter,
    }


def correspondence_rms(true: Pose, found: Pose, points: FloatArray) -> float:
    """Root mean square distance of points (N, 3) of j posed by two i_from_j, in their unit."""
    apart = found.apply(points) - true.apply(points)
    return float(np.sqrt((apart**2).sum(axis=1).mean()))
