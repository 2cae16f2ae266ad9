"""The named scenarios: what is scanned, from where, and what goes wrong."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.virtual import disturbances as harm
from benchmarks.virtual import sensors, trims
from benchmarks.virtual.disturbances import Disturbance, alike, drawn, each, in_turn, one_of
from benchmarks.virtual.rooms import in_standing_room, turned_before_sensor, with_lid_opened
from benchmarks.virtual.scene import BASIN, Group, Scenario
from benchmarks.virtual.scenery import (
    held_by_hand,
    on_table,
    on_table_turned_over,
    on_turntable,
    turned_over,
)
from benchmarks.virtual.shots import SLIGHT, on_sphere, ring, twice
from scanweld.geometry.camera import CameraModel

SCALE = 1.01
"""Of the scan whose scale is wrong."""
FROM_ABOVE_DEG = (25.0, 40.0)
"""Elevations from which a table is seen, and whatever stands on it."""

SIX, FIVE, EIGHT = (partial(ring, count=count) for count in (6, 5, 8))
ARC = partial(SIX, step_deg=25.0)
SMALL = partial(FIVE, step_deg=40.0, pixels=(150.0,))
ABOVE = partial(SIX, elevations_deg=FROM_ABOVE_DEG)
TURNED = partial(turned_over, half=partial(FIVE, elevations_deg=FROM_ABOVE_DEG))
TURNTABLE = partial(turned_before_sensor, count=6)
BALL = partial(harm.crop_to_ball, radius_diameters=0.25)
GRIDS = each(harm.without_camera)
POINTS, SEEN = each(harm.as_points), each(harm.as_points_seen)
OTHERS = partial(harm.half_of, views=SIX)

TRIMMED = in_turn(
    drawn(sensors.without_grazing, max_incidence_deg=(60.0, 78.0)),
    one_of(
        drawn(trims.trimmed_along_curve, share=(0.7, 0.95)), drawn(trims.boxed, share=(0.7, 0.95))
    ),
    drawn(trims.with_holes, count=(0.0, 4.0), radius_diameters=(0.02, 0.06)),
)
"""Range maps as people leave them."""
NO_GRID = one_of(POINTS, SEEN)


def stereo(*, short_percent: float, long_percent: float) -> tuple[Disturbance, ...]:
    """A depth camera of two eyes, the object cut out.

    Args:
        short_percent: Root mean square distance between two scans of the same surface at their true
            poses that comes from waves shorter than the object, in percent of the diameter, to
            within a fifth: no pose takes it away.
        long_percent: The same of longer waves, which shift and turn the scan for the most part.
    """
    short, long = (
        {"rms_diameters": (0.8 * rms, 1.2 * rms), "length_diameters": lengths}
        for rms, lengths in (
            (0.01 * short_percent / np.sqrt(2.0), (0.15, 0.35)),
            (0.01 * long_percent / np.sqrt(2.0), (1.0, 2.0)),
        )
    )
    return (
        drawn(sensors.depth_waves, **short),
        drawn(sensors.depth_waves, **long),
        drawn(sensors.stereo_shadow, baseline_diameters=(0.1, 0.3)),
        drawn(sensors.eaten_edges, least=(0.0, 1.5), most=(1.5, 4.0)),
        drawn(sensors.quantised, step_diameters=(0.001, 0.005)),
    )


WHOLE_FRAMES = (
    # The room is about five times as large as the object, and errs alike as long as it stands.
    alike(drawn(sensors.depth_waves, of_depth=(0.002, 0.01), length_diameters=(0.05, 0.1))),
    drawn(sensors.stereo_shadow, baseline_diameters=(0.02, 0.06)),
    drawn(sensors.eaten_edges, least=(0.0, 1.0), most=(1.0, 3.0)),
    drawn(sensors.quantised, step_diameters=(0.0003, 0.001)),
)

_noise = partial(replace, SLIGHT)
_hard = partial(replace, Scenario(group=Group.HARD, seeds=8, views=SIX))
"""One condition alone, on the same chains as the clean ring of six."""
_clean = partial(_hard, group=Group.CLEAN, seeds=5)
_crop = partial(_hard, group=Group.CROP, seeds=6)
_symmetric = partial(_hard, group=Group.SYMMETRIC, seeds=5, views=FIVE, min_overlap=0.0)
"""Solids of which no pose of a scan is the only one."""
_reported = partial(_hard, group=Group.REPORTED, seeds=5)
_files = partial(_hard, group=Group.FILES, seeds=25, views=SMALL)
"""Clean scans in files of all sorts, which nobody must accuse of a wrong scale."""
_sensor = partial(_hard, group=Group.SENSOR)
"""What real sensors do, and files that say less, with settings drawn from ranges."""
_two_bodies = partial(_hard, group=Group.TWO_BODIES, taking=in_standing_room)
"""Not all that is seen moves as one body."""

SCENARIOS: Mapping[str, Scenario] = {
    # Nothing goes wrong
    "ring of 6": _clean(seeds=12),
    "ring of 8": _clean(seeds=8, views=EIGHT),
    "12 from anywhere": _clean(seeds=4, views=partial(on_sphere, count=12)),
    "close-up": _clean(views=partial(SIX, distance_diameters=1.1)),
    "orthographic": _clean(views=partial(SIX, model=CameraModel.ORTHOGRAPHIC)),
    # Worse scans; noise of depth is in diameters of the object
    "noise 0.25 %": _hard(noise=_noise(depth_diameters=0.0025)),
    "noise 0.5 %": _hard(noise=_noise(depth_diameters=0.005)),
    "outliers 20 %": _hard(disturbances=(each(harm.outlier_points, share=0.2),)),
    "dropouts 30 %": _hard(noise=_noise(dropout=0.3)),
    "flying pixels": _hard(disturbances=(each(harm.flying_pixels),)),
    "resolutions 1:4": _hard(views=partial(SIX, pixels=(80.0, 320.0))),
    "scale error 1 %": _hard(
        group=Group.SCALE, disturbances=(partial(harm.scaled, factor=SCALE),), spoils_first=True
    ),
    "scale error 1 %, points and viewpoint": _hard(
        group=Group.SCALE,
        disturbances=(partial(harm.scaled, factor=SCALE), SEEN),
        spoils_first=True,
    ),
    # Background that is not free
    "crop to a ball": _crop(views=ARC, crop=BALL),
    "crop to a ball, no camera": _crop(views=ARC, crop=BALL, disturbances=(GRIDS,)),
    "crop at a height": _crop(crop=partial(harm.crop_above, share=0.65)),
    "crop by hand": _crop(views=EIGHT, crop=each(harm.crop_by_hand, share=0.75)),
    "crop to the image": _crop(views=EIGHT, crop=each(harm.crop_to_window, share=0.75)),
    # What is not the object
    "table": _hard(views=ABOVE, taking=on_table),
    "turntable": _hard(views=ABOVE, taking=on_turntable),
    "hand": _hard(taking=held_by_hand),
    # Scans that do not belong
    "2 of another object": _hard(strangers=partial(harm.two_of, body="other thing")),
    "2 of a like object": _hard(strangers=partial(harm.two_of, body="thing", seeds_on=harm.LIKE)),
    "two objects": _hard(seeds=5, strangers=partial(OTHERS, body="other thing")),
    "two like objects": _hard(seeds=5, strangers=partial(OTHERS, body="thing", seeds_on=harm.LIKE)),
    "noise scan": _hard(seeds=6, strangers=harm.noise_scan),
    "mirrored scan": _hard(disturbances=(harm.mirrored,), spoils_first=True),
    "duplicates": _hard(seeds=6, disturbances=(partial(harm.again, count=3),)),
    "near-duplicates": _hard(seeds=6, views=partial(twice, views=SIX, count=3, apart_deg=0.5)),
    # Nearly symmetric
    "taken twice": _hard(seeds=6, views=partial(twice, views=SIX, count=3, apart_deg=0.0)),
    "figure with a mirror plane": _hard(body="mirror figure"),
    "vase with a knob": _hard(seeds=6, body="marked vase"),
    "gear with a worn tooth": _hard(
        seeds=6, body="marked gear", views=partial(SIX, elevations_deg=(35.0, 20.0))
    ),
    # Files
    "file: range image": _files(),
    "file: bare points": _files(disturbances=(POINTS,)),
    "file: points and viewpoint": _files(disturbances=(SEEN,)),
    "file: mesh": _files(disturbances=(each(harm.as_mesh),)),
    # Real sensors
    "trimmed maps": _sensor(views=EIGHT, crop=TRIMMED, min_kept=0.95),
    "no grid": _sensor(disturbances=(NO_GRID,), min_kept=0.97),
    "correlated error 1.5 %": _sensor(
        disturbances=stereo(short_percent=0.5, long_percent=1.4), limits=BASIN, min_kept=0.85
    ),
    "correlated error 0.5 %": _sensor(
        disturbances=stereo(short_percent=0.5, long_percent=0.0), limits=BASIN
    ),
    "scale +-2 %": _sensor(disturbances=(partial(harm.scales, within=0.02),), limits=BASIN),
    # Not all that is seen moves as one body
    "standing background": _two_bodies(seeds=20, views=TURNTABLE, disturbances=WHOLE_FRAMES),
    "lid opened": _two_bodies(views=EIGHT, taking=with_lid_opened),
    # Symmetric
    **{name: _symmetric(body=name) for name in ("sphere", "cylinder", "cone", "box", "plate")},
    "vase": _symmetric(body="vase"),
    "gear": _symmetric(body="gear", views=partial(FIVE, elevations_deg=(35.0, 10.0))),
    # Nothing is asked of these but that no scan is called good wrongly
    "noise 1 %": _reported(seeds=8, noise=_noise(depth_diameters=0.01)),
    "ring of 5": _reported(seeds=4, views=FIVE, min_overlap=0.0),
    "ring of 4": _reported(seeds=4, views=partial(ring, count=4), min_overlap=0.0),
    "8 from anywhere": _reported(seeds=4, views=partial(on_sphere, count=8), min_overlap=0.0),
    "64 pixels across": _reported(seeds=4, views=partial(SIX, pixels=(64.0,))),
    "hand in every scan": _reported(taking=partial(held_by_hand, num_held=6)),
    "table, turned over": _reported(views=TURNED, taking=on_table_turned_over),
    "bare points": _reported(disturbances=(POINTS,)),
    "meshes": _reported(disturbances=(each(harm.as_mesh),)),
    "grids": _reported(disturbances=(GRIDS,)),
    "bare points, noise 0.25 %": _reported(
        noise=_noise(depth_diameters=0.0025), disturbances=(POINTS,)
    ),
}
