"""Virtual scans with the keypoints of all detectors, and all descriptors at any of their points."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from benchmarks.features.harris3d import harris_keypoints
from benchmarks.features.spectral import (
    energy_bands,
    full_mesh_hks,
    full_mesh_keypoints,
    full_mesh_spectrum,
    octave_times,
    si_heat_signature,
    values_at,
    wave_distances,
    wave_signature,
)
from benchmarks.paper.baselines.fpfh import fpfh
from benchmarks.paper.heat_field import HeatField, heat_field
from benchmarks.paper.views import VirtualScan, mesh_of, virtual_scan
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import principal_diameter

DETECTORS = ("PA-HKS", "HKS, full mesh", "3D Harris", "random points")
DETECTOR_OF = {
    "PA-HKS": "PA-HKS",
    "SI-HKS": "PA-HKS",
    "WKS": "PA-HKS",
    "HKS, full mesh": "HKS, full mesh",
    "FPFH": "3D Harris",
}
"""Descriptor -> the detector whose keypoints it describes; some come without one."""
DESCRIPTORS = tuple(DETECTOR_OF)

_SEEN_PIXELS = 4.0
"""How far a point may lie before or behind the surface that a scan shows at its pixel."""
_HARRIS_RADIUS = 0.03
_SPACING = 0.05
"""In diameters, as PA-HKS's keypoints."""
_HARRIS_STRIDE = 2
"""Every so-many-th row and column of the image may hold a keypoint."""
_SCALES = (2.0**-12, 2.0**3)
"""Window of SI-HKS, in squared diameters: its derivative vanishes at both ends."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FeatureView:
    """A virtual scan of an object, its heat, and keypoints (K, 3) by detector; sensor frame."""

    name: str
    virtual: VirtualScan
    heat: HeatField
    keypoints: dict[str, FloatArray]


@lru_cache(maxsize=16)
def feature_view(name: str, azimuth_deg: float, roll_deg: float) -> FeatureView:
    """Scan an object from the side and find the keypoints of all detectors."""
    virtual = virtual_scan(name, azimuth_deg, roll_deg=roll_deg)
    scan, heat = virtual.scan, heat_field(virtual.scan)
    num, samples = len(heat.keypoints), scan.samples.points
    rng = np.random.default_rng([round(azimuth_deg), 3])
    of_full_mesh = virtual.world_from_sensor.inverse().apply(_full_mesh(name)[2])
    return FeatureView(
        name=name,
        virtual=virtual,
        heat=heat,
        keypoints={
            "PA-HKS": heat.keypoints,
            "HKS, full mesh": of_full_mesh[is_seen(of_full_mesh, scan)],
            "3D Harris": _harris_keypoints_in(scan, num),
            "random points": samples[rng.choice(len(samples), num, replace=False)],
        },
    )


def is_seen(points: FloatArray, scan: PreparedScan) -> BoolArray:
    """Which points (N, 3), sensor frame, lie on the surface that the scan shows."""
    pixels, depth = scan.image.camera.project(points)
    columns, rows = np.rint(pixels).astype(np.int64).T
    height, width = scan.image.depth.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    shown = scan.image.depth[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return inside & (np.abs(shown - depth) < _SEEN_PIXELS * scan.image.pixel)


def distances(
    descriptor: str, views: Sequence[FeatureView], points: Sequence[FloatArray]
) -> FloatArray:
    """Distances (N, M) of a descriptor between points (N, 3) of a view and (M, 3) of another."""
    described = _DESCRIBE[descriptor]
    one, other = (described(view, at) for view, at in zip(views, points, strict=True))
    apart = wave_distances if descriptor == "WKS" else cdist
    return apart(one, other).astype(np.float64)


def _pa_hks(view: FeatureView, points: FloatArray) -> FloatArray:
    return values_at(view.heat.signature, view.heat.front.points, points)


def _si_hks(view: FeatureView, points: FloatArray) -> FloatArray:
    spectrum = view.heat.spectrum
    signature = si_heat_signature(spectrum.eigenvalues, spectrum.functions, octave_times(*_SCALES))
    return values_at(signature, spectrum.points, points)


def _wks(view: FeatureView, points: FloatArray) -> FloatArray:
    spectrum = view.heat.spectrum
    bands, width = energy_bands(spectrum.eigenvalues)
    signature = wave_signature(spectrum.eigenvalues, spectrum.functions, bands, width)
    return values_at(signature, spectrum.points, points)


def _full_mesh_hks(view: FeatureView, points: FloatArray) -> FloatArray:
    vertices, signature, _ = _full_mesh(view.name)
    return values_at(signature, vertices, view.virtual.world_from_sensor.apply(points))


def _fpfh(view: FeatureView, points: FloatArray) -> FloatArray:
    diameter, mesh = view.virtual.diameter, view.virtual.scan.mesh
    return fpfh(mesh.vertices / diameter, mesh.normals, points / diameter)


_DESCRIBE: dict[str, Callable[[FeatureView, FloatArray], FloatArray]] = {
    "PA-HKS": _pa_hks,
    "SI-HKS": _si_hks,
    "WKS": _wks,
    "HKS, full mesh": _full_mesh_hks,
    "FPFH": _fpfh,
}


@lru_cache
def _full_mesh(name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vertices of the thinned mesh, their signatures, and the places of its keypoints; world."""
    mesh = mesh_of(name)
    spectrum, faces = full_mesh_spectrum(mesh)
    signature = full_mesh_hks(spectrum)
    at = full_mesh_keypoints(spectrum, faces, signature, principal_diameter(mesh.vertices))
    return spectrum.points, signature, spectrum.points[at]


def _harris_keypoints_in(scan: PreparedScan, max_count: int) -> FloatArray:
    """The strongest corners of a scan's surface, away from its rims."""
    image = scan.image
    rows, columns = np.nonzero(np.isfinite(image.depth))
    is_rim = image.is_rim[rows, columns]
    on_grid = (rows % _HARRIS_STRIDE == 0) & (columns % _HARRIS_STRIDE == 0)
    points, radius = scan.mesh.vertices, _HARRIS_RADIUS * scan.diameter
    at = np.flatnonzero(on_grid & ~is_rim)
    # A neighbourhood cut in half by a rim bends where the surface does not.
    from_rim, _ = KDTree(points[is_rim]).query(points[at])
    at = at[from_rim > 0.5 * radius]
    return points[harris_keypoints(points, at, radius, _SPACING * scan.diameter, max_count)]
