"""Scan -> prepared scan: sensor located, rendered into a range image, sampled evenly."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.prepared import PreparedScan, RangeImage, Samples
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.preparation.range_image import make_range_image
from scanweld.preparation.resolution import point_spacing
from scanweld.preparation.sampling import farthest_points
from scanweld.preparation.sensor import MIN_POINTS, locate_sensor
from scanweld.preparation.strays import without_strays
from scanweld.preparation.support import find_support

if TYPE_CHECKING:
    from scanweld.config import PrepareConfig

MIN_SURFACE_PIXELS = 200
"""Pixels of surface that a scan must have to be registered."""


def prepare(
    scan: RangeScan, config: "PrepareConfig", *, without_support: bool = False
) -> PreparedScan:
    """Make a scan ready for registration.

    Args:
        scan: Any scan.
        config: Settings.
        without_support: Whether the plane that the object stands on, if any, is left out.

    Raises:
        InputError: If the scan shows too little surface to be registered.
    """
    located = locate_sensor(scan)
    resolution = point_spacing(located.points)
    clean, points, num_support = _cleaned(located, resolution, without_support)
    if num_support:
        note = f"the flat support under the object is left out: {num_support} points"
        located = replace(located, notes=(*located.notes, note))
    diameter = principal_diameter(points)
    image, mesh = make_range_image(clean, points, resolution, diameter, config)
    samples = take_samples(image, config.num_samples)
    if len(mesh.vertices) < MIN_SURFACE_PIXELS or len(samples.points) < MIN_POINTS:
        raise InputError(
            f"{scan.name}: only {len(mesh.vertices)} pixels of connected surface among "
            f"{len(scan.points)} points; a scan needs a surface seen from one side"
        )
    return PreparedScan(
        scan=located,
        image=image,
        mesh=mesh,
        samples=samples,
        resolution=resolution,
        diameter=diameter,
        content_hash=scan.content_hash(),
        is_without_support=num_support > 0,
    )


def surface_points(scan: PreparedScan) -> tuple[RangeScan, FloatArray]:
    """What a scan's image was made of: the scan without what was left out, and its points.

    Returns:
        The scan, and its points (N, 3) in the sensor frame.
    """
    clean, points, _ = _cleaned(scan.scan, scan.resolution, scan.is_without_support)
    return clean, points


def _cleaned(
    located: RangeScan, resolution: float, without_support: bool
) -> tuple[RangeScan, FloatArray, int]:
    """The scan without strays and support, its points in the sensor frame, size of the support."""
    sensor_from_scan = located.sensor_pose.inverse()
    clean = without_strays(located, sensor_from_scan.apply(located.points), resolution)
    points = sensor_from_scan.apply(clean.points)
    support = find_support(points, resolution) if without_support else None
    if support is None:
        return clean, points, 0
    return clean.only(~support), points[~support], int(support.sum())


def stands_on_support(scan: PreparedScan) -> bool:
    """Whether a scan shows the plane that the object stands on."""
    points = scan.image.points()
    return find_support(points[np.isfinite(scan.image.depth)], scan.image.pixel) is not None


def take_samples(image: RangeImage, num_samples: int) -> Samples:
    """Oriented points of an image, even by area, off the rims and not at grazing incidence."""
    candidates, normals = image.points()[image.is_reliable], image.normals[image.is_reliable]
    chosen = farthest_points(candidates, num_samples)
    return Samples(points=candidates[chosen], normals=normals[chosen])
