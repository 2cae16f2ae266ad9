"""PA-HKS features of a scan (paper 3.1): keypoints on its surface and their heat signatures."""

import logging
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import ArpackError
from scipy.spatial import KDTree

from scanweld.config import HeatConfig
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray, frozen
from scanweld.geometry.prepared import PreparedScan, RangeImage
from scanweld.heat.front import FrontMesh, thin_front
from scanweld.heat.keypoints import group, persistent_maxima
from scanweld.heat.laplacian import eigenpairs
from scanweld.heat.signature import diffusion_times, heat_signature, sun_times
from scanweld.heat.surface import heat_surface

_VERTICES_PER_MODE = 2
"""Least number of front vertices for each eigenmode: fewer do not resolve the modes."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Features:
    """PA-HKS keypoints of a scan, strongest first; sensor frame.

    Attributes:
        points: (K, 3) measured points of the front surface, away from rims.
        normals: (K, 3) unit, smoothed, towards the sensor.
        signatures: (K, T) log of the heat signature over the heat trace.
        strengths: (K,) how far the log signature rises above its median over the front.
        times: (T,) diffusion times in squared diameters.
        found_at: (K, 3) where the maximum was found on the front, before it was moved off a rim.
    """

    points: FloatArray
    normals: FloatArray
    signatures: FloatArray
    strengths: FloatArray
    times: FloatArray
    found_at: FloatArray

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        k, t = len(self.points), len(self.times)
        put("points", frozen(self.points, np.float64, (k, 3)))
        put("normals", frozen(self.normals, np.float64, (k, 3)))
        put("signatures", frozen(self.signatures, np.float64, (k, t)))
        put("strengths", frozen(self.strengths, np.float64, (k,)))
        put("times", frozen(self.times, np.float64, (t,)))
        put("found_at", frozen(self.found_at, np.float64, (k, 3)))

    def __len__(self) -> int:
        return len(self.points)


def describe(scan: PreparedScan, config: HeatConfig) -> Features:
    """PA-HKS keypoints of a scan, with their signatures.

    A scan whose surface is too small for the modes, or whose eigenproblem is not solved, gets
    none; the log says why.
    """
    front = thin_front(scan.image, config.max_front_vertices, bridged=config.jumps == "bridged")
    if len(front.points) < _VERTICES_PER_MODE * config.num_modes:
        logger.info(
            "%s: no heat keypoints, because %d vertices are too few for the modes",
            scan.name,
            len(front.points),
        )
        return _no_features(config.num_times)
    mesh = heat_surface(front, scan.image.camera, scan.diameter, config.surface)
    if len(mesh.vertices) - len(mesh.cold) <= config.num_modes:
        logger.info("%s: no heat keypoints, because too few vertices are off the rims", scan.name)
        return _no_features(config.num_times)
    vertices = (mesh.vertices - mesh.vertices.mean(axis=0)) / scan.diameter
    try:
        eigenvalues, functions = eigenpairs(vertices, mesh.faces, config.num_modes, mesh.cold)
    except ArpackError as error:
        logger.warning("%s: no heat keypoints, eigenproblem not solved (%s)", scan.name, error)
        return _no_features(config.num_times)
    times = _times(eigenvalues, config)
    signature = heat_signature(eigenvalues, functions, times)
    # Heat on walls and back depends on where the sensor stood: only the front's maxima are taken.
    surface = signature[: mesh.num_front]
    maxima = persistent_maxima(
        surface, front.points / scan.diameter, front.faces, config.group_diameters
    )
    reach = config.group_diameters * scan.diameter
    anchors, is_kept = move_off_rims(front, scan.image, maxima.vertices, reach)
    found, strengths = maxima.vertices[is_kept], maxima.strengths[is_kept]
    chosen = group(front.points[anchors], surface[anchors], strengths, reach)
    rows, columns = front.pixels[anchors[chosen]].T
    return Features(
        points=front.points[anchors[chosen]],
        normals=scan.image.normals[rows, columns],
        signatures=surface[anchors[chosen]],
        strengths=strengths[chosen],
        times=times,
        found_at=front.points[found[chosen]],
    )


def _times(eigenvalues: FloatArray, config: HeatConfig) -> FloatArray:
    if config.times == "sun":
        return sun_times(eigenvalues, config.num_times)
    return diffusion_times(eigenvalues, config.num_times, config.longest_time_diameters2)


def move_off_rims(
    front: FrontMesh, image: RangeImage, at: IntArray, reach: float
) -> tuple[IntArray, BoolArray]:
    """The nearest front vertices that can be anchors, and which of the given ones (K,) have one.

    An anchor is a measured pixel away from rims and grazing incidence.
    """
    rows, columns = front.pixels.T
    usable = np.flatnonzero(image.is_reliable[rows, columns])
    if len(usable) == 0 or len(at) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(len(at), dtype=bool)
    distance, nearest = map(np.atleast_1d, KDTree(front.points[usable]).query(front.points[at]))
    is_kept = distance < reach
    return usable[nearest[is_kept]], is_kept


def _no_features(num_times: int) -> Features:
    none = np.zeros((0, 3))
    return Features(
        points=none,
        normals=none,
        signatures=np.zeros((0, num_times)),
        strengths=np.zeros(0),
        times=np.zeros(num_times),
        found_at=none,
    )
