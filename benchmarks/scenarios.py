"""Named scenarios of the stress benchmark: what is scanned, from where, and what goes wrong."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from bodies import Body, make_body
from scanweld.evaluation.metrics import object_diameter, scan_centroids
from scanweld.evaluation.scanner import NoiseModel, scan_mesh
from scanweld.evaluation.views import View, view_of
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.grid import grid_faces
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.scan import RangeScan, Viewpoint, principal_diameter

PIXELS = 240.0
"""Pixels across the object's diameter, where a scenario does not say otherwise."""
SLIGHT = NoiseModel(depth_diameters=5e-4, dropout=0.01, grazing_dropout=0.6)
"""What a good scanner does to depth."""
ELEVATIONS_DEG = (20.0, -10.0)
JITTER_DEG = 5.0
JUMP_DIAMETERS = 0.03

Rng = np.random.Generator


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """A scan in its sensor's frame.

    Attributes:
        scan: With a grid and a camera.
        world_from_sensor: Where the sensor stood; None if the scan belongs nowhere.
    """

    scan: RangeScan
    world_from_sensor: Pose | None


Views = Callable[[Body, Rng], list[View]]
Disturbance = Callable[[list[Shot], Rng], list[Shot]]


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """Scans under neutral names in random frames, and the truth about them.

    Attributes:
        scans: What the pipeline is given.
        truth: world_from_scan of all that belong somewhere. Two objects that are mixed lie in
            frames of their own, so that only one of them can be right in one component.
        sources: What each scan was made from, in words.
        centroids: Of each scan, in its frame.
        diameter: Of the object.
        symmetry: Motions of the world that leave the object as it is.
    """

    scans: list[RangeScan]
    truth: dict[str, Pose]
    sources: dict[str, str]
    centroids: dict[str, FloatArray]
    diameter: float
    symmetry: tuple[Pose, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """How to make the scans of a run.

    Attributes:
        body: Name of the object.
        views: Where it is scanned from.
        noise: What the sensor does to depth.
        disturbances: What happens to the scans after that, one after the other.
    """

    body: str = "creature"
    views: Views
    noise: NoiseModel = SLIGHT
    disturbances: tuple[Disturbance, ...] = ()


def make_scene(name: str, seed: int, data: Path | None) -> Scene:
    """The scans of a scenario. Scenarios of the same object and views differ in nothing else."""
    scenario = SCENARIOS[name]
    body = make_body(scenario.body, seed + 1, data)
    shots = _shots(body, scenario.views, scenario.noise, seed, scenario.body)
    rng = np.random.default_rng([seed, 1])
    for disturb in scenario.disturbances:
        shots = disturb(shots, rng)
    return _posed(shots, principal_diameter(body.mesh.vertices), body.symmetry, seed)


def _shots(body: Body, views: Views, noise: NoiseModel, seed: int, source: str) -> list[Shot]:
    rng = np.random.default_rng([seed, 0])
    return [
        Shot(
            scan=scan_mesh(
                body.mesh,
                v.camera,
                v.world_from_sensor,
                noise,
                1000 * seed + k,
                name=f"{source} {k}",
            ),
            world_from_sensor=v.world_from_sensor,
        )
        for k, v in enumerate(views(body, rng))
    ]


def _posed(shots: list[Shot], reach: float, symmetry: tuple[Pose, ...], seed: int) -> Scene:
    """Shuffle, rename, and move every scan into a random frame."""
    rng = np.random.default_rng([seed, 2])
    scans: list[RangeScan] = []
    truth: dict[str, Pose] = {}
    sources: dict[str, str] = {}
    for number, k in enumerate(rng.permutation(len(shots)), start=1):
        shot, name = shots[k], f"scan_{number:02d}"
        motion = Pose(
            rotation=random_rotation(rng), translation=rng.uniform(-2 * reach, 2 * reach, size=3)
        )
        sensor = shot.scan.scan_from_sensor
        scans.append(
            replace(
                shot.scan,
                name=name,
                points=motion.apply(shot.scan.points),
                scan_from_sensor=None if sensor is None else motion @ sensor,
            )
        )
        sources[name] = shot.scan.name
        if shot.world_from_sensor is not None:
            truth[name] = shot.world_from_sensor @ motion.inverse()
    return Scene(
        scans=scans,
        truth=truth,
        sources=sources,
        centroids=scan_centroids(scans),
        diameter=object_diameter([s for s in scans if "half" not in sources[s.name]], truth),
        symmetry=symmetry,
    )


# Where the sensor stands


def ring(
    count: int,
    step_deg: float | None = None,
    *,
    pixels: tuple[float, ...] = (PIXELS,),
    elevations_deg: tuple[float, ...] = ELEVATIONS_DEG,
    model: CameraModel = CameraModel.PINHOLE,
    distance_diameters: float = 3.0,
) -> Views:
    """Views around the object, by turns from a little above and below, the sensor rolled."""
    step = 360.0 / count if step_deg is None else step_deg

    def views(body: Body, rng: Rng) -> list[View]:
        jitter = rng.uniform(-JITTER_DEG, JITTER_DEG, size=(count, 2))
        return [
            view_of(
                body.mesh,
                step * k + jitter[k, 0],
                elevations_deg[k % len(elevations_deg)] + jitter[k, 1],
                rng.uniform(-180, 180),
                pixels=pixels[k % len(pixels)],
                model=model,
                distance_diameters=distance_diameters,
                up=body.up,
            )
            for k in range(count)
        ]

    return views


def on_sphere(count: int) -> Views:
    """Views from directions drawn evenly from the sphere."""

    def views(body: Body, rng: Rng) -> list[View]:
        return [
            view_of(
                body.mesh,
                rng.uniform(0, 360),
                float(np.degrees(np.arcsin(rng.uniform(-1, 1)))),
                rng.uniform(-180, 180),
                pixels=PIXELS,
                up=body.up,
            )
            for _ in range(count)
        ]

    return views


def twice(views: Views, apart_deg: float) -> Views:
    """Each view and another one beside it, turned a little about the object's middle."""

    def both(body: Body, rng: Rng) -> list[View]:
        low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
        middle = 0.5 * (low + high)
        found = []
        for view in views(body, rng):
            axis = rng.normal(size=3)
            turn = rotation_exp(np.radians(apart_deg) * axis / np.linalg.norm(axis))
            about = Pose(rotation=turn, translation=middle - turn @ middle)
            found += [view, replace(view, world_from_sensor=about @ view.world_from_sensor)]
        return found

    return both


# What happens to the scans


def each(change: Callable[[RangeScan, Rng], RangeScan]) -> Disturbance:
    """A change that happens to every scan."""
    return lambda shots, rng: [replace(shot, scan=change(shot.scan, rng)) for shot in shots]


def outlier_points(share: float) -> Disturbance:
    """Pixels whose depth is drawn anew from a wider range than the object's."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        depth = _depth(scan)
        seen = np.isfinite(depth)
        low, high = depth[seen].min(), depth[seen].max()
        slack = 0.2 * (high - low)
        hit = seen & (rng.random(depth.shape) < share)
        depth[hit] = rng.uniform(low - slack, high + slack, size=int(hit.sum()))
        return _with_depth(scan, depth)

    return each(change)


def flying_pixels() -> Disturbance:
    """Pixels beside a jump, and beside the silhouette, measured somewhere in between."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        depth = _depth(scan)
        size = principal_diameter(scan.points)
        behind = np.where(np.isfinite(depth), depth, np.nanmax(depth) + 0.3 * size)
        far = ndimage.maximum_filter(behind, size=3)
        near = ndimage.minimum_filter(np.where(np.isfinite(depth), depth, np.inf), size=3)
        beside = far - np.where(np.isfinite(near), near, far) > JUMP_DIAMETERS * size
        chosen = beside & (rng.random(depth.shape) < 0.6)
        part = rng.random(int(chosen.sum()))
        depth[chosen] = near[chosen] + part * (far - near)[chosen]
        return _with_depth(scan, depth)

    return each(change)


def crop_to_ball(radius_diameters: float) -> Disturbance:
    """Only what lies within a ball about one place of the object is kept, as users crop."""

    def crop(shots: list[Shot], rng: Rng) -> list[Shot]:
        first = shots[0]
        assert first.world_from_sensor is not None
        size = principal_diameter(first.scan.points)
        spot = first.world_from_sensor.apply(
            first.scan.points[rng.integers(len(first.scan.points))]
        )
        kept = []
        for shot in shots:
            assert shot.world_from_sensor is not None
            away = shot.world_from_sensor.apply(shot.scan.points) - spot
            is_near = np.linalg.norm(away, axis=1) < radius_diameters * size
            kept.append(replace(shot, scan=_subset(shot.scan, is_near)))
        return kept

    return crop


def crop_to_window(share: float) -> Disturbance:
    """The sensor's image is smaller than the object: a window of it, somewhere else each time."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        assert scan.camera is not None and scan.grid is not None
        rows, columns = (np.flatnonzero((scan.grid >= 0).any(axis=a)) for a in (1, 0))
        spans = []
        for line in (rows, columns):
            length = int(share * len(line))
            start = int(line[0] + rng.integers(len(line) - length + 1))
            spans.append(slice(start, start + length))
        grid = scan.grid[spans[0], spans[1]]
        camera = replace(
            scan.camera,
            width=grid.shape[1],
            height=grid.shape[0],
            cx=scan.camera.cx - spans[1].start,
            cy=scan.camera.cy - spans[0].start,
        )
        kept = np.zeros(len(scan.points), dtype=bool)
        kept[grid[grid >= 0]] = True
        windowed = _subset(replace(scan, grid=np.ascontiguousarray(grid)), kept)
        return replace(windowed, camera=camera)

    return each(change)


def without_camera() -> Disturbance:
    """Organised grids of which nothing else is known."""
    return each(
        lambda scan, rng: replace(
            scan, camera=None, scan_from_sensor=None, viewpoint=Viewpoint.UNKNOWN
        )
    )


def as_points() -> Disturbance:
    """Bare points in random order."""
    return each(
        lambda scan, rng: RangeScan(name=scan.name, points=rng.permutation(scan.points, axis=0))
    )


def as_meshes() -> Disturbance:
    """Points and faces, cut at jumps."""

    def change(scan: RangeScan, rng: Rng) -> RangeScan:
        assert scan.grid is not None
        step = JUMP_DIAMETERS * principal_diameter(scan.points)
        faces = grid_faces(scan.grid, scan.points, scan.points[:, 2], step, step)
        return RangeScan(name=scan.name, points=scan.points, faces=faces)

    return each(change)


def scaled(factor: float) -> Disturbance:
    """The first scan is too large."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        scan = shots[0].scan
        middle = scan.points.mean(axis=0)
        larger = replace(
            scan,
            name=f"{scan.name} scaled",
            points=middle + factor * (scan.points - middle),
            camera=None,
            scan_from_sensor=None,
            viewpoint=Viewpoint.UNKNOWN,
        )
        return [replace(shots[0], scan=larger), *shots[1:]]

    return change


def mirrored() -> Disturbance:
    """The first scan has left-handed axes, as from a file with one axis the other way."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        scan = shots[0].scan
        other = RangeScan(
            name=f"{scan.name} mirrored",
            points=scan.points * np.array([-1.0, 1.0, 1.0]),
            grid=None if scan.grid is None else scan.grid[:, ::-1],
        )
        return [Shot(scan=other, world_from_sensor=None), *shots[1:]]

    return change


def with_noise_scan() -> Disturbance:
    """One scan more, of nothing but noise in the middle of the image."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        scan = shots[0].scan
        depth = _depth(scan)
        low, high = np.nanmin(depth), np.nanmax(depth)
        rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]]
        half = 0.5 * np.array(depth.shape)
        disc = np.hypot(rows - half[0], columns - half[1]) < 0.35 * min(depth.shape)
        noise = np.where(disc, rng.uniform(low, high, size=depth.shape), np.nan)
        added = replace(_with_depth(scan, noise), name="noise")
        return [*shots, Shot(scan=added, world_from_sensor=None)]

    return change


def with_other(body: str, count: int, seed: int, *, keep: int | None = None) -> Disturbance:
    """Scans of another object besides, in a world of its own; of the first only some are kept."""

    def change(shots: list[Shot], rng: Rng) -> list[Shot]:
        other = make_body(body, seed, None)
        others = _shots(other, ring(count), SLIGHT, seed, f"other {body}")
        away = Pose(rotation=random_rotation(rng), translation=rng.uniform(500, 1000, size=3))
        moved = []
        for shot in others:
            assert shot.world_from_sensor is not None
            moved.append(replace(shot, world_from_sensor=away @ shot.world_from_sensor))
        return [*shots[:keep], *moved]

    return change


def again(count: int) -> Disturbance:
    """Some of the scans a second time, in other frames."""
    return lambda shots, rng: [
        *shots,
        *(replace(s, scan=replace(s.scan, name=f"{s.scan.name} again")) for s in shots[:count]),
    ]


def _depth(scan: RangeScan) -> FloatArray:
    """Depth (H, W) of a scan in its sensor's frame, NaN where nothing was seen."""
    assert scan.grid is not None
    return np.where(scan.grid >= 0, scan.points[scan.grid, 2], np.nan)


def _with_depth(scan: RangeScan, depth: FloatArray) -> RangeScan:
    """The scan with other depths (H, W), NaN for none."""
    assert scan.camera is not None
    seen = np.isfinite(depth)
    grid = np.full(depth.shape, -1, dtype=np.int64)
    grid[seen] = np.arange(int(seen.sum()))
    points = scan.camera.unproject_image(depth)[seen]
    return replace(scan, points=points, grid=grid, colors=None)


def _subset(scan: RangeScan, kept: BoolArray) -> RangeScan:
    """Only some of the points (N,) of a scan."""
    assert scan.grid is not None
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    colors = None if scan.colors is None else scan.colors[kept]
    return replace(scan, points=scan.points[kept], grid=number[scan.grid], colors=colors)


def noise_of(share: float) -> NoiseModel:
    """A noise of depth, in diameters of the object."""
    return replace(SLIGHT, depth_diameters=share)


SIX = ring(6)
FIVE = ring(5)

SCENARIOS: Mapping[str, Scenario] = {
    # Clean
    "ring 8": Scenario(views=ring(8)),
    "ring 8 armadillo": Scenario(body="armadillo", views=ring(8)),
    "ring 8 bunny": Scenario(body="bunny", views=ring(8)),
    "ring 6": Scenario(views=SIX),
    "ring 5": Scenario(views=FIVE),
    "ring 5 armadillo": Scenario(body="armadillo", views=FIVE),
    "ring 5 bunny": Scenario(body="bunny", views=FIVE),
    "ring 4": Scenario(views=ring(4)),
    "ring 4 armadillo": Scenario(body="armadillo", views=ring(4)),
    "ring 4 bunny": Scenario(body="bunny", views=ring(4)),
    "random 8": Scenario(views=on_sphere(8)),
    "random 8 bunny": Scenario(body="bunny", views=on_sphere(8)),
    "random 12": Scenario(views=on_sphere(12)),
    "close-up": Scenario(views=ring(6, distance_diameters=1.1)),
    "orthographic": Scenario(views=ring(6, model=CameraModel.ORTHOGRAPHIC)),
    "resolution 64": Scenario(views=ring(6, pixels=(64.0,))),
    "resolution 600": Scenario(views=ring(6, pixels=(600.0,))),
    # Worse scans
    "noise 0.1%": Scenario(views=SIX, noise=noise_of(0.001)),
    "noise 0.25%": Scenario(views=SIX, noise=noise_of(0.0025)),
    "noise 0.5%": Scenario(views=SIX, noise=noise_of(0.005)),
    "noise 1%": Scenario(views=SIX, noise=noise_of(0.01)),
    "outliers 20%": Scenario(views=SIX, disturbances=(outlier_points(0.2),)),
    "dropouts 30%": Scenario(views=SIX, noise=replace(SLIGHT, dropout=0.3)),
    "flying pixels": Scenario(views=SIX, disturbances=(flying_pixels(),)),
    "resolutions 1:4": Scenario(views=ring(6, pixels=(80.0, 320.0))),
    "crop": Scenario(views=ring(6, 25.0), disturbances=(crop_to_ball(0.3),)),
    "crop without camera": Scenario(
        views=ring(6, 25.0), disturbances=(crop_to_ball(0.3), without_camera())
    ),
    "crop to window": Scenario(views=ring(8), disturbances=(crop_to_window(0.6),)),
    "turntable": Scenario(
        body="creature on disc", views=ring(6, elevations_deg=(25.0,), pixels=(260.0,))
    ),
    "scale error 1%": Scenario(views=SIX, disturbances=(scaled(1.01),)),
    # Scans that do not belong
    "2 of another object": Scenario(views=SIX, disturbances=(with_other("armadillo", 2, 0),)),
    "2 of a like object": Scenario(views=SIX, disturbances=(with_other("creature", 2, 500),)),
    "two objects half and half": Scenario(views=FIVE, disturbances=(with_other("bunny", 5, 0),)),
    "two like objects half and half": Scenario(
        views=FIVE, disturbances=(with_other("creature", 5, 500),)
    ),
    "noise scan": Scenario(views=SIX, disturbances=(with_noise_scan(),)),
    "mirrored": Scenario(views=SIX, disturbances=(mirrored(),)),
    "duplicates": Scenario(views=FIVE, disturbances=(again(3),)),
    "near-duplicates": Scenario(views=twice(ring(4), 0.5)),
    # Symmetric objects
    "sphere": Scenario(body="sphere", views=FIVE),
    "cylinder": Scenario(body="cylinder", views=FIVE),
    "cone": Scenario(body="cone", views=FIVE),
    "box": Scenario(body="box", views=FIVE),
    "plate": Scenario(body="plate", views=FIVE),
    "vase": Scenario(body="vase", views=FIVE),
    "gear": Scenario(body="gear", views=ring(5, elevations_deg=(35.0, 10.0))),
    "mirror figure": Scenario(body="mirror figure", views=SIX),
    "near-symmetric vase": Scenario(body="marked vase", views=SIX),
    "near-symmetric gear": Scenario(body="keyed gear", views=ring(6, elevations_deg=(35.0, 20.0))),
    # Formats
    "as points": Scenario(views=SIX, disturbances=(as_points(),)),
    "as meshes": Scenario(views=SIX, disturbances=(as_meshes(),)),
    "as grids": Scenario(views=SIX, disturbances=(without_camera(),)),
    "as points, noise 0.25%": Scenario(
        views=SIX, noise=noise_of(0.0025), disturbances=(as_points(),)
    ),
    "as points bunny": Scenario(body="bunny", views=SIX, disturbances=(as_points(),)),
}
