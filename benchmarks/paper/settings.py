"""The seven settings of the paper's Table 2: views, starts, tuning and errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from benchmarks.paper.views import (
    PIXELS,
    UP,
    VirtualScan,
    disturbed,
    mesh_of,
    pose_error,
    virtual_scan,
)
from scanweld.config import ContoursConfig
from scanweld.contours.contour_sets import far_side
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import principal_diameter

AZIMUTH_STEP_DEG = 15
"""Simple and complex views are chosen among rings that start at multiples of this."""
CONVERGED_DEG = 2.0
CONVERGED_PERCENT = 1.0
"""A run has converged if every view is turned and shifted (of the diameter) by less."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """A row of the paper's Table 2.

    Attributes:
        numeral: The paper's.
        name: Of the object.
        gap_deg: Between adjacent views.
        num_views: Two, or four that close a ring.
        kind: Views with the least or with the most self-occlusion.
        printed: The paper's RMS of M-ICC and of its "Proposed"; it gives no unit.
    """

    numeral: str
    name: str
    gap_deg: int
    num_views: int
    kind: Literal["simple", "complex"]
    printed: tuple[float, float] | None

    @property
    def title(self) -> str:
        """The setting in words."""
        return f"({self.numeral}) {self.name}, {self.gap_deg}°, {self.num_views} {self.kind} views"

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """Pairs of adjacent views."""
        chain = [(k, k + 1) for k in range(self.num_views - 1)]
        closes = self.num_views * self.gap_deg == 360
        return (*chain, (self.num_views - 1, 0)) if closes else tuple(chain)


def _setting(numeral: str, name: str, gap: int, number: int, kind: str, *printed: float) -> Setting:
    assert kind in ("simple", "complex")
    return Setting(
        numeral=numeral,
        name=name,
        gap_deg=gap,
        num_views=number,
        kind=kind,
        printed=(printed[0], printed[1]) if printed else None,
    )


SETTINGS = {
    setting.numeral: setting
    for setting in (
        _setting("i", "armadillo", 70, 2, "simple", 1.099, 0.290),
        _setting("ii", "armadillo", 70, 2, "complex", 3.169, 0.281),
        _setting("iii", "armadillo", 90, 2, "complex", 3.289, 0.233),
        _setting("iv", "bunny", 60, 2, "simple", 0.521, 0.189),
        _setting("v", "bunny", 60, 2, "complex", 5.116, 0.116),
        _setting("vi", "bunny", 90, 4, "complex", 1.595, 0.206),
        _setting("vii", "armadillo", 90, 4, "complex", 4.476, 0.279),
        _setting("quick", "creature", 60, 2, "complex"),
    )
}
"""The seven by numeral, and one that needs no data."""


TITLES: dict[str, str] = {
    "m-icc": "M-ICC",
    "mm-icc": "MM-ICC",
    "joint": "joint refinement",
    "default": "default",
}
STARTS = ((10, 8), (20, 8), (40, 32))
"""Angle of the starts in degrees, and how many: from near, nearly all runs converge."""
NUM_SWEPT, FIRST_SWEPT = 8, 100
"""Other starts, by number and first seed, by which the tuning is chosen."""
SWEEP_DEG = 40
"""The tuning is chosen by the hardest starts: from the others nearly all runs converge."""
COARSE_DEG, COARSE_PERCENT = 5.0, 2.0
"""A coarse pose is right within these."""

Tuning = Mapping[str, float | int | None]
CENTRE: dict[str, Tuning] = {
    "m-icc": {"tau": 3.0, "renders": 40, "trim": None},
    "mm-icc": {"tau": 10.0, "renders": 40, "trim": 0.9},
}
"""What the sweep changes one thing of at a time: tau_1 = tau_2 in pixels, renderings, and the share
of matches kept in space (found anew if None; M-ICC's mutual matches are not trimmed)."""
SWEEP: dict[str, tuple[Tuning, ...]] = {
    "m-icc": tuple(
        {**CENTRE["m-icc"], **change}
        for change in ({}, {"tau": 5.0}, {"tau": 10.0}, {"renders": 10}, {"renders": 20})
    ),
    "mm-icc": tuple(
        {**CENTRE["mm-icc"], **change}
        for change in (
            *({}, {"tau": 3.0}, {"tau": 5.0}, {"renders": 10}, {"renders": 20}),
            *({"trim": 0.7}, {"trim": None}),
        )
    ),
}
TUNED: dict[str, Tuning] = CENTRE
"""What the sweep found best over all seven settings; the page says whether that is still so."""


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
    mesh = mesh_of(name)
    view = view_of(mesh, azimuth_deg, pixels=PIXELS, up=UP[name])
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


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """Errors of the poses that a method gave to the views of a setting.

    Attributes:
        rotation_deg: Of the view that is turned most against the first one.
        translation_percent: Of the view whose middle is farthest off, in % of the diameter.
        rms_percent: Distance of true correspondences over the moved scan, root mean square, in %
            of the diameter; mean over the pairs of adjacent views.
    """

    rotation_deg: float
    translation_percent: float
    rms_percent: float

    @property
    def is_converged(self) -> bool:
        """Whether all views came out right."""
        return is_converged(self.rotation_deg, self.translation_percent)


def is_converged(rotation_deg: float, translation_percent: float) -> bool:
    """Whether errors are those of a right pose."""
    return rotation_deg < CONVERGED_DEG and translation_percent < CONVERGED_PERCENT


def outcome(
    scans: Sequence[VirtualScan],
    edges: Sequence[tuple[int, int]],
    world_from_sensor: Mapping[int, Pose],
) -> Outcome:
    """Hold poses, in any common frame, against the truth."""
    diameter, true = scans[0].diameter, true_poses(scans)
    first_from_world = world_from_sensor[0].inverse()
    errors = [
        pose_error(true[k], first_from_world @ world_from_sensor[k], scans[k].centre(), diameter)
        for k in range(1, len(scans))
    ]
    rms = [
        correspondence_rms(
            scans[i].from_other(scans[j]),
            world_from_sensor[i].inverse() @ world_from_sensor[j],
            scans[j].scan.scan.points,
        )
        for i, j in edges
    ]
    return Outcome(
        rotation_deg=max(rotation for rotation, _ in errors),
        translation_percent=max(translation for _, translation in errors),
        rms_percent=100 * float(np.mean(rms)) / diameter,
    )


def correspondence_rms(true: Pose, found: Pose, points: FloatArray) -> float:
    """Root mean square distance of points (N, 3) of j posed by two i_from_j, in their unit."""
    apart = found.apply(points) - true.apply(points)
    return float(np.sqrt((apart**2).sum(axis=1).mean()))
