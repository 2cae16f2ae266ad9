"""Scan -> prepared scan: sensor located, rendered into a range image, sampled evenly."""

import numpy as np

from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.geometry.prepared import PreparedScan, RangeImage, Samples
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.prepare.range_image import make_range_image
from scanweld.prepare.resolution import point_spacing
from scanweld.prepare.sampling import farthest_points
from scanweld.prepare.sensor import locate_sensor
from scanweld.prepare.strays import without_strays

MIN_SURFACE_PIXELS = 200
MIN_SAMPLES = 50


def prepare(scan: RangeScan, config: PrepareConfig) -> PreparedScan:
    """Make a scan ready for registration.

    Raises:
        InputError: If the scan shows too little surface to be registered.
    """
    located = locate_sensor(scan)
    sensor_from_scan = located.sensor_pose.inverse()
    resolution = point_spacing(located.points)
    clean = without_strays(located, sensor_from_scan.apply(located.points), resolution)
    diameter = principal_diameter(clean.points)
    points = sensor_from_scan.apply(clean.points)
    image, mesh = make_range_image(clean, points, resolution, diameter, config)
    samples = take_samples(image, config)
    if len(mesh.vertices) < MIN_SURFACE_PIXELS or len(samples.points) < MIN_SAMPLES:
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
    )


def take_samples(image: RangeImage, config: PrepareConfig) -> Samples:
    """Oriented points of an image, even by area, off the rims and not at grazing incidence."""
    points = image.points()
    toward = -np.einsum("hwk,hwk->hw", image.camera.view_directions(points), image.normals)
    with np.errstate(invalid="ignore"):
        usable = np.isfinite(image.depth) & ~image.is_rim & (toward > config.min_cosine)
    candidates, normals = points[usable], image.normals[usable]
    chosen = farthest_points(candidates, config.num_samples)
    return Samples(points=candidates[chosen], normals=normals[chosen])
