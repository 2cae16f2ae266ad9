"""Posed scans -> one mesh."""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scanweld.config import FusionConfig, PrepareConfig
from scanweld.errors import InputError
from scanweld.fusion.agreement import measure_agreement
from scanweld.fusion.color import blend_colors
from scanweld.fusion.finish import (
    chosen_pieces,
    close_pinholes,
    decimated,
    smoothed,
    split_fans,
)
from scanweld.fusion.holes import closed_field
from scanweld.fusion.integrate import integrate
from scanweld.fusion.noise import with_noise
from scanweld.fusion.posed_image import PosedImage, free_space_trusts, pose_image
from scanweld.fusion.sheets import NORMAL_ROUNDS, without_second_sheets
from scanweld.fusion.surface import extract_surface, vertex_flags
from scanweld.fusion.volume import DEPTH_VOXELS
from scanweld.fusion.voxels import image_pixels, voxel_edge
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.gauss_newton import NEARLY_ALL_SIGMAS
from scanweld.geometry.mesh import TriangleMesh, smoothed_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.work.progress import Cache, NoCache, silent
from scanweld.work.stage_log import Stages, work_key

logger = logging.getLogger(__name__)

_PINHOLE_VOXELS = 12.0
"""Length of the border, in voxels, up to which a hole is closed: it comes from a single cell."""
_FILLED_ROUNDS = 20
"""Rounds of smoothing of the faces that close holes: the border of space seen empty has steps."""


def fuse(
    scans: Sequence[PreparedScan],
    world_from_sensor: Sequence[Pose],
    config: FusionConfig,
    *,
    prepare: PrepareConfig | None = None,
    workers: int = 1,
    cache: Cache | None = None,
) -> TriangleMesh:
    """Fuse posed scans into one mesh, cut off where no scan saw a surface.

    Args:
        scans: Prepared scans of one object; their order does not matter.
        world_from_sensor: A pose for each.
        config: Settings.
        prepare: Settings that the scans were prepared with; the defaults if not given.
        workers: Threads; the result is the same for any number.
        cache: Keeps the scans' images.

    Returns:
        The mesh in the world frame with unit normals that point out, the number of scans that
        agree on each vertex, its standard deviation, and colours if one of the scans has them.

    Raises:
        InputError: If there is no surface to fuse, or the scans lie too far apart.
        ValueError: If there are not as many poses as scans.
    """
    if len(scans) != len(world_from_sensor):
        raise ValueError(f"{len(scans)} scans, but {len(world_from_sensor)} poses")
    if not scans:
        raise InputError("there is no surface to fuse: give at least one scan")
    stages = Stages(workers=workers, cache=cache or NoCache(), progress=silent)
    images = _images(scans, world_from_sensor, config, prepare or PrepareConfig(), stages)
    voxel = voxel_edge(scans, config)
    depth = max(DEPTH_VOXELS * voxel, NEARLY_ALL_SIGMAS * max(image.noise for image in images))
    truncation = max(config.truncation_voxels * voxel, 2.0 * depth)
    vertices, faces, filled = _surface(images, voxel, truncation, depth, config, workers)
    if not len(faces):
        raise InputError(
            "no surface is left of the posed scans, because they contradict each other everywhere: "
            "check their poses"
        )
    vertices = smoothed(vertices, faces, config.smooth)
    if config.faces is not None:
        vertices, faces, filled = decimated(vertices, faces, filled, config.faces)
    logger.debug("fused %d scans into %d faces", len(scans), len(faces))
    return _with_attributes(vertices, faces, filled, images, voxel, workers)


def _images(
    scans: Sequence[PreparedScan],
    world_from_sensor: Sequence[Pose],
    config: FusionConfig,
    prepare: PrepareConfig,
    stages: Stages,
) -> list[PosedImage]:
    """The scans' images at full resolution, in an order that depends on their content alone."""
    posed = sorted(
        zip(scans, world_from_sensor, strict=True),
        key=lambda both: (both[0].content_hash, both[1].matrix().tobytes()),
    )
    pixels = image_pixels([scan for scan, _ in posed], config)
    kept = stages.done(
        lambda k: pose_image(posed[k][0], Pose.identity(), pixels[k], prepare),
        range(len(posed)),
        lambda k: work_key("image", posed[k][0].work_hash, pixels[k], prepare),
    )
    images = [
        replace(image, sensor_from_world=pose.inverse())
        for image, (_, pose) in zip(kept, posed, strict=True)
    ]
    trusts = free_space_trusts(images)
    return with_noise(
        [replace(image, trust=float(t)) for image, t in zip(images, trusts, strict=True)],
        stages.workers,
    )


def _surface(
    images: Sequence[PosedImage],
    voxel: float,
    truncation: float,
    depth: float,
    config: FusionConfig,
    workers: int,
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Vertices, faces, and which of the vertices were not measured."""
    vertices, faces, filled = _extracted(images, voxel, truncation, depth, config, workers)
    faces, parts = split_fans(faces)
    vertices, faces, filled = chosen_pieces(
        vertices[parts], faces, filled[parts], voxel, config.component
    )
    vertices, faces, filled = close_pinholes(vertices, faces, filled, _PINHOLE_VOXELS * voxel)
    return smoothed(vertices, faces, _FILLED_ROUNDS, filled), faces, filled


def _extracted(
    images: Sequence[PosedImage],
    voxel: float,
    truncation: float,
    depth: float,
    config: FusionConfig,
    workers: int,
) -> tuple[FloatArray, IntArray, BoolArray]:
    """The same as it comes out of the voxels, which take much memory and are let go here."""
    volume = integrate(images, voxel, truncation, depth, workers)
    logger.debug("%d blocks of voxels of %.4g", len(volume.blocks), voxel)
    closing = config.holes
    if closing == "open" and config.watertight:
        closing = "fill"
    if closing == "open":
        vertices, faces = extract_surface(volume)
        del volume
        vertices, faces = _seen_part(vertices, faces, images, voxel, workers)
        return vertices, faces, np.zeros(len(vertices), dtype=bool)
    field = closed_field(volume, images, closing, depth, workers)
    vertices, faces = extract_surface(field.volume, field.distance)
    return vertices, faces, ~vertex_flags(field.volume, field.is_measured, vertices)


def _seen_part(
    vertices: FloatArray,
    faces: IntArray,
    images: Sequence[PosedImage],
    voxel: float,
    workers: int,
) -> tuple[FloatArray, IntArray]:
    """The part of the surface that scans agree on, as a manifold without double layers."""
    normals = smoothed_normals(vertices, faces, NORMAL_ROUNDS)
    agreement = measure_agreement(images, vertices, normals, voxel, workers)
    faces = faces[(agreement.count > 0)[faces].all(axis=1)]
    return without_second_sheets(vertices, faces, agreement, voxel)


def _with_attributes(
    vertices: FloatArray,
    faces: IntArray,
    filled: BoolArray,
    images: Sequence[PosedImage],
    voxel: float,
    workers: int,
) -> TriangleMesh:
    """The mesh with normals, colours and accuracy of each vertex."""
    normals = smoothed_normals(vertices, faces, NORMAL_ROUNDS)
    agreement = measure_agreement(images, vertices, normals, voxel, workers)
    filled = filled | (agreement.count == 0)
    return TriangleMesh(
        vertices=vertices,
        faces=faces,
        normals=normals,
        colors=blend_colors(vertices, normals, images, 2.0 * voxel, workers),
        support=np.where(filled, 0, agreement.count),
        stdev=np.where(filled, np.nan, agreement.stdev),
        filled=filled,
    )
