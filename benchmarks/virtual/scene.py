"""A scene: scans under neutral names in random frames, and the truth about them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from benchmarks.virtual.bodies import Body, make_body
from benchmarks.virtual.disturbances import Disturbance, Strangers
from benchmarks.virtual.shots import SLIGHT, Shot, Taking, Views, is_chain, take_shots
from scanweld.evaluation.metrics import RIGHT, Limits, object_diameter
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import View
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.pose import Pose, random_rotation
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import RangeScan, principal_diameter

CHAIN_OVERLAP = 0.2
"""Pairs of neighbours overlap by at least this share."""
BASIN = Limits(rotation_deg=5.0, translation_percent=4.0)
"""Where a sensor's own error moves the best pose, that of the right basin is right."""
MAX_DRAWS = 60
MARK_PIXELS, HIDDEN_PIXELS = 25, 3
"""A scan that shows a mark shows so many pixels of it, another one next to none."""
MIN_MARKED = 2
"""Scans that show it."""


class Group(StrEnum):
    """What is asked of a scenario."""

    CLEAN = "clean"
    HARD = "hard"
    CROP = "crop"
    SCALE = "scale"
    SYMMETRIC = "symmetric"
    FILES = "files"
    SENSOR = "sensor"
    TWO_BODIES = "two bodies"
    REPORTED = "reported"


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """How to make the scans of a run."""

    group: Group  # What is asked of it
    seeds: int  # How many runs
    body: str = "thing"  # Name of the object
    views: Views  # Where it is scanned from
    taking: Taking = take_shots  # What else is in front of the sensor
    noise: NoiseModel = SLIGHT  # What the sensor does to depth
    crop: Disturbance | None = None  # What is cut off the scans
    disturbances: tuple[Disturbance, ...] = ()  # What happens to them after that, one by one
    strangers: Strangers | None = None  # Scans that are added
    # Of the pairs that connect all scans of the object; views are drawn anew until this holds
    min_overlap: float = CHAIN_OVERLAP
    # Whether the first scan is not to be placed, so that the others have to be connected without it
    spoils_first: bool = False
    limits: Limits = RIGHT  # Within which a pose is right
    # Share of the scans that belong that are right and called good, at least; None: is not asked
    min_kept: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """What the main job is given, and what it should find."""

    scans: list[RangeScan]  # In random frames, under neutral names
    truth: dict[str, Pose]  # world_from_scan of all that belong somewhere
    worlds: dict[str, int]  # Number of each scan's world; a second object has one of its own
    sources: dict[str, str]  # What each scan was made from, in words
    factors: dict[str, float]  # Scale of the scans whose scale is wrong
    # Scans whose pose nothing that they show determines: those of symmetric objects, and those that
    # do not see the one mark
    is_open: frozenset[str]
    diameter: float  # Of the object, or of what a crop left of it
    centroids: dict[str, FloatArray]  # Of what each scan shows of the object, in its frame
    limits: Limits = RIGHT  # Within which a pose is right
    # (N,) points that lie on the object, of the scans that show much else
    on_object: dict[str, BoolArray] = field(default_factory=dict)


def make_scene(scenario: Scenario, seed: int) -> Scene:
    """The scans of a scenario; those of the same object and views differ in nothing else.

    Raises:
        ValueError: If no draw of the views gives the overlap that is asked for.
    """
    body = make_body(scenario.body, seed)
    for draw in range(MAX_DRAWS):
        views = scenario.views(body, np.random.default_rng([seed, 0, draw]))
        bare = _cropped(scenario, take_shots(body, views, SLIGHT, seed), seed, draw)
        if is_chain(bare[scenario.spoils_first :], scenario.min_overlap) and _shows(body, views):
            break
    else:
        raise ValueError(f"no views of the {scenario.body} overlap enough, seed {seed}")
    shots = scenario.taking(body, views, scenario.noise, seed)
    shots = _cropped(scenario, with_mark_seen(shots, body, views, MARK_PIXELS), seed, draw)
    rng = np.random.default_rng([seed, 1])
    for disturb in scenario.disturbances:
        shots = disturb(shots, rng)
    if scenario.strangers:
        shots = shots + scenario.strangers(seed, rng)
    left = object_diameter([s.scan for s in bare], {s.scan.name: s.pose for s in bare})
    scene = posed(shots, body, min(left, principal_diameter(body.mesh.vertices)), seed)
    return replace(scene, limits=scenario.limits)


def mark_pixels(body: Body, views: Sequence[View]) -> list[int]:
    """Pixels of each view that show the mark: those that are elsewhere without it."""
    assert body.unmarked is not None
    counts = []
    for view in views:
        sensor_from_world = view.world_from_sensor.inverse()
        with_mark, without = (
            render_depth(sensor_from_world.apply(mesh.vertices), mesh.faces, view.camera)[0]
            for mesh in (body.mesh, body.unmarked)
        )
        near = np.abs(with_mark - without) <= view.camera.footprint(float(np.nanmedian(without)))
        neither = np.isnan(with_mark) & np.isnan(without)
        counts.append(int((~near & ~neither).sum()))
    return counts


def with_mark_seen(
    shots: list[Shot], body: Body, views: Sequence[View], min_pixels: int
) -> list[Shot]:
    """The shots, each knowing whether it shows the mark, if there is one."""
    if body.unmarked is None:
        return shots
    counted = zip(shots, mark_pixels(body, views), strict=True)
    return [replace(shot, sees_mark=count >= min_pixels) for shot, count in counted]


def _shows(body: Body, views: Sequence[View]) -> bool:
    """Whether the mark is there to see, where there is one, and no view sees half of it."""
    if body.unmarked is None:
        return True
    counts = np.array(mark_pixels(body, views))
    shown = counts >= MARK_PIXELS
    return int(shown.sum()) >= MIN_MARKED and bool((shown | (counts <= HIDDEN_PIXELS)).all())


def _cropped(scenario: Scenario, shots: list[Shot], seed: int, draw: int) -> list[Shot]:
    rng = np.random.default_rng([seed, 3, draw])
    return scenario.crop(shots, rng) if scenario.crop else shots


def posed(shots: Sequence[Shot], body: Body, diameter: float, seed: int) -> Scene:
    """Shuffle, rename, and move every scan into a random frame."""
    rng = np.random.default_rng([seed, 2])
    order = enumerate(rng.permutation(len(shots)), start=1)
    of = {f"scan_{number:02d}": shots[k] for number, k in order}
    scans: list[RangeScan] = []
    truth: dict[str, Pose] = {}
    for name, shot in of.items():
        turn, reach = random_rotation(rng), 2 * diameter
        motion = Pose(rotation=turn, translation=rng.uniform(-reach, reach, size=3))
        points, sensor = motion.apply(shot.scan.points), shot.scan.scan_from_sensor
        sensor = None if sensor is None else motion @ sensor
        scans.append(replace(shot.scan, name=name, points=points, scan_from_sensor=sensor))
        if shot.world_from_sensor is not None:
            truth[name] = shot.world_from_sensor @ motion.inverse()
    on_object = {name: shot.on_object for name, shot in of.items() if shot.mask is not None}
    is_open = {n for n, s in of.items() if (body.is_symmetric or not s.sees_mark) and s.world == 0}
    return Scene(
        scans=scans,
        truth=truth,
        worlds={name: shot.world for name, shot in of.items()},
        sources={name: shot.scan.name for name, shot in of.items()},
        factors={name: shot.factor for name, shot in of.items() if shot.factor != 1.0},
        is_open=frozenset(is_open & set(truth)),
        diameter=diameter,
        centroids={s.name: _middle_of(s, on_object.get(s.name)) for s in scans},
        on_object=on_object,
    )


def _middle_of(scan: RangeScan, on_object: BoolArray | None) -> FloatArray:
    """Mean (3,) of the points of a scan, or of those that lie on the object."""
    points = scan.points if on_object is None else scan.points[on_object]
    return points.mean(axis=0)
