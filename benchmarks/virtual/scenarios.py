"""The named scenarios: what is scanned, from where, and what goes wrong."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from benchmarks.virtual.crops import crop_above, crop_by_hand, crop_to_ball, crop_to_window
from benchmarks.virtual.disturbances import again, flying_pixels, mirrored, outlier_points, scaled
from benchmarks.virtual.formats import as_meshes, as_points, without_camera
from benchmarks.virtual.scene import Group, Scenario
from benchmarks.virtual.scenery import (
    held_by_hand,
    on_table,
    on_table_turned_over,
    on_turntable,
    turned_over,
)
from benchmarks.virtual.shots import SLIGHT, on_sphere, ring, twice
from benchmarks.virtual.strangers import LIKE, half_of, noise_scan, two_of
from scanweld.evaluation.scanner import NoiseModel
from scanweld.geometry.camera import CameraModel

SCALE = 1.01
"""Of the scan whose scale is wrong."""
ARM_SHARE = 0.1
ALIKE_DEG = 0.5
"""Between near-duplicates."""
FROM_ABOVE_DEG = (25.0, 40.0)
"""Elevations from which a table is seen, and whatever stands on it."""

SIX, FIVE = ring(6), ring(5)
ARC = ring(6, 25.0)


def _noise(share: float) -> NoiseModel:
    """A noise of depth, in diameters of the object."""
    return replace(SLIGHT, depth_diameters=share)


_hard = partial(replace, Scenario(group=Group.HARD, seeds=8, views=SIX))
"""One condition alone, on the same chains as the clean ring of six."""
_clean = partial(_hard, group=Group.CLEAN)
_crop = partial(_hard, group=Group.CROP, seeds=6, views=ARC)
_symmetric = partial(_hard, group=Group.SYMMETRIC, seeds=5, views=FIVE, min_overlap=0.0)
"""Solids of which no pose of a scan is the only one."""
_reported = partial(_hard, group=Group.REPORTED, seeds=5)

SCENARIOS: Mapping[str, Scenario] = {
    # Nothing goes wrong
    "ring of 6": _clean(seeds=12),
    "ring of 8": _clean(seeds=8, views=ring(8)),
    "12 from anywhere": _clean(seeds=4, views=on_sphere(12)),
    "close-up": _clean(seeds=5, views=ring(6, distance_diameters=1.1)),
    "orthographic": _clean(seeds=5, views=ring(6, model=CameraModel.ORTHOGRAPHIC)),
    # Worse scans
    "noise 0.25 %": _hard(noise=_noise(0.0025)),
    "noise 0.5 %": _hard(noise=_noise(0.005)),
    "outliers 20 %": _hard(disturbances=(outlier_points(0.2),)),
    "dropouts 30 %": _hard(noise=replace(SLIGHT, dropout=0.3)),
    "flying pixels": _hard(disturbances=(flying_pixels(),)),
    "resolutions 1:4": _hard(views=ring(6, pixels=(80.0, 320.0))),
    "scale error 1 %": _hard(group=Group.SCALE, disturbances=(scaled(SCALE),), spoils_first=True),
    # Background that is not free
    "crop to a ball": _crop(crop=crop_to_ball(0.25)),
    "crop to a ball, no camera": _crop(crop=crop_to_ball(0.25), disturbances=(without_camera(),)),
    "crop at a height": _crop(views=SIX, crop=crop_above(0.65)),
    "crop by hand": _crop(views=ring(8), crop=crop_by_hand(0.75)),
    "crop to the image": _crop(views=ring(8), crop=crop_to_window(0.75)),
    # What is not the object
    "table": _hard(views=ring(6, elevations_deg=FROM_ABOVE_DEG), taking=on_table),
    "turntable": _hard(views=ring(6, elevations_deg=FROM_ABOVE_DEG), taking=on_turntable),
    "hand": _hard(taking=held_by_hand(2, ARM_SHARE)),
    # Scans that do not belong
    "2 of another object": _hard(strangers=two_of("other thing")),
    "2 of a like object": _hard(strangers=two_of("thing", LIKE)),
    "two objects": _hard(seeds=5, strangers=half_of("other thing", SIX)),
    "two like objects": _hard(seeds=5, strangers=half_of("thing", SIX, LIKE)),
    "noise scan": _hard(seeds=6, strangers=noise_scan),
    "mirrored scan": _hard(disturbances=(mirrored(),), spoils_first=True),
    "duplicates": _hard(seeds=6, disturbances=(again(3),)),
    "near-duplicates": _hard(seeds=6, views=twice(SIX, 3, ALIKE_DEG)),
    # Nearly symmetric
    "figure with a mirror plane": _hard(body="mirror figure"),
    "vase with a knob": _hard(seeds=6, body="marked vase"),
    "gear with a worn tooth": _hard(
        seeds=6, body="marked gear", views=ring(6, elevations_deg=(35.0, 20.0))
    ),
    # Symmetric
    "sphere": _symmetric(body="sphere"),
    "cylinder": _symmetric(body="cylinder"),
    "cone": _symmetric(body="cone"),
    "box": _symmetric(body="box"),
    "plate": _symmetric(body="plate"),
    "vase": _symmetric(body="vase"),
    "gear": _symmetric(body="gear", views=ring(5, elevations_deg=(35.0, 10.0))),
    # Nothing is asked of these but that no scan is called good wrongly
    "noise 1 %": _reported(seeds=8, noise=_noise(0.01)),
    "ring of 5": _reported(seeds=4, views=FIVE, min_overlap=0.0),
    "ring of 4": _reported(seeds=4, views=ring(4), min_overlap=0.0),
    "8 from anywhere": _reported(seeds=4, views=on_sphere(8), min_overlap=0.0),
    "64 pixels across": _reported(seeds=4, views=ring(6, pixels=(64.0,))),
    "table, turned over": _reported(
        seeds=5,
        views=turned_over(ring(5, elevations_deg=FROM_ABOVE_DEG)),
        taking=on_table_turned_over,
    ),
    "bare points": _reported(disturbances=(as_points(),)),
    "meshes": _reported(disturbances=(as_meshes(),)),
    "grids": _reported(disturbances=(without_camera(),)),
    "bare points, noise 0.25 %": _reported(noise=_noise(0.0025), disturbances=(as_points(),)),
}
